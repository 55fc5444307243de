// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/scenes/gltf_buffers.h"

#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include "sdf/io/input_file.h"
#include "sdf/io/scenes/gltf_json.h"

namespace bilayer::detail {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view magic = "glTF";
constexpr std::uint32_t jsonType = 0x4E4F534A, binType = 0x004E4942;  // chunk types
constexpr std::size_t fileHeader = 12, chunkHeader = 8;               // [bytes]

Bytes readBytes(const fs::path& path) {
    requireInputFile(path);
    std::ifstream stream(path, std::ios::binary);
    Bytes bytes(fs::file_size(path));
    stream.read(reinterpret_cast<char*>(bytes.data()), std::streamsize(bytes.size()));
    if (!stream) throw std::runtime_error(fmt::format("{}: cannot be read to its end", path.string()));
    return bytes;
}

std::uint32_t numberAt(std::string_view bytes, std::size_t at) {
    std::uint32_t number = 0;
    std::memcpy(&number, bytes.data() + at, sizeof number);
    return number;
}

std::string_view view(const Bytes& bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

int hexDigit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    const int letter = (c | 0x20) - 'a';
    return letter >= 0 && letter < 6 ? letter + 10 : -1;
}

std::string percentDecoded(const std::string& uri) {
    std::string text;
    for (std::size_t i = 0; i < uri.size(); ++i) {
        const bool isCode =
            uri[i] == '%' && i + 2 < uri.size() && hexDigit(uri[i + 1]) >= 0 && hexDigit(uri[i + 2]) >= 0;
        text += isCode ? char(16 * hexDigit(uri[i + 1]) + hexDigit(uri[i + 2])) : uri[i];
        if (isCode) i += 2;
    }
    return text;
}

// Returns the file that a URI names in a folder. File names with percent signs are often written unescaped.
fs::path fileOf(const fs::path& folder, const std::string& uri) {
    std::error_code absent;
    const fs::path literal = folder / uri;
    return fs::exists(literal, absent) ? literal : folder / percentDecoded(uri);
}

int base64Digit(char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
}

Bytes base64Decoded(std::string_view text) {
    text = text.substr(0, text.find_last_not_of('=') + 1);
    Bytes bytes;
    bytes.reserve(text.size() / 4 * 3 + 3);
    unsigned bits = 0, count = 0;  // of the digits that do not form a whole byte yet
    for (const char c : text) {
        const int digit = base64Digit(c);
        if (digit < 0) throw std::runtime_error(fmt::format("its data URI holds '{}', which is no base64 digit", c));
        bits = bits << 6 | unsigned(digit);
        count += 6;
        if (count < 8) continue;
        count -= 8;
        bytes.push_back(static_cast<unsigned char>(bits >> count));
    }
    return bytes;
}

Bytes dataOf(const std::string& uri) {
    const std::size_t comma = uri.find(',');
    const std::string marker = ";base64";
    if (comma == std::string::npos || comma < marker.size() ||
        uri.compare(comma - marker.size(), marker.size(), marker) != 0)
        throw std::runtime_error(
            fmt::format("its uri is {}; it must be data:application/octet-stream;base64,...", excerpt(uri)));
    return base64Decoded(std::string_view(uri).substr(comma + 1));
}

// Reads a data URI, or a file in a folder.
Bytes bytesOf(const fs::path& folder, const std::string& uri) {
    if (uri.rfind("data:", 0) == 0) return dataOf(uri);
    const fs::path path = fileOf(folder, uri);
    try {
        return readBytes(path);
    } catch (const std::runtime_error& error) {
        const std::string reason = std::string(error.what()).substr(path.string().size());
        throw std::runtime_error(fmt::format("its uri is {}{}", excerpt(uri), reason));
    }
}

}  // namespace

GltfFile::GltfFile(const fs::path& path) : folder_(fs::absolute(path).parent_path()), bytes_(readBytes(path)) {
    json_ = view(bytes_);
    isBinary_ = json_.substr(0, magic.size()) == magic;
    if (isBinary_) splitChunks();
}

// See section 4.4 of the glTF 2.0 specification.
void GltfFile::splitChunks() {
    const std::string_view all = view(bytes_);
    if (all.size() < fileHeader + chunkHeader)
        throw std::runtime_error(fmt::format("ends after {} bytes, within the header of binary glTF", all.size()));
    if (numberAt(all, 4) != 2)
        throw std::runtime_error(fmt::format("is binary glTF {}; only glTF 2 is read", numberAt(all, 4)));
    std::vector<std::string_view> chunks;
    for (std::size_t at = fileHeader; at + chunkHeader <= all.size() && chunks.size() < 2;) {
        const std::size_t length = numberAt(all, at);
        const std::uint32_t type = numberAt(all, at + 4);
        at += chunkHeader;
        if (length > all.size() - at)
            throw std::runtime_error(
                fmt::format("the chunk at byte {} has {} bytes, but only {} follow", at, length, all.size() - at));
        if (type != (chunks.empty() ? jsonType : binType)) break;
        chunks.push_back(all.substr(at, length));
        at += length;
    }
    if (chunks.empty()) throw std::runtime_error("its first chunk is not JSON, as binary glTF asks for");
    json_ = chunks[0];
    if (chunks.size() > 1) chunk_ = chunks[1];
}

Bytes GltfFile::buffer(const nlohmann::json& buffers, std::size_t index) const try {
    const nlohmann::json& buffer = buffers.at(index);
    const std::size_t length = buffer.at("byteLength");
    if (length == 0) throw std::runtime_error("its byteLength is 0; it must be at least 1");
    const auto uri = buffer.find("uri");
    Bytes bytes;
    if (uri != buffer.end())
        bytes = bytesOf(folder_, uri->get_ref<const std::string&>());
    else if (isBinary_ && index == 0)
        bytes.assign(chunk_.begin(), chunk_.end());
    else
        throw std::runtime_error("it has no uri");
    if (bytes.size() < length)
        throw std::runtime_error(fmt::format("its byteLength is {}, but it has {} bytes", length, bytes.size()));
    bytes.resize(length);
    return bytes;
} catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("buffer {}: {}", index, error.what()));
}

}  // namespace bilayer::detail
