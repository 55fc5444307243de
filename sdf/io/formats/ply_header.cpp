// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/formats/ply_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <stdexcept>
#include <system_error>

namespace bilayer::detail {
namespace {

struct PlyTypeName {
    std::string_view name;
    PlyType type;
};
constexpr PlyTypeName typeNames[] = {
    {"char", PlyType::int8},      {"int8", PlyType::int8},       {"uchar", PlyType::uint8},
    {"uint8", PlyType::uint8},    {"short", PlyType::int16},     {"int16", PlyType::int16},
    {"ushort", PlyType::uint16},  {"uint16", PlyType::uint16},   {"int", PlyType::int32},
    {"int32", PlyType::int32},    {"uint", PlyType::uint32},     {"uint32", PlyType::uint32},
    {"float", PlyType::float32},  {"float32", PlyType::float32}, {"double", PlyType::float64},
    {"float64", PlyType::float64}};

/// Reads the lines of a header.
class PlyHeaderReader {
  public:
    PlyHeaderReader(const std::filesystem::path& path, const TextSource& source)
        : source_(source), at_{source.begin(), source.end()} {
        header_.path = path;
        header_.begin = source.begin();
    }

    PlyHeader run() {
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
        findVertices();
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
            header_.format = PlyFormat::text;
        else if (word == "binary_little_endian")
            header_.format = PlyFormat::binaryLittle;
        else if (word == "binary_big_endian")
            header_.format = PlyFormat::binaryBig;
        else
            source_.failExpected(word.data(), "ascii, binary_little_endian or binary_big_endian");
    }

    void readElement() {
        PlyElement element;
        element.name = next("the name of an element");
        const std::string_view count = next("a count");
        const auto [end, error] = std::from_chars(count.data(), count.data() + count.size(), element.count);
        if (error != std::errc() || end != count.data() + count.size()) source_.failExpected(count.data(), "a count");
        header_.elements.push_back(element);
    }

    PlyType readType() {
        const std::string_view word = next("a type");
        for (const PlyTypeName& known : typeNames)
            if (known.name == word) return known.type;
        source_.failExpected(word.data(), "a type (char, uchar, short, ushort, int, uint, float or double)");
    }

    void readProperty() {
        if (header_.elements.empty()) source_.fail(at_.at, "a property comes before the first element");
        PlyProperty property;
        at_.skipBlanks();
        const Cursor before = at_;
        if (at_.word() == "list")
            property.countType = readType();
        else
            at_ = before;
        property.type = readType();
        property.name = next("the name of a property");
        header_.elements.back().properties.push_back(property);
    }

    void findVertices() {
        bool found = false;
        for (const PlyElement& element : header_.elements) {
            if (element.kind() != PlyElementKind::vertex) continue;
            if (found) header_.fail("its header has two elements 'vertex'");
            found = true;
            header_.vertices = element.count;
        }
        if (!found) header_.fail("its header has no element 'vertex'");
    }

    const TextSource& source_;
    Cursor at_;
    bool endsWithCr_ = false;
    PlyHeader header_;
};

}  // namespace

PlyElementKind PlyElement::kind() const {
    if (name == "vertex") return PlyElementKind::vertex;
    if (name == "face") return PlyElementKind::face;
    return name == "tristrips" ? PlyElementKind::strips : PlyElementKind::other;
}

bool PlyElement::hasLists() const {
    return std::any_of(properties.begin(), properties.end(), [](const PlyProperty& p) { return bool(p.countType); });
}

std::optional<std::size_t> PlyElement::find(std::initializer_list<std::string_view> names) const {
    for (std::size_t i = 0; i < properties.size(); ++i)
        if (std::find(names.begin(), names.end(), properties[i].name) != names.end()) return i;
    return std::nullopt;
}

bool PlyHeader::storesFloats() const {
    for (const PlyElement& element : elements)
        for (const char* axis : {"x", "y", "z"})
            if (const auto i = element.find({axis}); i && element.kind() == PlyElementKind::vertex) {
                const PlyType type = element.properties[*i].type;
                if (type != PlyType::float32 && sizeOf(type) > sizeof(std::int16_t)) return false;
            }
    return format != PlyFormat::text;
}

void PlyHeader::fail(const std::string& why) const {
    throw std::runtime_error(fmt::format("{}: {}", path.string(), why));
}

std::string PlyHeader::endsAfter(std::uint64_t records, const PlyElement& element) const {
    return fmt::format("the file ends after {} of the {} elements {} that its header announces", records, element.count,
                       quotedWord(element.name));
}

PlyHeader readPlyHeader(const std::filesystem::path& path, const TextSource& source) {
    return PlyHeaderReader(path, source).run();
}

}  // namespace bilayer::detail
