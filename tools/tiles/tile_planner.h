// SPDX-License-Identifier: Apache-2.0
// The first rank's part of a build in tiles: it plans the field, resumes an earlier plan, and plans again.
// Tested by tests/tools/tiles.cpp through the program.
#pragma once

#include <glm/vec3.hpp>
#include <optional>

#include "sdf/tiles/tile_signs.h"
#include "tools/build.h"
#include "tools/tiles/mesh_sort.h"
#include "tools/tiles/planned_tiles.h"
#include "tools/tiles/tile_folder.h"

namespace bilayer::tools {

class TilePlanner {
  public:
    /// Locks the folder, which is created: no other build may write it.
    /// @param budget  max memory [bytes]
    /// Throws std::runtime_error that names the folder.
    TilePlanner(BuildArguments arguments, const glm::ivec3& counts, double budget, const TileFolder& folder);

    /// Plans the field, or resumes the existing plan. Afterwards there is the manifest of a finished field, or a plan
    /// and the records of exactly those tiles that are intact. A new folder goes if there is nothing to build. Throws
    /// std::runtime_error if the folder holds another field, or if the memory does not suffice.
    void prepare();

    /// Plans the tiles anew whose counts show that the signs are not those of build().
    void planAgain(const PlannedTiles& tiles, const detail::SignCounts& sum);

  private:
    void planOrResume();
    bool resume();
    bool reopenIfDamaged(const Json& manifest);
    void requireSame(const Json& made) const;
    void requireMemory() const;
    PlannedTiles tiles() const { return plannedTiles(TilePlan(readRecord(folder_.plan())), a_, counts_); }
    MeshSort sort() { return {a_, counts_, budget_, folder_}; }

    BuildArguments a_;
    glm::ivec3 counts_;
    double budget_;
    const TileFolder& folder_;
    bool isNew_ = false;  // the folder
    std::optional<FolderLock> lock_;
    Json identity_;
};

}  // namespace bilayer::tools
