// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/flood_growth.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "sdf/base/progress.h"
#include "sdf/sign/octree_cells.h"

namespace bilayer::detail {
namespace {

/// Voxels closer than this are on the surface and belong to neither side [voxels].
constexpr float floodSurface = 1e-4f;

enum class FloodSide : std::uint8_t { unknown, outside, inside };

void reach(FloodLeaf& leaf, unsigned voxel, bool inside) {
    set(leaf.known, voxel);
    set(leaf.fresh, voxel);
    leaf.isFresh = true;
    if (inside) set(leaf.inside, voxel);
}

void record(FloodLeaf& leaf, std::uint32_t number, std::uint32_t step) {
    for (unsigned voxel = 0; voxel < blockVoxels; ++voxel)
        if (test(leaf.fresh, voxel) && test(leaf.watched, voxel))
            leaf.arrivals.push_back({number, step, std::uint16_t(voxel), test(leaf.inside, voxel)});
}

}  // namespace

float freeDistance(float gapVoxels, float voxelSize) {
    return (0.5f * gapVoxels + 0.5f + distanceSlack) * voxelSize;
}

std::vector<BlockMask> freeParts(const float* distances, float free) {
    BlockMask mask = farther(distances, free);
    std::vector<BlockMask> parts;
    for (unsigned voxel = 0; voxel < blockVoxels; ++voxel) {
        if (!test(mask, voxel)) continue;
        BlockMask part{}, next{};
        set(next, voxel);
        while (next != part) {
            part = next;
            next = grown(part);
            for (std::size_t x = 0; x < blockSide; ++x) next[x] &= mask[x];
        }
        for (std::size_t x = 0; x < blockSide; ++x) mask[x] &= ~part[x];
        parts.push_back(part);
    }
    return parts;
}

bool meet(const BlockMask& a, const BlockMask& b) {
    std::uint64_t bits = 0;
    for (std::size_t x = 0; x < blockSide; ++x) bits |= a[x] & b[x];
    return bits != 0;
}

struct FloodGrowth::Neighbour {
    FloodSide side;
    bool fresh;      // since the last step
    float distance;  // [m]
};

void FloodGrowth::growByDistance(std::vector<FloodArrival> given) {
    const double h = double(voxelSize_);
    const auto certain = [h](const FloodLeaf&, unsigned, const openvdb::Coord& link, float a, float b) {
        const double length =
            std::sqrt(double(link.x() * link.x() + link.y() * link.y() + link.z() * link.z())) + double(distanceSlack);
        return double(a) + double(b) > length * h;
    };
    grow(certain, std::move(given));
}

void FloodGrowth::growByTriangles(const WindingNumber& triangles, std::vector<FloodArrival> given) {
    const double h = double(voxelSize_);
    const float surface = floodSurface * voxelSize_;
    const auto clear = [&](const FloodLeaf& leaf, unsigned voxel, const openvdb::Coord& link, float a, float b) {
        if (!(std::min(a, b) > surface)) return false;
        poll(progress_);
        const openvdb::Coord at = leaf.origin + BandLeaf::offsetToLocalCoord(voxel), to = at + link;
        return !triangles.meets(glm::dvec3(at.x(), at.y(), at.z()) * h, glm::dvec3(to.x(), to.y(), to.z()) * h);
    };
    grow(clear, std::move(given));
}

template <class Passes>
void FloodGrowth::grow(const Passes& passes, std::vector<FloodArrival> given) {
    for (FloodLeaf& leaf : leaves_) {
        leaf.fresh = leaf.known;
        leaf.isFresh = any(leaf.fresh);
        leaf.arrivals.clear();
    }
    std::sort(given.begin(), given.end(), [](const auto& a, const auto& b) { return a.step < b.step; });
    auto next = given.cbegin();
    for (std::uint32_t number = 1;; ++number) {
        tbb::parallel_for(std::size_t(0), own_, [&](std::size_t leaf) {
            poll(progress_);
            findNext(leaf, number == 1, passes);
        });
        bool grew = step(number);
        for (; next != given.cend() && next->step == number; ++next) {
            reach(leaves_[next->leaf], next->voxel, next->inside);
            grew = true;
        }
        if (grew) continue;
        if (next == given.cend()) return;
        number = next->step - 1;
    }
}

// Returns whether the last step reached a voxel in or next to a leaf.
bool FloodGrowth::mayGrow(const FloodLeaf& leaf, bool first) const {
    return first || std::any_of(leaf.around.begin(), leaf.around.end(), [this](std::uint32_t number) {
               return number < leaves_.size() && leaves_[number].isFresh;
           });
}

// Returns a voxel in or next to a leaf, by its coordinates relative to the leaf's first voxel. Space is fresh in the
// first step.
FloodGrowth::Neighbour FloodGrowth::neighbour(const FloodLeaf& leaf, const openvdb::Coord& local, bool first) const {
    const int block = ((local.x() + blockSide) / blockSide * 3 + (local.y() + blockSide) / blockSide) * 3 +
                      (local.z() + blockSide) / blockSide;
    const std::uint32_t number = leaf.around[std::size_t(block)];
    if (number == FloodLeaf::outsideSpace) return {FloodSide::outside, first, background_};
    if (number == FloodLeaf::insideSpace) return {FloodSide::inside, first, background_};
    const FloodLeaf& other = leaves_[number];
    const unsigned at = BandLeaf::coordToOffset(local);
    if (!test(other.known, at)) return {FloodSide::unknown, false, 0};
    return {test(other.inside, at) ? FloodSide::inside : FloodSide::outside, test(other.fresh, at),
            other.distances[at]};
}

// Finds the voxels that are next to those which the last step reached, over the links that `passes` accepts.
template <class Passes>
void FloodGrowth::findNext(std::size_t number, bool first, const Passes& passes) {
    FloodLeaf& leaf = leaves_[number];
    leaf.outsideNext = leaf.insideNext = {};
    if (!mayGrow(leaf, first)) return;
    for (unsigned voxel = 0; voxel < blockVoxels; ++voxel) {
        if (test(leaf.known, voxel)) continue;
        const openvdb::Coord local(int(voxel / 64), int(voxel / 8 % 8), int(voxel % 8));
        FloodSide found = FloodSide::unknown;
        for (int i = 0; i < 27 && found != FloodSide::outside; ++i) {
            if (i == 13) continue;
            const openvdb::Coord link(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1);
            const Neighbour next = neighbour(leaf, local + link, first);
            if (next.side == FloodSide::unknown || !next.fresh || next.side == found) continue;
            if (passes(leaf, voxel, link, leaf.distances[voxel], next.distance)) found = next.side;
        }
        if (found == FloodSide::outside) set(leaf.outsideNext, voxel);
        if (found == FloodSide::inside) set(leaf.insideNext, voxel);
    }
}

// Returns whether any leaf has grown.
bool FloodGrowth::step(std::uint32_t number) {
    std::atomic<bool> grew = false;
    tbb::parallel_for(std::size_t(0), leaves_.size(), [&](std::size_t i) {
        FloodLeaf& leaf = leaves_[i];
        for (std::size_t x = 0; x < blockSide; ++x) {
            leaf.fresh[x] = leaf.outsideNext[x] | leaf.insideNext[x];
            leaf.known[x] |= leaf.fresh[x];
            leaf.inside[x] |= leaf.insideNext[x];
        }
        leaf.isFresh = any(leaf.fresh);
        if (!leaf.isFresh) return;
        grew = true;
        if (any(leaf.watched)) record(leaf, std::uint32_t(i), number);
    });
    return grew;
}

void FloodGrowth::settle() {
    tbb::parallel_for(std::size_t(0), leaves_.size(), [&](std::size_t i) {
        FloodLeaf& leaf = leaves_[i];
        const BlockMask off = farther(leaf.distances, floodSurface * voxelSize_);
        for (std::size_t x = 0; x < blockSide; ++x) leaf.inside[x] |= off[x] & ~leaf.known[x];
    });
}

}  // namespace bilayer::detail
