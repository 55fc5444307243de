// SPDX-License-Identifier: Apache-2.0
// A sign is propagated between the centres of cells. Cells in which the number may cross one half are divided.
#include "sdf/sign/winding_cells.h"

#include <deque>

namespace bilayer::detail {
namespace {

class EmptyCellSigns {
  public:
    EmptyCellSigns(const WindingQuery& query, const WindingBrick& brick, std::vector<openvdb::CoordBBox>& insideBoxes)
        : query_(query), brick_(brick), insideBoxes_(insideBoxes) {
        for (const OctreeCell& cell : brick.cells())
            if (!cell.leaf)
                cells_.push_back({cell, query.slopeIn(query.centre(cell.origin, cell.side), cell.side), -1, false});
    }

    void sign() {
        for (std::size_t i = 0; i < cells_.size(); ++i)
            if (cells_[i].margin < 0) propagate(i);
        for (const EmptyCell& e : cells_) settle(e.cell.origin, e.cell.side, {e.inside, e.margin}, e.slope);
    }

  private:
    struct EmptyCell {
        OctreeCell cell;
        double slope;   // [1/voxel]
        double margin;  // at the centre; negative: unknown
        bool inside;
    };

    // Propagates the sign from the centre of a cell to its neighbours' centres, as long as the number certainly stays
    // on its side.
    void propagate(std::size_t seed) {
        const auto change = [](const EmptyCell& e) { return WindingQuery::changeInCube(e.cell.side, e.slope); };
        const WindingSide side = query_.around(query_.centre(cells_[seed].cell.origin, cells_[seed].cell.side));
        cells_[seed].margin = side.margin;
        cells_[seed].inside = side.inside;
        if (cells_.size() == 1) return;
        std::deque<std::size_t> queue{seed};
        while (!queue.empty()) {
            const EmptyCell from = cells_[queue.front()];
            queue.pop_front();
            const int blocks = from.cell.side / blockSide;
            for (int face = 0; face < 6; ++face)
                for (int i = 0; i < blocks * blocks; ++i) {
                    openvdb::Coord at = from.cell.origin;
                    at[face / 2] += face % 2 ? from.cell.side : -1;
                    at[(face / 2 + 1) % 3] += i / blocks * blockSide;
                    at[(face / 2 + 2) % 3] += i % blocks * blockSide;
                    const int neighbour = brick_.emptyAt(at);
                    if (neighbour < 0) continue;
                    EmptyCell& to = cells_[std::size_t(neighbour)];
                    const double margin = from.margin - change(from) - change(to);
                    if (to.margin >= 0 || !(margin > 0)) continue;
                    to.margin = margin;
                    to.inside = from.inside;
                    queue.push_back(std::size_t(neighbour));
                }
        }
    }

    // Gives a cell the sign of its centre, or divides it if the number may cross one half inside it.
    void settle(const openvdb::Coord& origin, std::int32_t side, const WindingSide& atCentre, double slope) {
        if (side == blockSide || atCentre.margin > WindingQuery::changeInCube(side, slope)) {
            if (atCentre.inside) insideBoxes_.push_back(openvdb::CoordBBox::createCube(origin, side));
            return;
        }
        for (int octant = 0; octant < 8; ++octant) {
            const std::int32_t half = side / 2;
            const openvdb::Coord corner =
                origin.offsetBy(octant & 1 ? half : 0, octant & 2 ? half : 0, octant & 4 ? half : 0);
            const glm::dvec3 centre = query_.centre(corner, half);
            settle(corner, half, query_.at(centre), query_.slopeIn(centre, half));
        }
    }

    const WindingQuery& query_;
    const WindingBrick& brick_;
    std::vector<openvdb::CoordBBox>& insideBoxes_;
    std::vector<EmptyCell> cells_;
};

}  // namespace

void signEmptyCells(const WindingQuery& query, const WindingBrick& brick,
                    std::vector<openvdb::CoordBBox>& insideBoxes) {
    EmptyCellSigns(query, brick, insideBoxes).sign();
}

}  // namespace bilayer::detail
