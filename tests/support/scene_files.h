// SPDX-License-Identifier: Apache-2.0
// Small files in Assimp's formats, for tests.
#pragma once

#include <string>
#include <vector>

namespace bilayer::test {

struct SceneFile {
    std::string name;  ///< with extension
    std::string bytes;
};

/// The cube of cubePoints() in each supported format, written by Assimp's exporters or by hand.
std::vector<SceneFile> cubeFiles();

/// Only the first bytes of further binary formats, without a model.
std::vector<SceneFile> headFiles();

/// All of these, and glTF files with instances, a skin and sparse vertices.
std::vector<SceneFile> sceneFiles();

/// A ZIP archive of uncompressed files.
std::string zip(const std::vector<SceneFile>& files);

/// The parts of a 3MF file that holds the cube.
std::vector<SceneFile> parts3mf();

}  // namespace bilayer::test
