// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/ply_elements.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "sdf/base/parallel_parts.h"
#include "sdf/io/text_records.h"

namespace bilayer::detail {
namespace {

/// Reads consecutive values from binary data.
class BinaryValues {
  public:
    BinaryValues(const PlyHeader& header, const PlyData& data) : header_(header), data_(data) {}

    double real(PlyType type) { return loadAs<double>(type); }
    long long integer(PlyType type) { return loadAs<long long>(type); }
    void skip(PlyType type, std::uint64_t count) {
        if (count > std::uint64_t(data_.size()) / sizeOf(type)) header_.failTooShort();
        data_.at += count * sizeOf(type);
    }

    void endRecord() const {}

    [[noreturn]] void fail(const std::string& why) const { header_.fail(why); }

    /// What is left to read.
    const PlyData& data() const { return data_; }

  private:
    template <class Value>
    Value loadAs(PlyType type) {
        const char* at = take(sizeOf(type));
        return withPlyType(type, [&](auto stored) { return Value(loadPly<decltype(stored)>(at, data_.swapped)); });
    }

    const char* take(std::size_t size) {
        if (data_.size() < size) header_.failTooShort();
        return std::exchange(data_.at, data_.at + size);
    }

    const PlyHeader& header_;
    PlyData data_;
};

/// Reads consecutive values from text, whose words are values.
class TextValues {
  public:
    TextValues(const TextSource& source, Cursor& at) : source_(source), at_(at) {}

    double real(PlyType) {
        double value = 0;
        const char* begin = next();
        if (!at_.number(value) || !isAtWordEnd()) source_.failExpected(begin, "a number");
        return value;
    }
    long long integer(PlyType) {
        long long value = 0;
        const char* begin = next();
        if (!at_.integer(value) || !isAtWordEnd()) source_.failExpected(begin, "an integer");
        return value;
    }
    void skip(PlyType, std::uint64_t count) {
        for (; count > 0; --count) {
            const char* begin = next();
            if (at_.word().empty()) source_.failExpected(begin, "a number");
        }
    }

    /// Each element has its own lines.
    void endRecord() {
        at_.skipBlanks();
        if (!at_.atEnd() && !isLineEnd(*at_.at)) source_.failExpected(at_.at, "the end of the line");
    }

    [[noreturn]] void fail(const std::string& why) const { source_.fail(at_.at, why); }

  private:
    const char* next() {
        at_.skipSpace();
        return at_.at;
    }
    bool isAtWordEnd() const { return at_.atEnd() || isSpace(*at_.at); }

    const TextSource& source_;
    Cursor& at_;
};

/// Reads the records of an element one by one.
template <class Values>
class RecordReader {
  public:
    RecordReader(const PlyHeader& header, const PlyElement& element) : header_(header), element_(element) {}

    void skip(Values& values, std::size_t index) const {
        for (const PlyProperty& property : element_.properties) skip(values, property, index);
        values.endRecord();
    }

    /// @param axes  the properties that are coordinates
    glm::dvec3 readVertex(Values& values, const std::array<std::size_t, 3>& axes, std::size_t index) const {
        glm::dvec3 point(0);
        for (std::size_t i = 0; i < element_.properties.size(); ++i) {
            const auto axis = std::find(axes.begin(), axes.end(), i);
            if (axis == axes.end())
                skip(values, element_.properties[i], index);
            else
                point[int(axis - axes.begin())] = readCoordinate(values, element_.properties[i], index);
        }
        values.endRecord();
        return point;
    }

    /// @param list  the property that contains the corners
    void readFace(Values& values, std::size_t list, std::size_t index, Faces& faces) const {
        const std::size_t first = faces.corners.size();
        for (std::size_t i = 0; i < element_.properties.size(); ++i) {
            const PlyProperty& property = element_.properties[i];
            if (i != list) {
                skip(values, property, index);
                continue;
            }
            const std::uint64_t count = readCount(values, property, index);
            for (std::uint64_t k = 0; k < count; ++k)
                faces.corners.push_back(requireVertex(values, values.integer(property.type), index));
        }
        faces.close(first);
        values.endRecord();
    }

    /// Reads triangle strips: each triangle shares an edge with the previous one and alternates in orientation; -1
    /// restarts.
    void readStrips(Values& values, std::size_t list, std::size_t index, Faces& faces) const {
        for (std::size_t i = 0; i < element_.properties.size(); ++i) {
            const PlyProperty& property = element_.properties[i];
            if (i != list) {
                skip(values, property, index);
                continue;
            }
            const std::uint64_t count = readCount(values, property, index);
            unsigned strip[3];
            std::size_t length = 0;
            for (std::uint64_t k = 0; k < count; ++k) {
                const long long corner = values.integer(property.type);
                if (corner == -1) {
                    length = 0;
                    continue;
                }
                strip[length % 3] = requireVertex(values, corner, index);
                if (++length < 3) continue;
                const unsigned a = strip[length % 3], b = strip[(length + 1) % 3], c = strip[(length + 2) % 3];
                const bool isFlipped = length % 2 == 0;
                faces.corners.insert(faces.corners.end(), {a, isFlipped ? c : b, isFlipped ? b : c});
                faces.sizes.push_back(3);
            }
        }
        values.endRecord();
    }

  private:
    std::string name(std::size_t index) const { return fmt::format("{} {}", element_.name, index); }

    void skip(Values& values, const PlyProperty& property, std::size_t index) const {
        values.skip(property.type, property.countType ? readCount(values, property, index) : 1);
    }

    std::uint64_t readCount(Values& values, const PlyProperty& list, std::size_t index) const {
        const long long count = values.integer(*list.countType);
        if (count < 0)
            values.fail(fmt::format("{}: its list {} has {} items", name(index), quotedWord(list.name), count));
        return std::uint64_t(count);
    }

    double readCoordinate(Values& values, const PlyProperty& property, std::size_t index) const {
        const double value = values.real(property.type);
        if (!std::isfinite(float(value)))
            values.fail(fmt::format("{}: its {} is {}, which is no finite float", name(index), property.name, value));
        return value;
    }

    unsigned requireVertex(Values& values, long long corner, std::size_t index) const {
        if (corner < 0 || std::uint64_t(corner) >= header_.vertices)
            values.fail(fmt::format("{} refers to vertex {}, but there are {}, counted from 0", name(index), corner,
                                    header_.vertices));
        return unsigned(corner);
    }

    const PlyHeader& header_;
    const PlyElement& element_;
};

std::size_t requireAxis(const PlyHeader& header, const PlyElement& element, const char* name) {
    const auto found = element.find({name});
    if (!found || element.properties[*found].countType)
        header.fail(fmt::format("its vertices have no property '{}'", name));
    return *found;
}

std::size_t requireCorners(const PlyHeader& header, const PlyElement& element) {
    const auto found = element.findCorners();
    if (!found || !element.properties[*found].countType || !isInteger(element.properties[*found].type))
        header.fail(fmt::format("its element {} has no list 'vertex_indices' of integers", quotedWord(element.name)));
    return *found;
}

/// Reads `count` records from number `first` on.
template <class Values, class Point>
Faces readPart(const PlyHeader& header, const PlyElement& element, Values values, std::size_t first, std::size_t count,
               std::span<Point> points) {
    const RecordReader<Values> reader(header, element);
    Faces faces;
    switch (element.kind()) {
        case PlyElementKind::vertex: {
            const std::array<std::size_t, 3> axes{requireAxis(header, element, "x"), requireAxis(header, element, "y"),
                                                  requireAxis(header, element, "z")};
            for (std::size_t i = first; i < first + count; ++i) points[i] = reader.readVertex(values, axes, i);
            break;
        }
        case PlyElementKind::face: {
            const std::size_t list = requireCorners(header, element);
            faces.corners.reserve(3 * count);
            faces.sizes.reserve(count);
            for (std::size_t i = first; i < first + count; ++i) reader.readFace(values, list, i, faces);
            break;
        }
        case PlyElementKind::strips: {
            const std::size_t list = requireCorners(header, element);
            for (std::size_t i = first; i < first + count; ++i) reader.readStrips(values, list, i, faces);
            break;
        }
        case PlyElementKind::other:
            for (std::size_t i = first; i < first + count; ++i) reader.skip(values, i);
    }
    return faces;
}

/// Returns the start of each task's data, and advances past all of them.
std::vector<const char*> splitElement(const PlyHeader& header, const PlyElement& element, PlyData& data) {
    const RecordReader<BinaryValues> reader(header, element);
    BinaryValues values(header, data);
    std::size_t size = 0;
    for (const PlyProperty& property : element.properties) size += sizeOf(property.type);
    std::vector<const char*> begins;
    for (std::size_t first = 0; first < element.count; first += plyTaskElements) {
        const std::size_t end = std::min<std::size_t>(first + plyTaskElements, element.count);
        begins.push_back(values.data().at);
        if (!element.hasLists())
            values.skip(PlyType::uint8, (end - first) * size);
        else
            for (std::size_t i = first; i < end; ++i) reader.skip(values, i);
    }
    data = values.data();
    return begins;
}

}  // namespace

std::vector<Faces> readPlyElements(const PlyHeader& header, const PlyElement& element, const TextSource& source,
                                   Cursor& text, std::span<glm::dvec3> points) {
    return readRecords(text, element.count, [&](Cursor& at, std::size_t first, std::size_t count) {
        return readPart(header, element, TextValues(source, at), first, count, points);
    });
}

template <class Scalar>
std::vector<Faces> readPlyElements(const PlyHeader& header, const PlyElement& element, PlyData& data,
                                   std::span<glm::vec<3, Scalar>> points) {
    const std::vector<const char*> begins = splitElement(header, element, data);
    std::vector<Faces> parts(begins.size());
    inOrder(begins.size(), [&](std::size_t i) {
        const BinaryValues part(header, {begins[i], data.end, data.swapped});
        const std::size_t first = i * plyTaskElements;
        const std::size_t count = std::min(plyTaskElements, std::size_t(element.count) - first);
        parts[i] = readPart(header, element, part, first, count, points);
    });
    return parts;
}

template std::vector<Faces> readPlyElements(const PlyHeader&, const PlyElement&, PlyData&,
                                            std::span<glm::vec<3, float>>);
template std::vector<Faces> readPlyElements(const PlyHeader&, const PlyElement&, PlyData&,
                                            std::span<glm::vec<3, double>>);

}  // namespace bilayer::detail
