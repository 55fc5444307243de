// SPDX-License-Identifier: Apache-2.0
// Builds in tiles, and the same fields in one piece.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include <bilayer/sdf/level_set.h>
#include "tests/tools/program.h"

namespace bilayer::test {

/// The words of a build in tiles.
Words tiled(const std::filesystem::path& mesh, const std::filesystem::path& folder, const std::string& tiles,
            const Words& options);

/// Merges the tiles of a folder.
LevelSet merged(const std::filesystem::path& folder);

/// The field of `bilayer build`.
LevelSet inOnePiece(const std::filesystem::path& mesh, const Words& options);

/// Builds in tiles, and checks that the merged field is the one in one piece. Returns the manifest.
nlohmann::json sameInTiles(const std::filesystem::path& mesh, const std::string& tiles, const Words& options);

/// Checks that a command ends with a status and an error that names the culprit.
void checkRefusal(const Words& words, int status, const std::string& culprit);

}  // namespace bilayer::test
