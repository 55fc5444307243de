// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/mesh_io.h>

#include <string>

#include "sdf/io/formats/mesh_readers.h"
#include "sdf/io/input_file.h"
#include "sdf/io/polygon/polygons.h"
#include "sdf/io/scenes/scene_io.h"

namespace bilayer {

using namespace detail;

namespace {

Mesh readByExtension(const std::filesystem::path& path, ReadReport& report) {
    const std::string extension = lowerExtension(path);
    if (extension == ".obj") return readObj(path, report);
    if (extension == ".ply") return readPly(path, report);
    if (extension == ".stl") return readStl(path, report);
    if (extension == ".off") return readOff(path, report);
    if (extension == ".raw") return readRaw(path, report);
    requireInputFile(path);
    return assembled(readScene(path), path, report);
}

}  // namespace

MeshFile readMeshFile(const std::filesystem::path& path) {
    MeshFile file;
    file.mesh = readByExtension(path, file.report);
    return file;
}

Mesh readMesh(const std::filesystem::path& path) {
    return readMeshFile(path).mesh;
}

}  // namespace bilayer
