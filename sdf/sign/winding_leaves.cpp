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
#include "sdf/mesh/hole_caps.h"
#include "sdf/sign/column_crossings.h"

namespace bilayer::detail {
namespace {

/// Sums of estimates are rounded by less.
constexpr double rounding = 1e-9;

glm::dvec3 position(const openvdb::Coord& voxel, double h) {
    return glm::dvec3(voxel.x(), voxel.y(), voxel.z()) * h;
}

// A cube of voxels as a ball around their centres [m].
struct Cube {
    openvdb::Coord origin;
    int side;
    double h;
    glm::dvec3 centre() const { return position(origin, h) + 0.5 * (side - 1) * h; }
    double radius() const { return std::sqrt(3.0) / 2 * (side - 1) * h * (1 + 1e-9); }
};

class OpenLeaf {
  public:
    using Numbers = std::array<std::int32_t, blockVoxels>;

    /// @param closed  winding numbers of the mesh and its caps
    OpenLeaf(const WindingNumber& winding, const WindingNumber& caps, const BandLeaf& leaf, const Numbers& closed,
             double h)
        : winding_(winding), caps_(caps), leaf_(leaf), closed_(closed), h_(h) {}

    BlockMask inside() {
        sign({leaf_.origin(), blockSide, h_});
        return inside_;
    }

  private:
    void sign(const Cube& cube) {
        const WindingInBall caps(caps_, cube.centre(), cube.radius());
        constexpr int octantSide = blockSide / 2;
        if (cube.side > octantSide && caps.hasNear()) {
            for (int octant = 0; octant < 8; ++octant)
                sign({cube.origin.offsetBy(octant / 4 * octantSide, octant / 2 % 2 * octantSide,
                                           octant % 2 * octantSide),
                      octantSide, h_});
            return;
        }
        for (int x = 0; x < cube.side; ++x)
            for (int y = 0; y < cube.side; ++y)
                for (int z = 0; z < cube.side; ++z) {
                    const openvdb::Coord voxel = cube.origin.offsetBy(x, y, z);
                    const unsigned offset = BandLeaf::coordToOffset(voxel);
                    if (isInside(caps, offset, position(voxel, h_))) set(inside_, offset);
                }
    }

    bool isInside(const WindingInBall& caps, unsigned voxel, const glm::dvec3& point) const {
        const auto aboveHalf = [&](const WindingNumber::Estimate& e) { return closed_[voxel] - e.value - 0.5; };
        const auto decides = [&](const WindingNumber::Estimate& e) {
            return std::abs(aboveHalf(e)) > e.error + rounding;
        };
        const WindingNumber::Estimate coarse = caps.coarseEstimate(point);
        if (decides(coarse)) return aboveHalf(coarse) > 0;
        const WindingNumber::Estimate fine = caps.estimate(point);
        return decides(fine) ? aboveHalf(fine) > 0 : winding_.isInside(point);
    }

    const WindingNumber &winding_, &caps_;
    const BandLeaf& leaf_;
    const Numbers& closed_;
    const double h_;
    BlockMask inside_{};
};

// Calls visit(leaf, numbers) for each leaf, with the winding numbers of a closed mesh along its columns.
template <class Visit>
void forEachLeaf(const std::vector<BandLeaf*>& leaves, const Mesh& closed, double h, Progress* progress,
                 const Visit& visit) {
    const ColumnCrossings columns(leaves, closed, h, false, progress);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, columns.tiles()), [&](const auto& range) {
        ColumnCrossings::OfTile crossings;
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            ColumnNumbers numbers;
            columns.forEachLeaf(i, crossings, [&](BandLeaf& leaf, auto found, std::uint64_t) {
                poll(progress);
                const std::uint64_t crossed = numbers.enter(leaf, found);
                visit(leaf, numbers, crossed);
            });
        }
    });
}

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

void signOpen(BandLeaf& leaf, ColumnNumbers& numbers, const WindingNumber& winding, const WindingNumber& caps,
              const BandWidths& widths) {
    OpenLeaf::Numbers closed;
    for (std::size_t column = 0; column < columnsPerLeaf; ++column)
        numbers.climb(column,
                      [&](int k, std::int32_t number) { closed[column * blockSide + std::size_t(k)] = number; });
    signLeaf(leaf, OpenLeaf(winding, caps, leaf, closed, double(widths.voxelSize)).inside(), widths);
}

}  // namespace

void signLeaves(const std::vector<BandLeaf*>& leaves, const Mesh& mesh, const WindingNumber& winding,
                const BandWidths& widths, bool closed, Progress* progress) {
    const auto h = double(widths.voxelSize);
    std::vector<glm::uvec3> caps = closed ? std::vector<glm::uvec3>() : holeCaps(mesh, progress);
    if (caps.empty())
        return forEachLeaf(leaves, mesh, h, progress,
                           [&](BandLeaf& leaf, ColumnNumbers& numbers, std::uint64_t crossed) {
                               signClosed(leaf, numbers, crossed, widths);
                           });
    Mesh capped{mesh.points, std::move(caps)};
    const WindingNumber ofCaps(capped, progress);
    capped.triangles.insert(capped.triangles.end(), mesh.triangles.begin(), mesh.triangles.end());
    forEachLeaf(leaves, capped, h, progress, [&](BandLeaf& leaf, ColumnNumbers& numbers, std::uint64_t) {
        signOpen(leaf, numbers, winding, ofCaps, widths);
    });
}

}  // namespace bilayer::detail
