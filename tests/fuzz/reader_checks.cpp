// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/mesh_io.h>
#include "sdf/io/formats/mesh_readers.h"
#include "sdf/io/polygon/polygons.h"
#include "sdf/io/scenes/read_gltf.h"
#include "sdf/io/scenes/scene_io.h"
#include "tests/fuzz/checks.h"
#include "tests/support/scene_files.h"
#include "tests/support/support.h"

namespace bilayer::test {
namespace {

constexpr std::size_t maxErrorBytes = 500;  // without the path: readers quote at most some words of a file
// words of libraries that say nothing about a file
constexpr const char* jargon[] = {"std::", "::_M_", "basic_string", "stoi", "stol", "exception", "damaged answer"};

using Reader = Mesh (*)(const std::filesystem::path&, ReadReport&);

std::filesystem::path fileOf(Bytes bytes, const char* name) {
    const std::filesystem::path path = scratch(name);
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    return path;
}

void requireMesh(const Mesh& mesh) {
    try {
        validate(mesh);
    } catch (const std::invalid_argument& error) {
        throw WrongAnswer(std::string("a reader returned an invalid mesh: ") + error.what());
    }
    require(std::isfinite(mesh.origin.x) && std::isfinite(mesh.origin.y) && std::isfinite(mesh.origin.z),
            "a reader returned an origin that is not finite");
    for (const glm::uvec3& t : mesh.triangles)
        require(t.x != t.y && t.y != t.z && t.z != t.x, "a reader returned a triangle that uses a vertex twice");
}

void requireNotes(const ReadReport& report) {
    for (const std::string& note : report.notes) {
        requirePlainError(note);
        require(!note.empty() && note.back() != '.', "a note is no sentence without a full stop: " + note);
    }
}

/// A written mesh is read back the same.
void checkWritten(const Mesh& mesh) {
    for (const char* name : {"written.ply", "written.obj"}) {
        const std::filesystem::path path = scratch(name);
        try {
            writeMesh(path, mesh);
        } catch (const std::invalid_argument&) {
            continue;  // world coordinates beyond the range of floats
        }
        const Mesh again = readMesh(path);
        require(again.triangles == mesh.triangles && again.points.size() == mesh.points.size(),
                std::string(name) + " does not hold the triangles that were written");
        const bool isLocal = mesh.origin == glm::dvec3(0) && again.origin == glm::dvec3(0);
        for (std::size_t i = 0; i < mesh.points.size() && isLocal; ++i)
            require(again.points[i] == mesh.points[i], std::string(name) + " does not hold the points of the mesh");
    }
}

/// The error names the file, in plain words. It may quote any word of the file.
void requireReaderError(const std::string& text, const std::filesystem::path& path, Bytes file) {
    require(text.starts_with(path.string() + ": "), "an error does not name the file");
    const std::string reason = text.substr(path.string().size());
    requirePlainError(reason);
    const std::string_view bytes(reinterpret_cast<const char*>(file.data()), file.size());
    for (const char* word : jargon)
        require(reason.find(word) == std::string::npos || bytes.find(word) != std::string_view::npos,
                "an error is not in plain words: " + reason);
}

void checkReader(Bytes file, const char* name, Reader read) {
    const std::filesystem::path path = fileOf(file, name);
    ReadReport report;
    Mesh mesh;
    try {
        mesh = read(path, report);
    } catch (const std::runtime_error& error) {
        return requireReaderError(error.what(), path, file);
    } catch (const std::invalid_argument& error) {
        return requireReaderError(error.what(), path, file);
    }
    requireMesh(mesh);
    requireNotes(report);
    checkWritten(mesh);
}

Mesh readShortly(const std::filesystem::path& path, ReadReport& report) {
    constexpr detail::ChildLimits limits{std::chrono::seconds(1), std::size_t(1) << 30};
    return detail::assembled(detail::readScene(path, limits), path, report);
}

}  // namespace

void requirePlainError(const std::string& text) {
    require(!text.empty(), "an error has no text");
    require(text.size() <= maxErrorBytes, "an error is too long: " + text);
    for (const char c : text)
        require(static_cast<unsigned char>(c) >= ' ' && c != '\x7f', "an error has control characters: " + text);
}

void checkObj(Bytes file) {
    checkReader(file, "fuzz.obj", detail::readObj);
}
void checkPly(Bytes file) {
    checkReader(file, "fuzz.ply", detail::readPly);
}
void checkStl(Bytes file) {
    checkReader(file, "fuzz.stl", detail::readStl);
}
void checkOff(Bytes file) {
    checkReader(file, "fuzz.off", detail::readOff);
}
void checkRaw(Bytes file) {
    checkReader(file, "fuzz.raw", detail::readRaw);
}

void checkGltf(Bytes file) {
    const bool isBinary = file.size() >= 4 && std::equal(file.begin(), file.begin() + 4, "glTF");
    const std::filesystem::path path = fileOf(file, isBinary ? "fuzz.glb" : "fuzz.gltf");
    detail::Polygons polygons;
    try {
        polygons = detail::readGltf(path);
    } catch (const std::exception&) {
        return;  // the parent process of the reader puts any error into plain words
    }
    for (const unsigned corner : polygons.corners)
        require(corner < polygons.points.size(), "readGltf() returned a corner that is no point");
    require(!polygons.sizes.empty() || polygons.corners.size() % 3 == 0, "readGltf() returned a part of a triangle");
    ReadReport report;
    Mesh mesh;
    try {
        mesh = detail::assembled(std::move(polygons), path, report);
    } catch (const std::runtime_error&) {
        return;
    } catch (const std::invalid_argument&) {
        return;
    }
    requireMesh(mesh);
}

void checkScenes(Bytes file) {
    static const std::vector<SceneFile> formats = sceneFiles();
    static const std::vector<SceneFile> parts = parts3mf();
    if (file.empty()) return;
    const std::size_t format = file[0] % (formats.size() + parts.size());
    std::string bytes(file.begin() + 1, file.end());
    std::filesystem::path name = "fuzz.3mf";
    if (format < formats.size()) {
        name = "fuzz" + std::filesystem::path(formats[format].name).extension().string();
    } else {  // a part of an archive that is whole
        std::vector<SceneFile> edited = parts;
        edited[format - formats.size()].bytes = bytes;
        bytes = zip(edited);
    }
    checkReader({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, name.c_str(), readShortly);
}

}  // namespace bilayer::test
