// Small pieces grouped by the voxel that they lie in, so that a brick full of tiny triangles costs what its surface
// costs and not what their number would.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sdf/fill/cell_sort.h"
#include "sdf/fill/exact_block.h"

namespace bilayer::detail {

/// The pieces of a brick in clusters. Memory is used again from brick to brick.
class Clusters {
  public:
    /// Groups the pieces of the brick with this origin [index coordinates].
    void build(std::span<const Piece> pieces, const glm::ivec3& origin);

    std::span<const Cluster> clusters() const { return clusters_; }
    std::span<const Member> members() const { return members_; }

  private:
    void addCluster(std::uint32_t begin, std::uint32_t end);

    std::vector<Cluster> clusters_;
    std::vector<Member> members_;
    CellSort<Member> sort_;
};

}  // namespace bilayer::detail
