// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/flood.h"

#include <fmt/format.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>

#include <stdexcept>
#include <utility>
#include <vector>

#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/bvh/winding_number.h"
#include "sdf/mesh/topology.h"
#include "sdf/sign/flood_growth.h"
#include "sdf/sign/octree_cells.h"

namespace bilayer::detail {
namespace {

constexpr std::uint32_t infinity = 0;  // the part that contains all space beyond the cells

/// Finds the sides of all voxels in leaves, and of the cells between leaves.
class Flood {
  public:
    Flood(const OctreeCells& cells, const Mesh& mesh, float gapVoxels, float background, float voxelSize,
          Progress* progress)
        : cells_(cells),
          mesh_(mesh),
          free_(freeDistance(gapVoxels, voxelSize)),
          background_(background),
          voxelSize_(voxelSize),
          progress_(progress),
          parts_(vectorOf<CellParts>(cells.all().size(), progress)) {}

    void run();
    const BlockMask& inside(std::size_t cell) const { return leaves_[numbers_[cell]].inside; }
    bool cellInside(std::size_t cell) const { return numbers_[cell] == FloodLeaf::insideSpace; }

  private:
    struct CellParts {
        std::vector<BlockMask> masks;  // of voxels where the ball's centre fits
        std::uint32_t first = 0;       // index of the first part
    };

    void findParts();
    DisjointSets joinParts();
    template <class Join>
    void joinAcross(std::size_t cell, int face, const Join& join) const;
    void makeLeaves(DisjointSets& parts);
    void findNeighbours();

    const OctreeCells& cells_;
    const Mesh& mesh_;
    float free_, background_, voxelSize_;  // [m]
    Progress* progress_;
    std::vector<CellParts> parts_;
    std::vector<std::uint32_t> numbers_;  // of the cells: a leaf, or a side of space
    std::vector<FloodLeaf> leaves_;
};

void Flood::run() {
    const WindingNumber triangles(mesh_, progress_);
    findParts();
    DisjointSets parts = joinParts();
    makeLeaves(parts);
    findNeighbours();
    FloodGrowth growth(leaves_, leaves_.size(), background_, voxelSize_, progress_);
    growth.growByDistance();
    // The remaining voxels are very close to the surface, so the triangles themselves are tested.
    growth.growByTriangles(triangles);
    growth.settle();
}

void Flood::findParts() {
    tbb::parallel_for(std::size_t(0), parts_.size(), [&](std::size_t c) {
        const OctreeCell& cell = cells_.all()[c];
        if (!cell.leaf) return;
        poll(progress_);
        parts_[c].masks = freeParts(cell.leaf->buffer().data(), free_);
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
        const CellParts& parts = parts_[c];
        const BlockMask all{~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull};
        if (!cells_.all()[c].leaf) return use(parts.first, across(all, axis, side));
        for (std::uint32_t p = 0; p < parts.masks.size(); ++p) {
            const BlockMask touching = across(parts.masks[p], axis, side);
            if (any(touching)) use(parts.first + p, touching);
        }
    };
    if (found == OctreeCells::none)
        return each(cell, face / 2, face % 2, [&](std::uint32_t part, const BlockMask&) { join(infinity, part); });
    // The smaller of two cells handles the face; of equal cells, the lower one.
    const std::int32_t side = cells_.all()[found].side;
    if (side < self.side || (side == self.side && face % 2 == 0)) return;
    each(cell, face / 2, face % 2, [&](std::uint32_t a, const BlockMask& maskA) {
        if (!cells_.all()[found].leaf) return join(a, parts_[found].first);
        for (std::uint32_t p = 0; p < parts_[found].masks.size(); ++p)
            if (meet(maskA, parts_[found].masks[p])) join(a, parts_[found].first + p);
    });
}

DisjointSets Flood::joinParts() {
    std::uint32_t count = infinity + 1;
    for (const std::size_t c : Polled(parts_.size(), progress_)) {
        parts_[c].first = count;
        count += cells_.all()[c].leaf ? std::uint32_t(parts_[c].masks.size()) : 1;
    }
    tbb::enumerable_thread_specific<std::vector<std::pair<std::uint32_t, std::uint32_t>>> pairs;
    tbb::parallel_for(std::size_t(0), parts_.size(), [&](std::size_t c) {
        poll(progress_);
        auto& mine = pairs.local();
        for (int face = 0; face < 6; ++face)
            joinAcross(c, face, [&](std::uint32_t a, std::uint32_t b) { mine.emplace_back(a, b); });
    });
    DisjointSets parts(count);
    for (const auto& some : pairs)
        for (const std::size_t i : Polled(some.size(), progress_)) parts.join(some[i].first, some[i].second);
    return parts;
}

// Space and voxels where the ball fits have the sides of their parts.
void Flood::makeLeaves(DisjointSets& parts) {
    numbers_.reserve(parts_.size());
    for (const std::size_t c : Polled(parts_.size(), progress_)) {
        CellParts& own = parts_[c];
        const auto isInside = [&](std::uint32_t part) { return parts.root(part) != infinity; };
        const BandLeaf* leaf = cells_.all()[c].leaf;
        if (!leaf) {
            numbers_.push_back(isInside(own.first) ? FloodLeaf::insideSpace : FloodLeaf::outsideSpace);
            continue;
        }
        numbers_.push_back(std::uint32_t(leaves_.size()));
        FloodLeaf& made = leaves_.emplace_back();
        made.origin = leaf->origin();
        made.distances = leaf->buffer().data();
        for (std::uint32_t p = 0; p < own.masks.size(); ++p)
            for (std::size_t x = 0; x < blockSide; ++x) {
                made.known[x] |= own.masks[p][x];
                if (isInside(own.first + p)) made.inside[x] |= own.masks[p][x];
            }
        own.masks = {};
    }
}

void Flood::findNeighbours() {
    tbb::parallel_for(std::size_t(0), leaves_.size(), [&](std::size_t i) {
        poll(progress_);
        FloodLeaf& leaf = leaves_[i];
        for (int n = 0; n < 27; ++n) {
            const openvdb::Coord shift((n / 9 - 1) * blockSide, (n / 3 % 3 - 1) * blockSide, (n % 3 - 1) * blockSide);
            const std::size_t found = cells_.find(leaf.origin + shift);
            leaf.around[std::size_t(n)] = found == OctreeCells::none ? FloodLeaf::outsideSpace : numbers_[found];
        }
    });
}

}  // namespace

void signByFlood(openvdb::FloatGrid& grid, const Mesh& mesh, float gapVoxels, const BandWidths& widths,
                 Progress* progress) {
    const float reach = 0.5f * gapVoxels + 1;
    if (!(gapVoxels >= 0)) throw std::invalid_argument(fmt::format("gapVoxels must be at least 0, not {}", gapVoxels));
    if (grid.background() < (reach - distanceSlack) * widths.voxelSize)
        throw std::invalid_argument(fmt::format("gapVoxels {} needs distances up to {} voxels", gapVoxels, reach));
    validate(mesh);
    const float background = grid.background();
    const std::vector<BandLeaf*> leaves = leavesOf(grid);
    std::vector<openvdb::CoordBBox> inside;
    if (!leaves.empty()) {
        const OctreeCells cells(leaves, {}, progress);
        Flood flood(cells, mesh, gapVoxels, background, widths.voxelSize, progress);
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
