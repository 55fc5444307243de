// SPDX-License-Identifier: Apache-2.0
// The plan of a field in tiles, the records of its tiles, and the manifest that is made of both.
// Tested by tests/tools/tiles.cpp through the program.
#pragma once

#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "sdf/tiles/tile_build.h"
#include "sdf/tiles/tile_sort.h"
#include "tools/build.h"
#include "tools/output.h"
#include "tools/tiles/sign_records.h"

namespace bilayer::tools {

/// What determines the bytes of the tiles: the mesh file, the options, the counts of tiles.
Json identityOf(const BuildArguments& arguments, const glm::ivec3& counts, const std::string& meshFileHash);

class TilePlan {
  public:
    /// Throws std::runtime_error if the plan has another form.
    explicit TilePlan(Json plan);

    static Json toJson(const Json& identity, const detail::MeshFacts& facts, float voxelSize, const Json& signs,
                       const std::vector<detail::TileLoad>& loads, const Json& sorting);

    const detail::MeshFacts& facts() const { return facts_; }
    float voxelSize() const { return voxelSize_; }
    const std::vector<detail::TileLoad>& loads() const { return loads_; }
    const PlannedSigns& signs() const { return signs_; }

    /// Returns the plan with other signs.
    Json with(const PlannedSigns& signs) const;

    /// Returns the manifest of the finished field.
    Json manifest(const std::vector<Json>& records, int ranks) const;

  private:
    Json plan_;
    detail::MeshFacts facts_;
    float voxelSize_ = 0;
    PlannedSigns signs_;
    std::vector<detail::TileLoad> loads_;
};

/// What is known of a tile when it is built, without its file.
/// @param box  its blocks
Json recordOf(const glm::ivec3& place, const detail::BlockBox& box, std::uint64_t triangles,
              const detail::BuiltTile& tile);

/// What the manifest of a field says of its tiles, its mesh and its build.
void addTileRows(Table& table, const Json& manifest);

/// Returns the place of a record's tile.
glm::ivec3 placeOf(const Json& record);

/// Gives each tile without leaves the side of its neighbours, in the order of their numbers. Throws
/// std::invalid_argument if two neighbours contradict each other.
void joinSides(std::vector<Json>& records, const glm::ivec3& counts);

}  // namespace bilayer::tools
