#include "sdf/mesh_guard.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace bilayer {
namespace {

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& why) {
    throw std::runtime_error(fmt::format("{}: {}", path.string(), why));
}

struct Property {
    bool list = false;
    std::string countType, type;
};

struct Element {
    std::string name;
    std::uint64_t count = 0;
    std::vector<Property> properties;

    bool hasLists() const {
        return std::any_of(properties.begin(), properties.end(), [](const Property& p) { return p.list; });
    }
};

struct PlyHeader {
    std::string format;
    std::vector<Element> elements;
};

PlyHeader readHeader(std::istream& file, const std::filesystem::path& path) {
    PlyHeader header;
    std::string line, word;
    while (std::getline(file, line)) {
        std::istringstream words(line);
        if (!(words >> word)) continue;
        if (word == "end_header") return header;
        if (word == "format") words >> header.format;
        if (word == "element") {
            Element element;
            if (!(words >> element.name >> element.count)) refuse(path, "its header has an element without a count");
            header.elements.push_back(element);
        }
        if (word == "property" && !header.elements.empty()) {
            Property property;
            words >> property.type;
            property.list = property.type == "list";
            if (property.list) words >> property.countType >> property.type;
            header.elements.back().properties.push_back(property);
        }
    }
    refuse(path, "its header has no end");
}

std::size_t sizeOf(const std::string& type) {
    for (const auto& [size, names] :
         {std::pair(1, "char uchar int8 uint8"), std::pair(2, "short ushort int16 uint16"),
          std::pair(4, "int uint float int32 uint32 float32"), std::pair(8, "double float64")})
        if (fmt::format(" {} ", names).find(fmt::format(" {} ", type)) != std::string::npos) return std::size_t(size);
    return 0;
}

// Walks over the binary part of a .ply file.
class Walker {
  public:
    Walker(std::vector<char> bytes, bool bigEndian, const std::filesystem::path& path)
        : bytes_(std::move(bytes)), bigEndian_(bigEndian), path_(path) {}

    void skip(std::uint64_t size) {
        if (size > bytes_.size() - at_) refuse(path_, "ends before all that its header announces");
        at_ += size;
    }

    std::uint64_t integer(std::size_t size) {
        const std::size_t begin = at_;
        skip(size);
        std::uint64_t value = 0;
        for (std::size_t i = 0; i < size; ++i) {
            const std::size_t from = bigEndian_ ? begin + i : begin + size - 1 - i;
            value = value << 8 | std::uint8_t(bytes_[from]);
        }
        return value;
    }

  private:
    std::vector<char> bytes_;
    bool bigEndian_;
    const std::filesystem::path& path_;
    std::size_t at_ = 0;
};

void walk(Walker& walker, const Element& element, std::uint64_t vertices, const std::filesystem::path& path) {
    std::size_t fixed = 0;
    for (const Property& property : element.properties) {
        if (sizeOf(property.type) == 0 || (property.list && sizeOf(property.countType) == 0))
            refuse(path, fmt::format("its header has a property of unknown type '{}'", property.type));
        if (!property.list) fixed += sizeOf(property.type);
    }
    if (!element.hasLists()) {
        if (fixed > 0 && element.count > UINT64_MAX / fixed) refuse(path, "its header announces too much");
        return walker.skip(element.count * fixed);
    }
    for (std::uint64_t i = 0; i < element.count; ++i)
        for (const Property& property : element.properties) {
            const std::size_t size = sizeOf(property.type);
            const std::uint64_t length = property.list ? walker.integer(sizeOf(property.countType)) : 1;
            const bool indices = property.list && element.name == "face" &&
                                 property.type.find("float") == std::string::npos && property.type != "double" &&
                                 size == 4;
            for (std::uint64_t k = 0; k < length; ++k) {
                const std::uint64_t value = walker.integer(size);
                if (indices && value >= vertices)
                    refuse(path, fmt::format("face {} uses vertex {}, but there are only {}", i, value, vertices));
            }
        }
}

void checkText(std::istream& file, const PlyHeader& header, const std::filesystem::path& path) {
    std::string line;
    for (const Element& element : header.elements)
        for (std::uint64_t i = 0; i < element.count;) {
            if (!std::getline(file, line)) refuse(path, "ends before all that its header announces");
            std::istringstream words(line);
            std::size_t expected = 0;
            std::vector<std::string> values{std::istream_iterator<std::string>(words), {}};
            if (values.empty()) continue;
            for (const Property& property : element.properties) {
                if (!property.list) {
                    ++expected;
                    continue;
                }
                if (expected >= values.size()) refuse(path, fmt::format("{} {} ends early", element.name, i));
                expected += 1 + std::size_t(std::strtoul(values[expected].c_str(), nullptr, 10));
            }
            if (values.size() < expected) refuse(path, fmt::format("{} {} ends early", element.name, i));
            ++i;
        }
}

bool isBinaryStl(std::istream& file, std::uint64_t size) {
    char head[84] = {};
    file.read(head, sizeof head);
    std::uint32_t count = 0;
    std::memcpy(&count, head + 80, sizeof count);
    file.clear();
    file.seekg(0);
    return size == 84 + 50ull * count || std::strncmp(head, "solid", 5) != 0;
}

}  // namespace

void guardPly(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    const PlyHeader header = readHeader(file, path);
    std::uint64_t vertices = 0;
    for (const Element& element : header.elements) {
        if (element.name == "tristrips")
            refuse(path, "stores triangle strips, which are not read; convert it to plain faces");
        if (element.name == "vertex") vertices = element.count;
    }
    if (header.format == "ascii") return checkText(file, header, path);
    Walker walker({std::istreambuf_iterator<char>(file), {}}, header.format == "binary_big_endian", path);
    for (const Element& element : header.elements) walk(walker, element, vertices, path);
}

void guardStl(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    const auto size = std::filesystem::file_size(path);
    if (isBinaryStl(file, size)) return;
    constexpr std::streamoff tail = 512;  // a name may follow `endsolid`, and empty lines
    file.seekg(-std::min<std::streamoff>(tail, std::streamoff(size)), std::ios::end);
    const std::string end{std::istreambuf_iterator<char>(file), {}};
    if (end.find("endsolid") == std::string::npos && end.find("ENDSOLID") == std::string::npos)
        refuse(path, "ends before its endsolid");
}

std::string guardedOff(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::string text, line;
    std::uint64_t lines = 0, vertices = 0, faces = 0;
    while (std::getline(file, line)) {
        line.erase(std::min(line.find('#'), line.size()));
        if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
        if (lines == 0) {
            const std::size_t keyword = line.find("OFF");
            if (keyword == std::string::npos) refuse(path, "does not begin with OFF");
            text = line.substr(0, keyword + 3) + '\n';
            line.erase(0, keyword + 3);
            ++lines;
            if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
        }
        std::istringstream words(line);
        if (lines == 1 && !(words >> vertices >> faces)) refuse(path, "has no counts of vertices and faces");
        if (lines > 1 + vertices && lines <= 1 + vertices + faces) {
            std::uint64_t corners = 0, corner = 0;
            words >> corners;
            for (std::uint64_t i = 0; i < corners; ++i)
                if (!(words >> corner) || corner >= vertices)
                    refuse(path,
                           fmt::format("face {} is cut off, or uses a vertex that is not there", lines - 2 - vertices));
        }
        text += line + '\n';
        ++lines;
    }
    if (lines < 2 || lines < 2 + vertices + faces) refuse(path, "ends before all that it announces");
    return text;
}

}  // namespace bilayer
