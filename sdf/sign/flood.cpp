// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/flood.h"

#include <fmt/format.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>

#include <atomic>
#include <cmath>
#include <span>
#include <stdexcept>

#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/bvh/winding_number.h"
#include "sdf/mesh/topology.h"
#include "sdf/sign/octree_cells.h"

namespace bilayer::detail {
namespace {

/// Voxels closer than this are on the surface and belong to neither side [voxels].
constexpr float floodSurface = 1e-4f;
constexpr std::uint32_t infinity = 0;  // the part that contains all space beyond the cells

// Returns the connected components of a mask.
std::vector<BlockMask> components(BlockMask mask) {
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

enum class FloodSide : std::uint8_t { unknown, outside, inside };

class Flood {
  public:
    Flood(const OctreeCells& cells, const Mesh& mesh, float gap, float background, double voxelSize, Progress* progress)
        : cells_(cells),
          winding_(mesh, progress),
          gap_(gap),
          background_(background),
          h_(voxelSize),
          progress_(progress),
          states_(vectorOf<CellState>(cells.all().size(), progress)) {}

    // Finds the signs of all voxels in leaves, and of the cells between leaves.
    void run();
    const BlockMask& inside(std::size_t cell) const { return states_[cell].inside; }
    bool cellInside(std::size_t cell) const { return test(states_[cell].inside, 0); }

  private:
    struct CellState {
        std::vector<BlockMask> parts;  // of voxels where the ball's centre fits
        std::uint32_t first = 0;       // index of the first part
        BlockMask known{}, inside{};
        BlockMask fresh{};  // known since the last step
        BlockMask outsideNext{}, insideNext{};
        std::array<std::uint32_t, 27> around{};  // cells of the blocks around a leaf, beyond() if none
    };
    struct Neighbour {
        FloodSide side;
        bool fresh;      // since the last step
        float distance;  // [m]
    };

    void findParts();
    void joinParts();
    template <class Join>
    void joinAcross(std::size_t cell, int face, const Join& join) const;
    void sidesOfParts(DisjointSets& parts);
    template <class Passes>
    bool step(const Passes& passes);
    template <class Passes>
    void stepIn(std::size_t cell, const Passes& passes);
    Neighbour neighbour(const CellState& state, const openvdb::Coord& local) const;
    void settleRest();
    std::uint32_t beyond() const { return std::uint32_t(states_.size()); }

    const OctreeCells& cells_;
    const WindingNumber winding_;
    float gap_, background_;
    double h_;
    Progress* progress_;
    std::vector<CellState> states_;
};

void Flood::run() {
    findParts();
    joinParts();
    const auto certain = [this](std::size_t, unsigned, const openvdb::Coord& link, float a, float b) {
        const double length =
            std::sqrt(double(link.x() * link.x() + link.y() * link.y() + link.z() * link.z())) + double(distanceSlack);
        return double(a) + double(b) > length * h_;
    };
    while (step(certain)) {
    }
    // The remaining voxels are very close to the surface, so the triangles themselves are tested.
    for (CellState& state : states_) state.fresh = state.known;
    const auto clear = [this](std::size_t cell, unsigned voxel, const openvdb::Coord& link, float a, float b) {
        if (!(std::min(a, b) > floodSurface * float(h_))) return false;
        poll(progress_);
        const openvdb::Coord at = cells_.all()[cell].leaf->offsetToGlobalCoord(voxel), to = at + link;
        return !winding_.meets(glm::dvec3(at.x(), at.y(), at.z()) * h_, glm::dvec3(to.x(), to.y(), to.z()) * h_);
    };
    while (step(clear)) {
    }
    settleRest();
}

void Flood::findParts() {
    // Links between two voxels farther than this keep gap / 2 from the surface along their whole length.
    const float free = (0.5f * gap_ + 0.5f + distanceSlack) * float(h_);
    tbb::parallel_for(std::size_t(0), states_.size(), [&](std::size_t c) {
        const OctreeCell& cell = cells_.all()[c];
        CellState& state = states_[c];
        if (!cell.leaf) return;
        poll(progress_);
        state.parts = components(farther(*cell.leaf, free));
        for (int i = 0; i < 27; ++i) {
            const openvdb::Coord shift((i / 9 - 1) * blockSide, (i / 3 % 3 - 1) * blockSide, (i % 3 - 1) * blockSide);
            const std::size_t found = cells_.find(cell.origin + shift);
            state.around[std::size_t(i)] = found == OctreeCells::none ? beyond() : std::uint32_t(found);
        }
    });
}

// Calls `join` for pairs of parts that touch across a face of a cell.
template <class Join>
void Flood::joinAcross(std::size_t cell, int face, const Join& join) const {
    const OctreeCell& self = cells_.all()[cell];
    openvdb::Coord next = self.origin;
    next[face / 2] += face % 2 ? self.side : -1;
    const std::size_t found = cells_.find(next);
    const auto each = [&](std::size_t c, int axis, int side, const auto& use) {
        const CellState& s = states_[c];
        const BlockMask all{~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull};
        if (!cells_.all()[c].leaf) return use(s.first, across(all, axis, side));
        for (std::uint32_t p = 0; p < s.parts.size(); ++p) {
            const BlockMask touching = across(s.parts[p], axis, side);
            if (any(touching)) use(s.first + p, touching);
        }
    };
    if (found == OctreeCells::none)
        return each(cell, face / 2, face % 2, [&](std::uint32_t part, const BlockMask&) { join(infinity, part); });
    // The smaller of two cells handles the face; of equal cells, the lower one.
    const std::int32_t side = cells_.all()[found].side;
    if (side < self.side || (side == self.side && face % 2 == 0)) return;
    each(cell, face / 2, face % 2, [&](std::uint32_t a, const BlockMask& maskA) {
        if (!cells_.all()[found].leaf) return join(a, states_[found].first);
        for (std::uint32_t p = 0; p < states_[found].parts.size(); ++p)
            if (meet(maskA, states_[found].parts[p])) join(a, states_[found].first + p);
    });
}

void Flood::joinParts() {
    std::uint32_t count = infinity + 1;
    for (const std::size_t c : Polled(states_.size(), progress_)) {
        states_[c].first = count;
        count += cells_.all()[c].leaf ? std::uint32_t(states_[c].parts.size()) : 1;
    }
    tbb::enumerable_thread_specific<std::vector<std::pair<std::uint32_t, std::uint32_t>>> pairs;
    tbb::parallel_for(std::size_t(0), states_.size(), [&](std::size_t c) {
        poll(progress_);
        auto& mine = pairs.local();
        for (int face = 0; face < 6; ++face)
            joinAcross(c, face, [&](std::uint32_t a, std::uint32_t b) { mine.emplace_back(a, b); });
    });
    DisjointSets parts(count);
    for (const auto& some : pairs)
        for (const std::size_t i : Polled(some.size(), progress_)) parts.join(some[i].first, some[i].second);
    sidesOfParts(parts);
}

void Flood::sidesOfParts(DisjointSets& parts) {
    for (const std::size_t c : Polled(states_.size(), progress_)) {
        CellState& state = states_[c];
        if (!cells_.all()[c].leaf) {
            state.known.fill(~0ull);
            if (parts.root(state.first) != infinity) state.inside.fill(~0ull);
        }
        for (std::uint32_t p = 0; p < state.parts.size(); ++p)
            for (std::size_t x = 0; x < blockSide; ++x) {
                state.known[x] |= state.parts[p][x];
                if (parts.root(state.first + p) != infinity) state.inside[x] |= state.parts[p][x];
            }
        state.fresh = state.known;
    }
}

// Returns a voxel in or next to a leaf, by its coordinates relative to the leaf's first voxel.
Flood::Neighbour Flood::neighbour(const CellState& state, const openvdb::Coord& local) const {
    const int block = ((local.x() + blockSide) / blockSide * 3 + (local.y() + blockSide) / blockSide) * 3 +
                      (local.z() + blockSide) / blockSide;
    const std::uint32_t cell = state.around[std::size_t(block)];
    if (cell == beyond()) return {FloodSide::outside, true, background_};
    const CellState& other = states_[cell];
    const BandLeaf* leaf = cells_.all()[cell].leaf;
    const unsigned at = BandLeaf::coordToOffset(local);
    if (!leaf)
        return {test(other.inside, 0) ? FloodSide::inside : FloodSide::outside, test(other.fresh, 0), background_};
    if (!test(other.known, at)) return {FloodSide::unknown, false, 0};
    return {test(other.inside, at) ? FloodSide::inside : FloodSide::outside, test(other.fresh, at),
            leaf->buffer().data()[at]};
}

// Grows by one step from the voxels that the last step reached, over the links that `passes` accepts.
template <class Passes>
bool Flood::step(const Passes& passes) {
    tbb::parallel_for(std::size_t(0), states_.size(), [&](std::size_t c) {
        if (!cells_.all()[c].leaf) return;
        poll(progress_);
        stepIn(c, passes);
    });
    std::atomic<bool> grew = false;
    tbb::parallel_for(std::size_t(0), states_.size(), [&](std::size_t c) {
        CellState& state = states_[c];
        for (std::size_t x = 0; x < blockSide; ++x) {
            state.fresh[x] = state.outsideNext[x] | state.insideNext[x];
            state.known[x] |= state.fresh[x];
            state.inside[x] |= state.insideNext[x];
        }
        if (any(state.fresh)) grew = true;
    });
    return grew;
}

template <class Passes>
void Flood::stepIn(std::size_t cell, const Passes& passes) {
    CellState& state = states_[cell];
    state.outsideNext = state.insideNext = {};
    const float* distances = cells_.all()[cell].leaf->buffer().data();
    for (unsigned voxel = 0; voxel < blockVoxels; ++voxel) {
        if (test(state.known, voxel)) continue;
        const openvdb::Coord local(int(voxel / 64), int(voxel / 8 % 8), int(voxel % 8));
        FloodSide found = FloodSide::unknown;
        for (int i = 0; i < 27 && found != FloodSide::outside; ++i) {
            const openvdb::Coord link(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1);
            const Neighbour next = i == 13 ? Neighbour{FloodSide::unknown, false, 0} : neighbour(state, local + link);
            if (next.side == FloodSide::unknown || !next.fresh || next.side == found) continue;
            if (passes(cell, voxel, link, distances[voxel], next.distance)) found = next.side;
        }
        if (found == FloodSide::outside) set(state.outsideNext, voxel);
        if (found == FloodSide::inside) set(state.insideNext, voxel);
    }
}

// Voxels that neither side reached are enclosed and inside, unless they lie on the surface.
void Flood::settleRest() {
    tbb::parallel_for(std::size_t(0), states_.size(), [&](std::size_t c) {
        if (!cells_.all()[c].leaf) return;
        const BlockMask off = farther(*cells_.all()[c].leaf, floodSurface * float(h_));
        for (std::size_t x = 0; x < blockSide; ++x) states_[c].inside[x] |= off[x] & ~states_[c].known[x];
    });
}

}  // namespace

void signByFlood(openvdb::FloatGrid& grid, const Mesh& mesh, float gap, const BandWidths& widths, Progress* progress) {
    const float reach = 0.5f * gap + 1;
    if (!(gap >= 0)) throw std::invalid_argument(fmt::format("gapVoxels must be at least 0, not {}", gap));
    if (grid.background() < (reach - distanceSlack) * widths.voxelSize)
        throw std::invalid_argument(fmt::format("gapVoxels {} needs distances up to {} voxels", gap, reach));
    validate(mesh);
    const float background = grid.background();
    const std::vector<BandLeaf*> leaves = leavesOf(grid);
    std::vector<openvdb::CoordBBox> inside;
    if (!leaves.empty()) {
        const OctreeCells cells(leaves, {}, progress);
        Flood flood(cells, mesh, gap, background, double(widths.voxelSize), progress);
        flood.run();
        tbb::parallel_for(std::size_t(0), cells.all().size(), [&](std::size_t c) {
            if (BandLeaf* leaf = cells.all()[c].leaf) signLeaf(*leaf, flood.inside(c), widths);
        });
        for (std::size_t c = 0; c < cells.all().size(); ++c) {
            const OctreeCell& cell = cells.all()[c];
            if (!cell.leaf && flood.cellInside(c))
                inside.push_back(openvdb::CoordBBox::createCube(cell.origin, cell.side));
        }
    }
    assemble(grid, inside, widths, progress);
}

}  // namespace bilayer::detail
