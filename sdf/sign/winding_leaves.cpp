// SPDX-License-Identifier: Apache-2.0
// A sign is propagated from voxel to voxel as long as the number certainly stays on its side of one half.
#include "sdf/sign/winding_leaves.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sdf/sign/winding_steep_leaf.h"

namespace bilayer::detail {
namespace {

/// Where the winding number may change by more than this per voxel, each voxel is asked for its own slope.
constexpr double calmSlope = 0.02;
/// Reserved part of the distance to one half, for voxels near the surface: two links of at most sqrt(3) voxels each.
constexpr double reserve = 2 * 1.7320508075688772 * calmSlope;

class LeafSigns {
  public:
    LeafSigns(const WindingQuery& query, const WindingBrick& brick) : query_(query), brick_(brick) {
        const float open = (0.5f + distanceSlack) * float(query.voxelSize);
        for (const OctreeCell& cell : brick.cells()) {
            if (!cell.leaf) continue;
            // Links extend one voxel beyond a leaf.
            const double slope = query.slopeIn(query.centre(cell.origin, cell.side), cell.side + 1);
            leaves_.push_back({.leaf = cell.leaf, .slope = slope, .open = farther(*cell.leaf, open)});
        }
    }

    void sign(const BandWidths& widths) {
        for (std::size_t i = 0; i < leaves_.size(); ++i) {
            LeafState& state = leaves_[i];
            if (!state.calm()) {
                signSteep(state);
                continue;
            }
            for (unsigned voxel = 0; voxel < blockVoxels; ++voxel)
                if (test(state.open, voxel) && !test(state.known, voxel)) propagate(i, voxel);
        }
        signNear();
        for (LeafState& state : leaves_) signLeaf(*state.leaf, state.inside, widths);
    }

  private:
    struct LeafState {
        BandLeaf* leaf;
        double slope;      // [1/voxel], for links that start in this leaf
        BlockMask open{};  // voxels between which no link can cross the surface
        BlockMask known{}, inside{};
        BlockMask firm{};  // with `reserve` left to one half
        BlockMask front{};
        bool calm() const { return slope <= calmSlope; }
    };

    WindingSide decide(LeafState& state, unsigned voxel) {
        const glm::dvec3 point = query_.position(state.leaf->offsetToGlobalCoord(voxel));
        const WindingSide side = test(state.open, voxel) ? query_.around(point) : query_.at(point);
        set(state.known, voxel);
        if (side.inside) set(state.inside, voxel);
        return side;
    }

    // Propagates over the open voxels of calm leaves, one step at a time, until the number may be too close to one
    // half.
    void propagate(std::size_t leaf, unsigned voxel) {
        const WindingSide side = decide(leaves_[leaf], voxel);
        double left = side.margin - reserve;
        if (left <= 0) return;
        set(leaves_[leaf].firm, voxel);
        set(leaves_[leaf].front, voxel);
        std::vector<std::size_t> wave{leaf};
        while (!wave.empty()) {
            double steepest = 0;
            for (const std::size_t i : wave) steepest = std::max(steepest, leaves_[i].slope);
            left -= steepest;
            std::vector<std::pair<std::size_t, BlockMask>> arrivals;
            for (const std::size_t i : wave) {
                LeafState& from = leaves_[i];
                arrivals.emplace_back(i, grown(from.front));
                for (int face = 0; face < 6; ++face) {
                    openvdb::Coord at = from.leaf->origin();
                    at[face / 2] += face % 2 ? blockSide : -blockSide;
                    const int neighbour = brick_.leafAt(at);
                    if (neighbour < 0) continue;
                    const BlockMask over = across(from.front, face / 2, face % 2);
                    if (any(over)) arrivals.emplace_back(std::size_t(neighbour), over);
                }
                from.front = {};
            }
            wave.clear();
            if (left < 0) return;
            for (const auto& [i, mask] : arrivals) {
                LeafState& to = leaves_[i];
                if (!to.calm()) continue;
                const bool waits = any(to.front);
                for (std::size_t x = 0; x < blockSide; ++x) {
                    const std::uint64_t fresh = mask[x] & to.open[x] & ~to.known[x];
                    to.front[x] |= fresh;
                    to.known[x] |= fresh;
                    to.firm[x] |= fresh;
                    if (side.inside) to.inside[x] |= fresh;
                }
                if (!waits && any(to.front)) wave.push_back(i);
            }
        }
    }

    void signSteep(LeafState& state) {
        const WindingSteepLeaf leaf(query_, *state.leaf);
        for (std::uint64_t& word : state.known) word = ~std::uint64_t(0);
        state.inside = leaf.inside();
        state.firm = leaf.fartherThan(reserve);
    }

    // Voxels near the surface take the sign of a neighbour that no surface can separate from them. The few others are
    // evaluated.
    void signNear() {
        for (int pass = 0; pass < 2; ++pass) {
            std::vector<BlockMask> firm(leaves_.size());
            for (std::size_t i = 0; i < leaves_.size(); ++i) {
                firm[i] = leaves_[i].firm;
                for (unsigned voxel = 0; leaves_[i].calm() && voxel < blockVoxels; ++voxel)
                    if (!test(leaves_[i].known, voxel)) copyNear(leaves_[i], voxel, firm[i]);
            }
            for (std::size_t i = 0; i < leaves_.size(); ++i) leaves_[i].firm = firm[i];
        }
        for (LeafState& state : leaves_)
            for (unsigned voxel = 0; voxel < blockVoxels; ++voxel)
                if (!test(state.known, voxel)) decide(state, voxel);
    }

    bool copyNear(LeafState& state, unsigned voxel, BlockMask& firm) {
        const openvdb::Coord here = state.leaf->offsetToGlobalCoord(voxel);
        const double h = query_.voxelSize, distance = double(state.leaf->buffer().data()[voxel]);
        for (int link = 0; link < 27; ++link) {
            const openvdb::Coord step(link / 9 - 1, link / 3 % 3 - 1, link % 3 - 1), there = here + step;
            const int neighbour = link == 13 ? -1 : brick_.leafAt(there);
            if (neighbour < 0) continue;
            const LeafState& other = leaves_[std::size_t(neighbour)];
            const unsigned at = BandLeaf::coordToOffset(there);
            if (!test(other.firm, at)) continue;
            const double length = std::sqrt(double(step.x() * step.x() + step.y() * step.y() + step.z() * step.z())) +
                                  double(distanceSlack);
            if (distance + double(other.leaf->buffer().data()[at]) <= length * h) continue;
            set(state.known, voxel);
            set(firm, voxel);
            if (test(other.inside, at)) set(state.inside, voxel);
            return true;
        }
        return false;
    }

    const WindingQuery& query_;
    const WindingBrick& brick_;
    std::vector<LeafState> leaves_;
};

}  // namespace

void signLeaves(const WindingQuery& query, const WindingBrick& brick, const BandWidths& widths) {
    LeafSigns(query, brick).sign(widths);
}

}  // namespace bilayer::detail
