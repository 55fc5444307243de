// SPDX-License-Identifier: Apache-2.0
// Signs of the voxels of a leaf near a hole, where the winding number changes fast away from the surface.
// Tested by tests/sdf/winding.cpp through build().
#pragma once

#include <array>
#include <optional>
#include <queue>
#include <utility>

#include "sdf/bvh/winding_in_ball.h"
#include "sdf/leaf/band.h"
#include "sdf/sign/octree_cells.h"
#include "sdf/sign/winding_query.h"

namespace bilayer::detail {

/// Signs each voxel of a leaf. A sign is propagated to the next voxel if no surface lies between them, with what the
/// slope between them leaves of the winding number's distance to one half.
class WindingSteepLeaf {
  public:
    WindingSteepLeaf(const WindingQuery& query, const BandLeaf& leaf);

    const BlockMask& inside() const { return inside_; }
    /// Returns the voxels whose winding number is at least that far from one half.
    BlockMask fartherThan(double margin) const;

  private:
    using Reached = std::pair<double, unsigned>;  // the margin of a voxel, and its number

    struct Octant {  // 4x4x4 voxels
        glm::dvec3 centre;
        double slope;                         // of its voxels and halfway to their neighbours
        std::optional<WindingInBall> inBall;  // once a voxel is asked for
    };

    WindingSide sideOf(unsigned voxel);
    void propagateFrom(unsigned voxel);
    void reach(unsigned voxel, double margin, bool isInside);
    void reachNeighbours(const Reached& from);
    double slopeAt(unsigned voxel);

    const WindingQuery& query_;
    const BandLeaf& leaf_;
    BlockMask inside_{};
    std::array<double, blockVoxels> margin_;  // lower bound of the number's distance to one half; negative: unknown
    std::array<double, blockVoxels> slope_;   // halfway to all neighbours [1/voxel]; negative: not asked for yet
    std::array<Octant, 8> octants_;
    std::priority_queue<Reached> front_;
};

}  // namespace bilayer::detail
