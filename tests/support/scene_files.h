// Small files in the formats of Assimp, for tests.
#pragma once

#include <string>
#include <vector>

namespace bilayer::test {

struct SceneFile {
    std::string name;  ///< with its ending
    std::string bytes;
};

/// The cube of cubePoints(), once in each format that it is written in here: by Assimp's exporters or by hand.
std::vector<SceneFile> cubeFiles();

/// First bytes of further binary formats, without a model.
std::vector<SceneFile> headFiles();

/// A ZIP archive of uncompressed files.
std::string zip(const std::vector<SceneFile>& files);

/// The parts of a 3MF file that holds the cube.
std::vector<SceneFile> parts3mf();

}  // namespace bilayer::test
