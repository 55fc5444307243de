// SPDX-License-Identifier: Apache-2.0
// The first pass of a build in tiles: reads the mesh, decides the signs of all tiles, sorts the triangles by tile, and
// writes the plan.
// Tested by tests/tools/tiles.cpp through the program.
#pragma once

#include "sdf/tiles/tile_signs.h"
#include "tools/build.h"
#include "tools/tiles/sign_records.h"
#include "tools/tiles/tile_folder.h"

namespace bilayer::tools {

class MeshSort {
  public:
    /// @param arguments  get the sizes that the mesh determines
    /// @param budget     max memory [bytes]
    MeshSort(BuildArguments& arguments, const glm::ivec3& counts, double budget, const TileFolder& folder)
        : a_(arguments), counts_(counts), budget_(budget), folder_(folder) {}

    /// Replaces the plan.
    /// @param identity  of the field
    /// @param round     count of earlier plans whose normals contradicted each other. Above 0 and without `known`,
    ///                  all tiles are removed
    /// @param known     the signs of tiles that are there and stay; or null
    /// Throws std::runtime_error if the mesh does not fit, and as decideSigns() does.
    void run(const Json& identity, int round, const PlannedSigns* known = nullptr);

  private:
    detail::SignedSource open(int round) const;
    void requireRoomToOrient(std::size_t triangles, double whole) const;

    BuildArguments& a_;
    glm::ivec3 counts_;
    double budget_;
    const TileFolder& folder_;
};

}  // namespace bilayer::tools
