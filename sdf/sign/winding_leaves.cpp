// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/winding_leaves.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <utility>

#include "sdf/base/progress.h"
#include "sdf/bvh/winding_in_ball.h"
#include "sdf/mesh/closing_triangles.h"
#include "sdf/sign/column_crossings.h"

namespace bilayer::detail {
namespace {

/// Sums of estimates are rounded by less.
constexpr double rounding = 1e-9;

/// The sides of a leaf's voxels by the winding number of an open mesh: the one of the closed mesh, less the one of the
/// closing triangles.
class OpenMeshSides {
  public:
    using Numbers = std::array<std::int32_t, blockVoxels>;

    /// @param query   of the open mesh
    /// @param closed  winding numbers of the closed mesh
    OpenMeshSides(const WindingQuery& query, const WindingNumber& closing, const BandLeaf& leaf, const Numbers& closed)
        : query_(query), closing_(closing), closed_(closed) {
        find(leaf.origin(), blockSide);
    }

    const BlockMask& inside() const { return inside_; }

  private:
    void find(const openvdb::Coord& origin, int side) {
        const double radius = std::sqrt(3.0) / 2 * (side - 1) * query_.voxelSize * (1 + 1e-9);
        const WindingInBall closing(closing_, query_.centre(origin, side), radius);
        constexpr int octantSide = blockSide / 2;
        if (side > octantSide && closing.hasNear()) {
            for (int octant = 0; octant < 8; ++octant)
                find(origin.offsetBy(octant / 4 * octantSide, octant / 2 % 2 * octantSide, octant % 2 * octantSide),
                     octantSide);
            return;
        }
        for (int x = 0; x < side; ++x)
            for (int y = 0; y < side; ++y)
                for (int z = 0; z < side; ++z) {
                    const openvdb::Coord voxel = origin.offsetBy(x, y, z);
                    const unsigned offset = BandLeaf::coordToOffset(voxel);
                    if (isInside(closing, offset, query_.position(voxel))) set(inside_, offset);
                }
    }

    bool isInside(const WindingInBall& closing, unsigned voxel, const glm::dvec3& point) const {
        const auto aboveHalf = [&](const WindingNumber::Estimate& e) { return closed_[voxel] - e.value - 0.5; };
        const auto decides = [&](const WindingNumber::Estimate& e) {
            return std::abs(aboveHalf(e)) > e.error + rounding;
        };
        const WindingNumber::Estimate coarse = closing.coarseEstimate(point);
        if (decides(coarse)) return aboveHalf(coarse) > 0;
        const WindingNumber::Estimate fine = closing.estimate(point);
        return decides(fine) ? aboveHalf(fine) > 0 : query_.winding.isInside(point);
    }

    const WindingQuery& query_;
    const WindingNumber& closing_;
    const Numbers& closed_;
    BlockMask inside_{};
};

// Calls visit(leaf, numbers, crossed) for each leaf: with the winding numbers of a closed mesh along its columns, and
// the columns that are crossed.
template <class Visit>
void forEachLeaf(const std::vector<BandLeaf*>& leaves, const Mesh& closed, const WindingQuery& query,
                 const Visit& visit) {
    const ColumnCrossings columns(leaves, closed, query.voxelSize, false, query.progress);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, columns.tiles()), [&](const auto& range) {
        ColumnCrossings::OfTile crossings;
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            ColumnNumbers numbers;
            columns.forEachLeaf(i, crossings, [&](BandLeaf& leaf, auto found, std::uint64_t) {
                poll(query.progress);
                const std::uint64_t crossed = numbers.enter(leaf, found);
                visit(leaf, numbers, crossed);
            });
        }
    });
}

void signOpen(BandLeaf& leaf, ColumnNumbers& numbers, const WindingQuery& query, const WindingNumber& closing,
              const BandWidths& widths) {
    OpenMeshSides::Numbers closed;
    for (std::size_t column = 0; column < columnsPerLeaf; ++column)
        numbers.climb(column,
                      [&](int k, std::int32_t number) { closed[column * blockSide + std::size_t(k)] = number; });
    signLeaf(leaf, OpenMeshSides(query, closing, leaf, closed).inside(), widths);
}

}  // namespace

void signClosed(BandLeaf& leaf, ColumnNumbers& numbers, std::uint64_t crossed, const BandWidths& widths) {
    BlockMask inside{};
    for (std::size_t column = 0; column < columnsPerLeaf; ++column) {
        std::uint64_t bits = 0;
        if (crossed >> column & 1)
            numbers.climb(column, [&](int k, std::int32_t number) { bits |= std::uint64_t(number > 0) << k; });
        else if (numbers.below(column) > 0)
            bits = 0xff;
        inside[column / blockSide] |= bits << (column % blockSide * blockSide);
    }
    signLeaf(leaf, inside, widths);
}

void signLeaves(const std::vector<BandLeaf*>& leaves, const Mesh& mesh, const WindingQuery& query,
                const BandWidths& widths) {
    std::vector<glm::uvec3> closing = query.slope ? closingTriangles(mesh, query.progress) : std::vector<glm::uvec3>();
    if (closing.empty())
        return forEachLeaf(leaves, mesh, query, [&](BandLeaf& leaf, ColumnNumbers& numbers, std::uint64_t crossed) {
            signClosed(leaf, numbers, crossed, widths);
        });
    Mesh closed{mesh.points, std::move(closing)};
    const WindingNumber ofClosing(closed, query.progress);
    closed.triangles.insert(closed.triangles.end(), mesh.triangles.begin(), mesh.triangles.end());
    forEachLeaf(leaves, closed, query, [&](BandLeaf& leaf, ColumnNumbers& numbers, std::uint64_t) {
        signOpen(leaf, numbers, query, ofClosing, widths);
    });
}

}  // namespace bilayer::detail
