// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/png.h"

#include <zlib.h>

#include <new>
#include <string_view>

namespace bilayer::tools {
namespace {

constexpr char bitDepth = 8, greyscale = 0;

void addNumber(std::string& bytes, std::uint32_t number) {
    for (int shift = 24; shift >= 0; shift -= 8) bytes += char(number >> shift & 255);
}

void addChunk(std::string& file, std::string_view type, std::string_view data) {
    addNumber(file, std::uint32_t(data.size()));
    const std::string body = std::string(type) + std::string(data);
    file += body;
    addNumber(file, std::uint32_t(crc32_z(0, reinterpret_cast<const Bytef*>(body.data()), body.size())));
}

std::string compressed(std::string_view bytes) {
    uLongf size = compressBound(uLong(bytes.size()));
    std::string result(size, '\0');
    if (compress2(reinterpret_cast<Bytef*>(result.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                  uLong(bytes.size()), Z_DEFAULT_COMPRESSION) != Z_OK)
        throw std::bad_alloc();  // there is room for the result
    result.resize(size);
    return result;
}

}  // namespace

std::string pngOf(const GreyImage& image) {
    std::string header;
    addNumber(header, std::uint32_t(image.width));
    addNumber(header, std::uint32_t(image.height));
    header += {bitDepth, greyscale, 0, 0, 0};
    std::string rows;
    for (int y = 0; y < image.height; ++y) {
        rows += '\0';  // no filter
        rows.append(reinterpret_cast<const char*>(image.pixels.data()) + std::size_t(y) * std::size_t(image.width),
                    std::size_t(image.width));
    }
    std::string file("\x89PNG\r\n\x1a\n");
    addChunk(file, "IHDR", header);
    addChunk(file, "IDAT", compressed(rows));
    addChunk(file, "IEND", {});
    return file;
}

}  // namespace bilayer::tools
