#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include "sdf/base/large_array.h"
#include "sdf/base/parallel_parts.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/mesh_readers.h"
#include "sdf/io/polygons.h"
#include "sdf/io/text_records.h"
#include "sdf/io/text_source.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t partElements = 1 << 14;  // elements per task

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& why) {
    throw std::runtime_error(fmt::format("{}: {}", path.string(), why));
}

enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

struct TypeName {
    std::string_view name;
    Type type;
};
constexpr TypeName typeNames[] = {
    {"char", Type::int8},     {"int8", Type::int8},       {"uchar", Type::uint8},    {"uint8", Type::uint8},
    {"short", Type::int16},   {"int16", Type::int16},     {"ushort", Type::uint16},  {"uint16", Type::uint16},
    {"int", Type::int32},     {"int32", Type::int32},     {"uint", Type::uint32},    {"uint32", Type::uint32},
    {"float", Type::float32}, {"float32", Type::float32}, {"double", Type::float64}, {"float64", Type::float64}};

std::size_t sizeOf(Type type) {
    constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
    return sizes[int(type)];
}

bool isInteger(Type type) {
    return type < Type::float32;
}

struct Property {
    std::string name;
    Type type = Type::float32;
    std::optional<Type> countType;  // only for lists
};

struct Element {
    std::string name;
    std::uint64_t count = 0;
    std::vector<Property> properties;

    bool hasLists() const {
        return std::any_of(properties.begin(), properties.end(), [](const Property& p) { return bool(p.countType); });
    }
    std::optional<std::size_t> find(std::initializer_list<std::string_view> names) const {
        for (std::size_t i = 0; i < properties.size(); ++i)
            if (std::find(names.begin(), names.end(), properties[i].name) != names.end()) return i;
        return std::nullopt;
    }
};

enum class Format { text, binaryLittle, binaryBig };

struct Header {
    Format format = Format::text;
    std::vector<Element> elements;
    const char* end = nullptr;  // start of the data
};

/// Reads the lines of a header.
class HeaderReader {
  public:
    explicit HeaderReader(const TextSource& source) : source_(source), at_{source.begin(), source.end()} {}

    Header run() {
        if (at_.word() != "ply") source_.failExpected(source_.begin(), "'ply'");
        findLineEnd();
        bool hasFormat = false;
        for (nextLine();; nextLine()) {
            at_.skipBlanks();
            if (at_.atEnd()) source_.fail(at_.at, "the header has no end_header");
            const std::string_view word = at_.word();
            if (word == "end_header") break;
            if (word == "format") readFormat(), hasFormat = true;
            if (word == "element") readElement();
            if (word == "property") readProperty();
        }
        nextLine();
        if (!hasFormat) source_.fail(source_.begin(), "the header has no line 'format ascii 1.0' or the like");
        header_.end = at_.at;
        return header_;
    }

  private:
    // Data may begin with any byte: if lines end with CR alone, a byte LF after the header's last line is data.
    void findLineEnd() {
        at_.skipBlanks();
        endsWithCr_ = at_.end - at_.at >= 2 && at_.at[0] == '\r' && at_.at[1] != '\n';
    }

    void nextLine() {
        at_.skipLine();
        if (at_.atEnd()) return;
        const bool two = !endsWithCr_ && at_.end - at_.at >= 2 && at_.at[0] == '\r' && at_.at[1] == '\n';
        at_.at += two ? 2 : 1;
    }

    std::string_view next(const char* what) {
        at_.skipBlanks();
        const char* begin = at_.at;
        const std::string_view word = at_.word();
        if (word.empty()) source_.failExpected(begin, what);
        return word;
    }

    void readFormat() {
        const std::string_view word = next("a format");
        if (word == "ascii")
            header_.format = Format::text;
        else if (word == "binary_little_endian")
            header_.format = Format::binaryLittle;
        else if (word == "binary_big_endian")
            header_.format = Format::binaryBig;
        else
            source_.failExpected(word.data(), "ascii, binary_little_endian or binary_big_endian");
    }

    void readElement() {
        Element element;
        element.name = next("the name of an element");
        const std::string_view count = next("a count");
        const auto [end, error] = std::from_chars(count.data(), count.data() + count.size(), element.count);
        if (error != std::errc() || end != count.data() + count.size()) source_.failExpected(count.data(), "a count");
        header_.elements.push_back(element);
    }

    Type readType() {
        const std::string_view word = next("a type");
        for (const TypeName& known : typeNames)
            if (known.name == word) return known.type;
        source_.failExpected(word.data(), "a type (char, uchar, short, ushort, int, uint, float or double)");
    }

    void readProperty() {
        if (header_.elements.empty()) source_.fail(at_.at, "a property comes before the first element");
        Property property;
        at_.skipBlanks();
        const Cursor before = at_;
        if (at_.word() == "list")
            property.countType = readType();
        else
            at_ = before;
        if (property.countType && !isInteger(*property.countType))
            source_.fail(before.at, "the counts of a list are of no integer type");
        property.type = readType();
        property.name = next("the name of a property");
        header_.elements.back().properties.push_back(property);
    }

    const TextSource& source_;
    Cursor at_;
    bool endsWithCr_ = false;
    Header header_;
};

template <class Value>
Value load(const char* from, bool swapped) {
    std::array<char, sizeof(Value)> bytes;
    std::memcpy(bytes.data(), from, sizeof(Value));
    if (swapped) std::reverse(bytes.begin(), bytes.end());
    return std::bit_cast<Value>(bytes);
}

/// Calls visit(Value()) with a default value of a type.
template <class Visit>
auto withType(Type type, Visit visit) {
    switch (type) {
        case Type::int8:
            return visit(std::int8_t());
        case Type::uint8:
            return visit(std::uint8_t());
        case Type::int16:
            return visit(std::int16_t());
        case Type::uint16:
            return visit(std::uint16_t());
        case Type::int32:
            return visit(std::int32_t());
        case Type::uint32:
            return visit(std::uint32_t());
        case Type::float32:
            return visit(float());
        default:
            return visit(double());
    }
}

template <class Value>
Value loadAs(Type type, const char* from, bool swapped) {
    return withType(type, [&](auto kind) { return Value(load<decltype(kind)>(from, swapped)); });
}

/// Kinds of elements.
enum class Kind { vertex, face, strips, other };

Kind kindOf(const Element& element) {
    if (element.name == "vertex") return Kind::vertex;
    if (element.name == "face") return Kind::face;
    return element.name == "tristrips" ? Kind::strips : Kind::other;
}

/// Reads consecutive values from binary data.
class BinaryValues {
  public:
    BinaryValues(const std::filesystem::path& path, std::string_view bytes, bool swapped)
        : path_(path), at_(bytes.data()), end_(bytes.data() + bytes.size()), swapped_(swapped) {}

    double real(Type type) { return loadAs<double>(type, take(sizeOf(type)), swapped_); }
    long long integer(Type type) { return loadAs<long long>(type, take(sizeOf(type)), swapped_); }
    void skip(Type type, std::uint64_t count) {
        if (count > std::uint64_t(end_ - at_) / sizeOf(type)) endsEarly();
        at_ += count * sizeOf(type);
    }

    void endRecord() const {}

    [[noreturn]] void fail(const std::string& why) const { refuse(path_, why); }

    const char* at() const { return at_; }
    std::size_t size() const { return std::size_t(end_ - at_); }
    bool isSwapped() const { return swapped_; }
    BinaryValues from(const char* at) const { return {path_, {at, std::size_t(end_ - at)}, swapped_}; }

  private:
    const char* take(std::size_t size) {
        if (std::size_t(end_ - at_) < size) endsEarly();
        return std::exchange(at_, at_ + size);
    }
    [[noreturn]] void endsEarly() const { refuse(path_, "ends before all that its header announces"); }

    const std::filesystem::path& path_;
    const char *at_, *end_;
    bool swapped_;
};

/// Reads consecutive values from text, whose words are values.
class TextValues {
  public:
    TextValues(const TextSource& source, Cursor& at) : source_(source), at_(at) {}

    double real(Type) {
        double value = 0;
        const char* begin = next();
        if (!at_.number(value) || !isAtWordEnd()) source_.failExpected(begin, "a number");
        return value;
    }
    long long integer(Type) {
        long long value = 0;
        const char* begin = next();
        if (!at_.integer(value) || !isAtWordEnd()) source_.failExpected(begin, "an integer");
        return value;
    }
    void skip(Type, std::uint64_t count) {
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

/// Reads elements one by one.
template <class Values>
class ElementReader {
  public:
    ElementReader(const Element& element, std::uint64_t vertices) : element_(element), vertices_(vertices) {}

    std::uint64_t readCount(Values& values, const Property& list, std::size_t index) const {
        const long long count = values.integer(*list.countType);
        if (count < 0)
            values.fail(fmt::format("{}: its list {} has {} items", name(index), quotedWord(list.name), count));
        return std::uint64_t(count);
    }

    void skip(Values& values, const Property& property, std::size_t index) const {
        values.skip(property.type, property.countType ? readCount(values, property, index) : 1);
    }

    void skip(Values& values, std::size_t index) const {
        for (const Property& property : element_.properties) skip(values, property, index);
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
            const Property& property = element_.properties[i];
            if (i != list) {
                skip(values, property, index);
                continue;
            }
            const std::uint64_t count = readCount(values, property, index);
            for (std::uint64_t k = 0; k < count; ++k) readCorner(values, property.type, index, faces);
        }
        faces.close(first);
        values.endRecord();
    }

    /// Reads triangle strips: each triangle shares an edge with the previous one and alternates in orientation; -1
    /// restarts.
    void readStrips(Values& values, std::size_t list, std::size_t index, Faces& faces) const {
        for (std::size_t i = 0; i < element_.properties.size(); ++i) {
            const Property& property = element_.properties[i];
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
                strip[length % 3] = checked(values, corner, index);
                if (++length < 3) continue;
                const unsigned a = strip[length % 3], b = strip[(length + 1) % 3], c = strip[(length + 2) % 3];
                const bool isTurned = length % 2 == 0;
                faces.corners.insert(faces.corners.end(), {a, isTurned ? c : b, isTurned ? b : c});
                faces.sizes.push_back(3);
            }
        }
        values.endRecord();
    }

  private:
    std::string name(std::size_t index) const { return fmt::format("{} {}", element_.name, index); }

    double readCoordinate(Values& values, const Property& property, std::size_t index) const {
        const double value = values.real(property.type);
        if (!std::isfinite(float(value)))
            values.fail(fmt::format("{}: its {} is {}, which is no finite float", name(index), property.name, value));
        return value;
    }

    unsigned checked(Values& values, long long corner, std::size_t index) const {
        if (corner < 0 || std::uint64_t(corner) >= vertices_)
            values.fail(fmt::format("{} refers to vertex {}, but there are {}, counted from 0", name(index), corner,
                                    vertices_));
        return unsigned(corner);
    }

    void readCorner(Values& values, Type type, std::size_t index, Faces& faces) const {
        faces.corners.push_back(checked(values, values.integer(type), index));
    }

    const Element& element_;
    std::uint64_t vertices_;
};

/// Returns the byte offsets of each value or list in a record, and the size of the record.
/// @param listLength  items per list
std::vector<std::size_t> offsetsOf(const Element& element, std::size_t listLength) {
    std::vector<std::size_t> offsets{0};
    for (const Property& p : element.properties) {
        const std::size_t size = p.countType ? sizeOf(*p.countType) + listLength * sizeOf(p.type) : sizeOf(p.type);
        offsets.push_back(offsets.back() + size);
    }
    return offsets;
}

/// Vertices without lists whose coordinates all have the same type.
struct PointRecords {
    Type type;
    std::size_t size, offsets[3];  // size of a record, and offset of each coordinate [bytes]

    static std::optional<PointRecords> of(const Element& element, const std::array<std::size_t, 3>& axes) {
        const std::vector<Property>& properties = element.properties;
        const Type type = properties[axes[0]].type;
        if (element.hasLists() || properties[axes[1]].type != type || properties[axes[2]].type != type)
            return std::nullopt;
        const std::vector<std::size_t> offsets = offsetsOf(element, 0);
        return PointRecords{type, offsets.back(), {offsets[axes[0]], offsets[axes[1]], offsets[axes[2]]}};
    }

    /// Returns false if a coordinate is not a finite float.
    template <class Point>
    bool read(const char* at, bool swapped, std::span<Point> points) const {
        return withType(type, [&](auto kind) { return readAs<decltype(kind)>(at, swapped, points); });
    }

  private:
    template <class Stored, class Point>
    bool readAs(const char* at, bool swapped, std::span<Point> points) const {
        for (Point& point : points) {
            for (int axis = 0; axis < 3; ++axis)
                point[axis] = typename Point::value_type(load<Stored>(at + offsets[axis], swapped));
            if (!std::isfinite(float(point.x)) || !std::isfinite(float(point.y)) || !std::isfinite(float(point.z)))
                return false;
            at += size;
        }
        return true;
    }
};

/// Faces that are mostly triangles: one byte for the count of corners, four bytes per corner, and no other list.
struct TriangleRecords {
    std::size_t size, offset;  // size of a record, and offset of its list [bytes]

    static std::optional<TriangleRecords> of(const Element& element, std::size_t list) {
        const Property& corners = element.properties[list];
        const auto lists = std::count_if(element.properties.begin(), element.properties.end(),
                                         [](const Property& p) { return bool(p.countType); });
        const bool isUsual = corners.countType && sizeOf(*corners.countType) == 1 &&
                             (corners.type == Type::int32 || corners.type == Type::uint32);
        if (lists != 1 || !isUsual) return std::nullopt;
        const std::vector<std::size_t> offsets = offsetsOf(element, 3);
        return TriangleRecords{offsets.back(), offsets[list]};
    }

    bool isTriangle(const char* record) const { return record[offset] == 3; }

    /// Returns false if a face is not a triangle or a corner is not a vertex.
    bool read(const char* at, bool swapped, std::uint64_t vertices, std::span<glm::uvec3> triangles) const {
        for (glm::uvec3& t : triangles) {
            if (!isTriangle(at)) return false;
            for (int k = 0; k < 3; ++k)
                t[k] = load<std::uint32_t>(at + offset + 1 + std::size_t(k) * sizeof(std::uint32_t), swapped);
            if (t.x >= vertices || t.y >= vertices || t.z >= vertices) return false;
            at += size;
        }
        return true;
    }
};

/// Reads the elements of a file in their order.
template <class Scalar>
class PlyReader {
  public:
    PlyReader(const std::filesystem::path& path, const Header& header) : path_(path), header_(header) {
        for (const Element& element : header.elements) {
            if (kindOf(element) != Kind::vertex) continue;
            if (vertices_) refuse(path, "its header has two elements 'vertex'");
            vertices_ = &element;
        }
        if (!vertices_) refuse(path, "its header has no element 'vertex'");
    }

    PolygonsOf<Scalar> runText(const TextSource& source, Cursor text) {
        for (const Element& element : header_.elements) {
            if (element.properties.empty()) continue;
            makeRoom(element, std::size_t(text.end - text.at), 2);
            const ElementReader<TextValues> reader(element, vertices_->count);
            auto parts = readRecords(text, element.count, [&](Cursor& at, std::size_t first, std::size_t count) {
                TextValues values(source, at);
                return read(reader, element, values, first, count);
            });
            add(element, std::move(parts));
        }
        text.skipSpace();
        if (!text.atEnd())
            polygons_.notes.push_back(fmt::format(
                "left out: what follows all that the header announces, from line {} on", source.lineOf(text.at)));
        return finished();
    }

    PolygonsOf<Scalar> runBinary(BinaryValues values) {
        for (const Element& element : header_.elements) {
            if (element.properties.empty()) continue;
            makeRoom(element, values.size(), 1);
            if (readPoints(element, values) || readTriangles(element, values)) continue;
            const ElementReader<BinaryValues> reader(element, vertices_->count);
            const std::vector<const char*> begins = partsOf(element, values);
            std::vector<Faces> parts(begins.size());
            inOrder(begins.size(), [&](std::size_t i) {
                BinaryValues part = values.from(begins[i]);
                const std::size_t first = i * partElements;
                parts[i] =
                    read(reader, element, part, first, std::min(partElements, std::size_t(element.count) - first));
            });
            add(element, std::move(parts));
        }
        if (values.size() > 0)
            polygons_.notes.push_back(fmt::format("left out: {} after all that the header announces",
                                                  counted(values.size(), "byte", "bytes")));
        return finished();
    }

  private:
    /// Reads vertices with fixed-size records. Returns false if they are not, or on an error; nothing is read then.
    bool readPoints(const Element& element, BinaryValues& values) {
        if (kindOf(element) != Kind::vertex || element.count == 0) return false;
        const auto x = element.find({"x"}), y = element.find({"y"}), z = element.find({"z"});
        if (!x || !y || !z) return false;
        const auto records = PointRecords::of(element, {*x, *y, *z});
        return records && readAlike(*records, values, polygons_.points);
    }

    /// Does the same for faces, if these are all faces of the file and all are triangles.
    bool readTriangles(const Element& element, BinaryValues& values) {
        const auto list = element.find({"vertex_indices", "vertex_index"});
        // provided that negative corners look like vertices that do not exist
        const bool isCountSmall = vertices_->count <= std::uint64_t(std::numeric_limits<std::int32_t>::max());
        if (!list || !isCountSmall || !holdsAllFaces(element) || element.count == 0) return false;
        const auto records = TriangleRecords::of(element, *list);
        if (!records || values.size() < records->size || !records->isTriangle(values.at())) return false;
        resizeLarge(polygons_.triangles, element.count);
        if (readAlike(*records, values, polygons_.triangles)) return true;
        polygons_.triangles = {};
        return false;
    }

    template <class Records, class Item>
    bool readAlike(const Records& records, BinaryValues& values, std::vector<Item>& items) const {
        if (values.size() / records.size < items.size()) return false;
        const char* begin = values.at();
        std::atomic<bool> fits = true;
        inOrder((items.size() + partElements - 1) / partElements, [&](std::size_t i) {
            const std::size_t first = i * partElements, count = std::min(partElements, items.size() - first);
            const std::span part(items.data() + first, count);
            if (fits && !read(records, values, begin + first * records.size, part)) fits = false;
        });
        if (fits) values.skip(Type::uint8, items.size() * records.size);
        return fits;
    }

    template <class Point>
    bool read(const PointRecords& records, const BinaryValues& values, const char* at, std::span<Point> points) const {
        return records.read(at, values.isSwapped(), points);
    }
    bool read(const TriangleRecords& records, const BinaryValues& values, const char* at,
              std::span<glm::uvec3> triangles) const {
        return records.read(at, values.isSwapped(), vertices_->count, triangles);
    }

    bool holdsAllFaces(const Element& element) const {
        const auto holdsFaces = [](const Element& e) { return kindOf(e) == Kind::face || kindOf(e) == Kind::strips; };
        return kindOf(element) == Kind::face &&
               std::count_if(header_.elements.begin(), header_.elements.end(), holdsFaces) == 1;
    }

    /// Checks before allocation that the file is large enough: each property of an element takes some bytes.
    void makeRoom(const Element& element, std::size_t bytes, std::size_t bytesOfProperty) {
        const std::size_t size = element.properties.size() * bytesOfProperty;
        if (size > 0 && element.count > (bytes + 1) / size) refuse(path_, "ends before all that its header announces");
        if (kindOf(element) == Kind::vertex) resizeLarge(polygons_.points, element.count);
    }

    /// Returns the start of each part of an element's data. The values advance past all of them.
    std::vector<const char*> partsOf(const Element& element, BinaryValues& values) const {
        const ElementReader<BinaryValues> reader(element, vertices_->count);
        std::size_t size = 0;
        for (const Property& property : element.properties) size += sizeOf(property.type);
        std::vector<const char*> begins;
        for (std::size_t first = 0; first < element.count; first += partElements) {
            const std::size_t end = std::min<std::size_t>(first + partElements, element.count);
            begins.push_back(values.at());
            if (!element.hasLists())
                values.skip(Type::uint8, (end - first) * size);
            else
                for (std::size_t i = first; i < end; ++i) reader.skip(values, i);
        }
        return begins;
    }

    template <class Values>
    Faces read(const ElementReader<Values>& reader, const Element& element, Values& values, std::size_t first,
               std::size_t count) {
        Faces faces;
        switch (kindOf(element)) {
            case Kind::vertex: {
                const std::array<std::size_t, 3> axes{axis(element, "x"), axis(element, "y"), axis(element, "z")};
                for (std::size_t i = first; i < first + count; ++i)
                    polygons_.points[i] = reader.readVertex(values, axes, i);
                break;
            }
            case Kind::face: {
                const std::size_t list = corners(element);
                faces.corners.reserve(3 * count);
                faces.sizes.reserve(count);
                for (std::size_t i = first; i < first + count; ++i) reader.readFace(values, list, i, faces);
                break;
            }
            case Kind::strips: {
                const std::size_t list = corners(element);
                for (std::size_t i = first; i < first + count; ++i) reader.readStrips(values, list, i, faces);
                break;
            }
            case Kind::other:
                for (std::size_t i = first; i < first + count; ++i) reader.skip(values, i);
        }
        return faces;
    }

    std::size_t axis(const Element& element, const char* name) const {
        const auto found = element.find({name});
        if (!found || element.properties[*found].countType)
            refuse(path_, fmt::format("its vertices have no property '{}'", name));
        return *found;
    }

    std::size_t corners(const Element& element) const {
        const auto found = element.find({"vertex_indices", "vertex_index"});
        if (!found || !element.properties[*found].countType || !isInteger(element.properties[*found].type))
            refuse(path_,
                   fmt::format("its element {} has no list 'vertex_indices' of integers", quotedWord(element.name)));
        return *found;
    }

    void add(const Element& element, std::vector<Faces> parts) {
        if (kindOf(element) == Kind::other && element.count > 0)
            polygons_.notes.push_back(fmt::format("left out: {} {}", counted(element.count, "element", "elements"),
                                                  quotedWord(element.name)));
        std::move(parts.begin(), parts.end(), std::back_inserter(faces_));
    }

    PolygonsOf<Scalar> finished() {
        if (polygons_.triangles.empty()) setFaces(polygons_, faces_);
        return std::move(polygons_);
    }

    const std::filesystem::path& path_;
    const Header& header_;
    const Element* vertices_ = nullptr;
    PolygonsOf<Scalar> polygons_;
    std::vector<Faces> faces_;
};

/// Returns whether floats can represent all coordinates.
bool storesFloats(const Header& header) {
    for (const Element& element : header.elements)
        for (const char* axis : {"x", "y", "z"})
            if (const auto i = element.find({axis}); i && kindOf(element) == Kind::vertex) {
                const Type type = element.properties[*i].type;
                if (type != Type::float32 && sizeOf(type) > sizeof(std::int16_t)) return false;
            }
    return header.format != Format::text;
}

}  // namespace

Mesh readPly(const std::filesystem::path& path, ReadReport& report) {
    const MappedFile file(path);
    const TextSource source(path, file.bytes());
    const Header header = HeaderReader(source).run();
    if (header.format == Format::text)
        return assembled(PlyReader<double>(path, header).runText(source, {header.end, source.end()}), path, report);
    const bool isBig = std::endian::native == std::endian::big;
    const BinaryValues values(path, {header.end, std::size_t(source.end() - header.end)},
                              (header.format == Format::binaryBig) != isBig);
    if (storesFloats(header)) return assembled(PlyReader<float>(path, header).runBinary(values), path, report);
    return assembled(PlyReader<double>(path, header).runBinary(values), path, report);
}

}  // namespace bilayer::detail
