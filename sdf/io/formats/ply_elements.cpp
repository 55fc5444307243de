// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/formats/ply_elements.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "sdf/base/parallel_parts.h"
#include "sdf/io/formats/text_records.h"

namespace bilayer::detail {
namespace {

constexpr double maxWhole = 0x1p53;  // of a count or an index that is stored as a real: greater doubles skip numbers

/// Reads consecutive values from binary data.
class BinaryValues {
  public:
    /// @param record  the number of the first record
    BinaryValues(const PlyHeader& header, const PlyElement& element, const PlyData& data, std::size_t record)
        : header_(header), element_(element), data_(data), record_(record) {}

    double real(PlyType type) { return loadAs<double>(type); }
    long long integer(PlyType type) { return loadAs<long long>(type); }
    void skip(PlyType type, std::uint64_t count) {
        if (count > std::uint64_t(data_.size()) / sizeOf(type)) failTooShort();
        data_.at += count * sizeOf(type);
    }
    /// Advances past records that have the same size [bytes].
    void skipRecords(std::size_t count, std::size_t size) {
        const std::size_t found = size > 0 ? std::min(count, data_.size() / size) : count;
        data_.at += found * size;
        record_ += found;
        if (found < count) failTooShort();
    }

    void endRecord() { ++record_; }

    /// Names the byte at which the last value begins.
    [[noreturn]] void fail(const std::string& why) const { failAt(last_, why); }

    /// What is left to read.
    const PlyData& data() const { return data_; }

  private:
    template <class Value>
    Value loadAs(PlyType type) {
        last_ = take(sizeOf(type));
        return withPlyType(type, [&](auto stored) { return Value(loadPly<decltype(stored)>(last_, data_.swapped)); });
    }

    const char* take(std::size_t size) {
        if (data_.size() < size) failTooShort();
        return std::exchange(data_.at, data_.at + size);
    }

    [[noreturn]] void failTooShort() const { failAt(data_.end, header_.endsAfter(record_, element_)); }
    [[noreturn]] void failAt(const char* at, const std::string& why) const {
        header_.fail(fmt::format("byte {}: {}", at - header_.begin, why));
    }

    const PlyHeader& header_;
    const PlyElement& element_;
    PlyData data_;
    std::size_t record_;
    const char* last_ = nullptr;
};

/// A text of values, and how its records are separated.
struct PlyText {
    const TextSource& source;
    PlyTextLayout layout;
};

/// Reads consecutive values from text, whose words are values.
class TextValues {
  public:
    /// @param record  the number of the first record
    TextValues(const PlyHeader& header, const PlyElement& element, const PlyText& text, Cursor& at, std::size_t record)
        : header_(header), element_(element), text_(text), at_(at), record_(record) {}

    double real(PlyType) {
        double value = 0;
        const char* begin = next();
        if (!at_.number(value) || !isAtWordEnd()) text_.source.failExpected(begin, "a number");
        return value;
    }
    long long integer(PlyType) {
        long long value = 0;
        const char* begin = next();
        if (!at_.integer(value) || !isAtWordEnd()) text_.source.failExpected(begin, "an integer");
        return value;
    }
    void skip(PlyType, std::uint64_t count) {
        for (; count > 0; --count) {
            next();
            at_.word();
        }
    }

    void endRecord() {
        ++record_;
        if (text_.layout == PlyTextLayout::words) return;
        at_.skipBlanks();
        if (!at_.atEnd() && !isLineEnd(*at_.at)) text_.source.failExpected(at_.at, "the end of the line");
    }

    [[noreturn]] void fail(const std::string& why) const { text_.source.fail(at_.at, why); }

  private:
    const char* next() {
        at_.skipSpace();
        if (at_.atEnd()) fail(header_.endsAfter(record_, element_));
        return at_.at;
    }
    bool isAtWordEnd() const { return at_.atEnd() || isSpace(*at_.at); }

    const PlyHeader& header_;
    const PlyElement& element_;
    const PlyText& text_;
    Cursor& at_;
    std::size_t record_;
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
        visitList(values, list, index,
                  [&](long long corner) { faces.corners.push_back(requireVertex(values, corner, index)); });
        faces.close(first);
    }

    /// Reads triangle strips: each triangle shares an edge with the previous one and alternates in orientation; -1
    /// restarts.
    void readStrips(Values& values, std::size_t list, std::size_t index, Faces& faces) const {
        unsigned strip[3];
        std::size_t length = 0;
        visitList(values, list, index, [&](long long corner) {
            if (corner == -1) {
                length = 0;
                return;
            }
            strip[length % 3] = requireVertex(values, corner, index);
            if (++length < 3) return;
            const unsigned a = strip[length % 3], b = strip[(length + 1) % 3], c = strip[(length + 2) % 3];
            const bool isFlipped = length % 2 == 0;
            faces.corners.insert(faces.corners.end(), {a, isFlipped ? c : b, isFlipped ? b : c});
            faces.sizes.push_back(3);
        });
    }

  private:
    std::string name(std::size_t index) const {
        const bool isUsual = element_.name == "vertex" || element_.name == "face";
        return fmt::format("{} {}", isUsual ? element_.name : quotedWord(element_.name), index);
    }

    void skip(Values& values, const PlyProperty& property, std::size_t index) const {
        values.skip(property.type, property.countType ? readCount(values, property, index) : 1);
    }

    /// Reads a record, and calls visit(item) for the items of one of its lists.
    template <class Visit>
    void visitList(Values& values, std::size_t list, std::size_t index, const Visit& visit) const {
        for (std::size_t i = 0; i < element_.properties.size(); ++i) {
            const PlyProperty& property = element_.properties[i];
            if (i != list) {
                skip(values, property, index);
                continue;
            }
            const std::uint64_t count = readCount(values, property, index);
            for (std::uint64_t k = 0; k < count; ++k) visit(readWhole(values, property.type, property, index));
        }
        values.endRecord();
    }

    /// Reads the count or an item of a list. Some programs write them as reals.
    long long readWhole(Values& values, PlyType type, const PlyProperty& list, std::size_t index) const {
        if (isInteger(type)) return values.integer(type);
        const double value = values.real(type);
        if (!(std::abs(value) <= maxWhole) || value != std::trunc(value))
            values.fail(fmt::format("{}: its list {} has {} where a whole number should stand", name(index),
                                    quotedWord(list.name), value));
        return static_cast<long long>(value);
    }

    std::uint64_t readCount(Values& values, const PlyProperty& list, std::size_t index) const {
        const long long count = readWhole(values, *list.countType, list, index);
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
    if (!found || !element.properties[*found].countType)
        header.fail(fmt::format("its element {} has no list 'vertex_indices'", quotedWord(element.name)));
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
    BinaryValues values(header, element, data, 0);
    std::size_t size = 0;
    for (const PlyProperty& property : element.properties) size += sizeOf(property.type);
    std::vector<const char*> begins;
    for (std::size_t first = 0; first < element.count; first += plyTaskElements) {
        const std::size_t end = std::min<std::size_t>(first + plyTaskElements, element.count);
        begins.push_back(values.data().at);
        if (!element.hasLists())
            values.skipRecords(end - first, size);
        else
            for (std::size_t i = first; i < end; ++i) reader.skip(values, i);
    }
    data = values.data();
    return begins;
}

}  // namespace

void requirePlyElements(const PlyHeader& header, const PlyElement& element, const TextSource& source, Cursor text,
                        PlyTextLayout layout) {
    const PlyText of{source, layout};
    TextValues values(header, element, of, text, 0);
    for (std::size_t i = 0; i < element.count; ++i) RecordReader<TextValues>(header, element).skip(values, i);
}

void requirePlyElements(const PlyHeader& header, const PlyElement& element, PlyData data) {
    splitElement(header, element, data);
}

std::vector<Faces> readPlyElements(const PlyHeader& header, const PlyElement& element, const TextSource& source,
                                   Cursor& text, PlyTextLayout layout, std::span<glm::dvec3> points) {
    const PlyText of{source, layout};
    return readRecords(text, element.count, [&](Cursor& at, std::size_t first, std::size_t count) {
        return readPart(header, element, TextValues(header, element, of, at, first), first, count, points);
    });
}

template <class Scalar>
std::vector<Faces> readPlyElements(const PlyHeader& header, const PlyElement& element, PlyData& data,
                                   std::span<glm::vec<3, Scalar>> points) {
    const std::vector<const char*> begins = splitElement(header, element, data);
    std::vector<Faces> parts(begins.size());
    inParallel(begins.size(), [&](std::size_t i) {
        const std::size_t first = i * plyTaskElements;
        const BinaryValues part(header, element, {begins[i], data.end, data.swapped}, first);
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
