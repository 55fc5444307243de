// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/winding_steep_leaf.h"

#include <cmath>

#include "sdf/base/progress.h"

namespace bilayer::detail {
namespace {

constexpr int octantSide = blockSide / 2;
const double octantRadius = std::sqrt(3.0) / 2 * (octantSide - 1) * (1 + 1e-9);  // to the farthest voxels [voxels]
/// Sums of estimates are rounded by less.
constexpr double rounding = 1e-9;
/// Where the winding number changes by less than this per voxel, an octant's slope is good enough for its voxels.
constexpr double calmSlope = 0.03;

std::size_t octantOf(unsigned voxel) {
    return voxel / (blockSide * blockSide) / octantSide * 4 + voxel / blockSide % blockSide / octantSide * 2 +
           voxel % blockSide / octantSide;
}

}  // namespace

WindingSteepLeaf::WindingSteepLeaf(const WindingQuery& query, const BandLeaf& leaf) : query_(query), leaf_(leaf) {
    margin_.fill(-1);
    slope_.fill(-1);
    for (int octant = 0; octant < 8; ++octant) {
        const openvdb::Coord corner =
            leaf.origin().offsetBy(octant / 4 * octantSide, octant / 2 % 2 * octantSide, octant % 2 * octantSide);
        Octant& o = octants_[std::size_t(octant)];
        o.centre = query.centre(corner, octantSide);
        o.slope = query.slopeIn(o.centre, octantSide);
    }
    // voxels away from the surface have more neighbours to reach
    const float open = (0.5f + distanceSlack) * float(query.voxelSize);
    for (const bool away : {true, false})
        for (unsigned voxel = 0; voxel < blockVoxels; ++voxel)
            if (margin_[voxel] < 0 && (leaf.buffer().data()[voxel] > open || !away)) propagateFrom(voxel);
}

BlockMask WindingSteepLeaf::fartherThan(double margin) const {
    BlockMask result{};
    for (unsigned voxel = 0; voxel < blockVoxels; ++voxel)
        if (margin_[voxel] >= margin) set(result, voxel);
    return result;
}

// Few voxels are so close to one half that they need a query of their own.
WindingSide WindingSteepLeaf::sideOf(unsigned voxel) {
    poll(query_.progress);
    const glm::dvec3 point = query_.position(leaf_.offsetToGlobalCoord(voxel));
    Octant& octant = octants_[octantOf(voxel)];
    if (!octant.inBall) octant.inBall.emplace(query_.winding, octant.centre, octantRadius * query_.voxelSize);
    const WindingNumber::Estimate e = octant.inBall->estimate(point);
    const double margin = std::abs(e.value - 0.5) - e.error;
    return margin > rounding ? WindingSide{e.value > 0.5, margin} : WindingSide{query_.winding.isInside(point), 0};
}

void WindingSteepLeaf::propagateFrom(unsigned voxel) {
    const WindingSide side = sideOf(voxel);
    reach(voxel, side.margin, side.inside);
    while (!front_.empty()) {
        const Reached from = front_.top();
        front_.pop();
        if (from.first == margin_[from.second]) reachNeighbours(from);
    }
}

void WindingSteepLeaf::reach(unsigned voxel, double margin, bool isInside) {
    margin_[voxel] = margin;
    if (isInside) set(inside_, voxel);
    front_.push({margin, voxel});
}

void WindingSteepLeaf::reachNeighbours(const Reached& from) {
    const auto [margin, voxel] = from;
    const double halfSlope = 0.5 * slopeAt(voxel);
    if (!(halfSlope < margin)) return;
    const float* distances = leaf_.buffer().data();
    const bool isInside = test(inside_, voxel);
    const openvdb::Coord here = BandLeaf::offsetToLocalCoord(voxel);
    for (int link = 0; link < 27; ++link) {
        const openvdb::Coord step(link / 9 - 1, link / 3 % 3 - 1, link % 3 - 1), there = here + step;
        if (link == 13 || !openvdb::CoordBBox::createCube({0, 0, 0}, blockSide).isInside(there)) continue;
        const unsigned neighbour = BandLeaf::coordToOffset(there);
        const double length = std::sqrt(double(step.x() * step.x() + step.y() * step.y() + step.z() * step.z()));
        if (double(distances[voxel]) + double(distances[neighbour]) <=
            (length + double(distanceSlack)) * query_.voxelSize)
            continue;
        if (!(margin - length * halfSlope > margin_[neighbour])) continue;
        const double left = margin - length * (halfSlope + 0.5 * slopeAt(neighbour));
        if (left > 0 && left > margin_[neighbour]) reach(neighbour, left, isInside);
    }
}

double WindingSteepLeaf::slopeAt(unsigned voxel) {
    const double ofOctant = octants_[octantOf(voxel)].slope;
    if (ofOctant < calmSlope) return ofOctant;
    double& slope = slope_[voxel];
    if (slope < 0) slope = query_.slopeIn(query_.position(leaf_.offsetToGlobalCoord(voxel)), 1);
    return slope;
}

}  // namespace bilayer::detail
