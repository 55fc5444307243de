// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/scene_io.h"

#include <fmt/format.h>

#include <cctype>
#include <new>
#include <stdexcept>
#include <string>

#include "sdf/base/quoted_text.h"
#include "sdf/io/assimp_reader.h"
#include "sdf/io/input_file.h"
#include "sdf/io/polygon_record.h"
#include "sdf/io/read_gltf.h"

namespace bilayer::detail {
namespace {

constexpr std::chrono::seconds baseTime{60}, timePerMegabyte{10};
constexpr std::size_t baseMemory = std::size_t(2)
                                   << 30;  // [bytes]: compressed and text formats expand when they are read
constexpr std::size_t memoryPerByte = 100;

// "DAE" for a.dae
std::string formatOf(const std::filesystem::path& path) {
    std::string ending = path.extension().string();
    if (!ending.empty()) ending.erase(0, 1);
    for (char& c : ending) c = char(std::toupper(static_cast<unsigned char>(c)));
    return ending;
}

bool isGltf(const std::string& format) {
    return format == "GLTF" || format == "GLB";
}

void readInChild(const std::filesystem::path& path, std::size_t memory, const ChildProcess::Send& send) {
    const auto tooLarge = [&] {
        sendError(send,
                  fmt::format("reading it needs more than the {} MiB of memory that importers get; it may be damaged",
                              memory >> 20));
    };
    Polygons polygons;
    try {
        polygons = isGltf(formatOf(path)) ? readGltf(path) : readByAssimp(path);
    } catch (const std::bad_alloc&) {
        return tooLarge();
    } catch (const std::length_error&) {  // from a container larger than the address space
        return tooLarge();
    } catch (const std::runtime_error& error) {
        const std::string why = oneLine(error.what());
        return sendError(send, why.empty() ? "cannot be read" : why);
    } catch (const std::exception&) {  // a failed check within a library, whose text is not about the file
        return sendError(send, "the importer cannot make sense of it; it may be damaged");
    }
    sendPolygons(send, polygons);
}

}  // namespace

ChildLimits sceneLimits(std::size_t fileSize) {
    return {baseTime + timePerMegabyte * (fileSize >> 20), baseMemory + memoryPerByte * fileSize};
}

Polygons readScene(const std::filesystem::path& path, const ChildLimits& limits) {
    requireInputFile(path);
    const std::string format = formatOf(path);
    try {
        ChildProcess child(limits, [&](const ChildProcess::Send& send) { readInChild(path, limits.memory, send); });
        return receivePolygons(child, limits.memory);
    } catch (const ChildFailure& failure) {
        throw std::runtime_error(fmt::format("{}: the importer for {} files {}; convert it to {}", path.string(),
                                             format, failure.what(),
                                             isGltf(format) ? "OBJ, PLY or STL" : "OBJ, PLY, STL or glTF"));
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& error) {
        throw std::runtime_error(fmt::format("{}: {}", path.string(), error.what()));
    }
}

Polygons readScene(const std::filesystem::path& path) {
    requireInputFile(path);
    return readScene(path, sceneLimits(std::filesystem::file_size(path)));
}

}  // namespace bilayer::detail
