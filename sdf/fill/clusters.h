// SPDX-License-Identifier: Apache-2.0
// Groups small pieces by voxel. The cost of a brick full of tiny triangles then depends on its surface area, not on the
// triangle count.
// Tested by tests/sdf/exact.cpp.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sdf/fill/cell_sort.h"
#include "sdf/fill/exact_block.h"

namespace bilayer::detail {

/// The pieces of a brick, grouped into clusters. Reuses its memory for each brick.
class Clusters {
  public:
    /// Groups the pieces of a brick with this origin [index coordinates].
    void build(std::span<const Piece> pieces, const glm::ivec3& origin);

    std::span<const Cluster> clusters() const { return clusters_; }
    std::span<const ClusterMember> members() const { return members_; }

  private:
    void addCluster(std::uint32_t begin, std::uint32_t end);

    std::vector<Cluster> clusters_;
    std::vector<ClusterMember> members_;
    CellSort<ClusterMember> sort_;
};

}  // namespace bilayer::detail
