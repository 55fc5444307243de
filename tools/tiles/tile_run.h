// SPDX-License-Identifier: Apache-2.0
// `bilayer build --tiles`: builds a field tile by tile.
// Tested by tests/tools/tiles.cpp through the program.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>

#include "tools/build.h"
#include "tools/tiles/ranks.h"

namespace bilayer::tools {

/// The options of a build in tiles, as its command line gives them.
struct TileArguments {
    std::string counts;        ///< "4x4x2"; empty: one piece
    std::uint64_t memory = 0;  ///< [MiB]; 0: as much as the machine has
    CLI::Option* memoryGiven = nullptr;
};

/// Returns the option --tiles.
CLI::Option* addTileOptions(CLI::App& command, TileArguments& arguments);

/// Builds the missing tiles of a field, with those that other ranks leave to this one. The first rank then completes
/// the manifest and prints the outcome. Throws CLI::ValidationError for options that tiles do not have, and
/// std::exception as build() does.
void buildTiles(BuildArguments arguments, const TileArguments& tiles, const Ranks& ranks);

}  // namespace bilayer::tools
