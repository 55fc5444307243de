// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/scenes/scene_io.h"

#include <fmt/format.h>

#include <cctype>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>

#include "sdf/base/usable_memory.h"
#include "sdf/io/input_file.h"
#include "sdf/io/scenes/assimp_reader.h"
#include "sdf/io/scenes/polygon_record.h"
#include "sdf/io/scenes/read_gltf.h"

namespace bilayer::detail {
namespace {

constexpr std::chrono::seconds baseTime{60}, timePerMegabyte{10};
constexpr std::size_t baseMemory = std::size_t(2)
                                   << 30;  // [bytes]: compressed and text formats expand when they are read
constexpr std::size_t memoryPerByte = 100;

// "DAE" for a.dae
std::string formatOf(const std::filesystem::path& path) {
    std::string extension = path.extension().string();
    if (!extension.empty()) extension.erase(0, 1);
    for (char& c : extension) c = char(std::toupper(static_cast<unsigned char>(c)));
    return extension;
}

bool isGltf(const std::string& format) {
    return format == "GLTF" || format == "GLB";
}

// Reads and sends the scene.
// @param remaining  memory that this process may take, less than importers get; or nothing
void readInChild(const std::filesystem::path& path, std::size_t memory, std::optional<double> remaining,
                 const ChildProcess::Send& send) {
    const auto tooLarge = [&] {
        if (remaining) return sendOutOfMemory(send);
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
        return sendError(send, error.what());
    } catch (const std::exception&) {  // a failed check within a library, whose text is not about the file
        return sendError(send, "the importer cannot make sense of it; it may be damaged");
    }
    sendPolygons(send, polygons);
}

// Importers that get no memory may go on without it, and then find something else to complain about, or nothing.
std::string memoryNote(double remaining) {
    return fmt::format("its importer may need more than the {:.0f} MiB of memory that this process may still take",
                       remaining / (1 << 20));
}

}  // namespace

ChildLimits sceneLimits(std::size_t fileSize) {
    return {baseTime + timePerMegabyte * (fileSize >> 20), baseMemory + memoryPerByte * fileSize};
}

Polygons readScene(const std::filesystem::path& path, const ChildLimits& limits) {
    requireInputFile(path);
    const std::string format = formatOf(path);
    std::optional<double> remaining = remainingMemory();
    if (*remaining >= double(limits.memory)) remaining.reset();
    const std::string otherReason = remaining ? "; " + memoryNote(*remaining) : "";
    try {
        ChildProcess child(limits,
                           [&](const ChildProcess::Send& send) { readInChild(path, limits.memory, remaining, send); });
        Polygons polygons =
            receivePolygons([&](void* bytes, std::size_t count) { child.receive(bytes, count); }, limits.memory);
        if (remaining && polygons.corners.empty()) polygons.notes.push_back(memoryNote(*remaining));
        return polygons;
    } catch (const ChildFailure& failure) {
        throw std::runtime_error(
            fmt::format("{}: the importer for {} files {}; convert it to {}{}", path.string(), format, failure.what(),
                        isGltf(format) ? "OBJ, PLY or STL" : "OBJ, PLY, STL or glTF", otherReason));
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& error) {
        throw std::runtime_error(fmt::format("{}: {}{}", path.string(), error.what(), otherReason));
    }
}

Polygons readScene(const std::filesystem::path& path) {
    requireInputFile(path);
    return readScene(path, sceneLimits(std::filesystem::file_size(path)));
}

}  // namespace bilayer::detail
