// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <fstream>
#include <stdexcept>
#include <string>

#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/mesh_io.h>
#include "sdf/io/mesh_readers.h"
#include "sdf/io/polygons.h"
#include "sdf/io/read_gltf.h"
#include "tests/fuzz/checks.h"
#include "tests/support/support.h"

namespace bilayer::test {
namespace {

constexpr std::size_t maxErrorBytes = 1000;  // [bytes] without the path: readers quote at most some words of a file

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

void checkReader(Bytes file, const char* name, Reader read) {
    const std::filesystem::path path = fileOf(file, name);
    ReadReport report;
    Mesh mesh;
    try {
        mesh = read(path, report);
    } catch (const std::runtime_error& error) {
        require(std::string(error.what()).starts_with(path.string() + ": "), "an error does not name the file");
        return requirePlainError(std::string(error.what()).substr(path.string().size()));
    } catch (const std::invalid_argument& error) {
        require(std::string(error.what()).starts_with(path.string() + ": "), "an error does not name the file");
        return requirePlainError(std::string(error.what()).substr(path.string().size()));
    }
    requireMesh(mesh);
    requireNotes(report);
    checkWritten(mesh);
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

}  // namespace bilayer::test
