// SPDX-License-Identifier: Apache-2.0
// Where columns of voxels along z cross the triangles of a mesh, sorted by the leaves of a narrow band. Sums of
// crossings from below are winding numbers, exactly, if the mesh is closed.
// Tested by tests/sdf/sign_repair.cpp through build().
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/sign/column_sums.h"
#include "sdf/sign/octree_cells.h"

namespace bilayer::detail {

class Progress;

inline constexpr std::size_t columnsPerLeaf = blockSide * blockSide;

/// A crossing of a column and a triangle.
struct ColumnCrossing {
    std::int32_t above;   ///< the first voxel above it
    std::uint8_t column;  ///< index in its tile
    std::int8_t sign;     ///< +1: the solid begins there, going up; -1: it ends
};

/// The crossings of the columns of all leaves, tile by tile. A tile is the columns of a leaf and of all leaves above
/// and below it.
class ColumnCrossings {
  public:
    /// The crossings of one tile; to be used for one tile after another.
    struct OfTile {
        std::vector<ColumnCrossing> found, sorted;
        std::vector<std::size_t> begins;
    };

    /// Keeps a reference to the mesh.
    /// @param everyFifthColumn  whether to find the crossings of one column in five only, evenly distributed
    /// @param progress          polled, unless null
    /// @param lowest            crossings below this voxel are left out
    ColumnCrossings(const std::vector<BandLeaf*>& leaves, const Mesh& mesh, double voxelSize, bool everyFifthColumn,
                    Progress* progress, std::int32_t lowest = std::numeric_limits<std::int32_t>::min());

    std::size_t tiles() const { return tiles_.size(); }

    /// Calls visit(leaf, crossings, columns) for the leaves of a tile from bottom to top: with the crossings between
    /// the last leaf's top and this one's, and the columns they were searched for, one bit each.
    template <class Visit>
    void forEachLeaf(std::size_t tile, OfTile& crossings, const Visit& visit) const {
        const std::uint64_t columns = find(tile, crossings);
        for (std::size_t i = leavesOfTile_[tile]; i < leavesOfTile_[tile + 1]; ++i) {
            const std::size_t k = i - leavesOfTile_[tile], begin = crossings.begins[k];
            visit(*leaves_[i].leaf, std::span(crossings.sorted).subspan(begin, crossings.begins[k + 1] - begin),
                  columns);
        }
    }

  private:
    /// The x and y of a tile, encoded for sorting.
    using Tile = std::uint64_t;

    struct LeafInTile {
        Tile tile;
        BandLeaf* leaf;
        std::int64_t bottom() const { return leaf->origin().z(); }
        bool operator<(const LeafInTile& other) const {
            return tile != other.tile ? tile < other.tile : bottom() < other.bottom();
        }
    };

    struct TriangleInTile {
        std::uint32_t tile;  ///< index among the tiles with leaves
        std::uint32_t triangle;
    };

    static Tile tileAt(std::int64_t x, std::int64_t y);
    static void sortByLeaf(std::span<const LeafInTile> leaves, OfTile& crossings);
    void gatherLeaves(const std::vector<BandLeaf*>& leaves);
    void gatherTriangles();
    void addTriangle(std::uint32_t triangle, std::vector<TriangleInTile>& found) const;
    std::uint64_t find(std::size_t tile, OfTile& crossings) const;
    void addCrossings(std::uint32_t triangle, const openvdb::Coord& origin, std::uint64_t asked,
                      std::vector<ColumnCrossing>& crossings) const;
    glm::dvec3 corner(std::uint32_t triangle, int k) const {
        return glm::dvec3(mesh_.points[mesh_.triangles[triangle][k]]) * voxelsPerUnit_;
    }

    const Mesh& mesh_;
    const bool everyFifthColumn_;
    const double voxelsPerUnit_;
    Progress* progress_;
    std::int32_t lowest_;
    std::vector<LeafInTile> leaves_;            ///< by tile, then from bottom to top
    std::vector<Tile> tiles_;                   ///< those with leaves
    std::vector<std::size_t> leavesOfTile_;     ///< start of each tile's leaves
    std::vector<std::uint32_t> triangles_;      ///< by tile, possibly repeated
    std::vector<std::size_t> trianglesOfTile_;  ///< start of each tile's triangles
};

/// The winding numbers along the columns of a tile, from bottom to top.
class ColumnNumbers {
  public:
    ColumnNumbers() = default;
    /// @param below  of columns that do not begin at zero
    /// @param first  the tile's first column
    ColumnNumbers(const ColumnSums& below, const openvdb::Coord& first) {
        for (std::size_t column = 0; column < columnsPerLeaf; ++column)
            winding_[column] = below.at(first.x() + int(column / blockSide), first.y() + int(column % blockSide));
    }

    /// Enters the next leaf of the tile. Returns the columns that are crossed in it or below it, one bit each.
    std::uint64_t enter(const BandLeaf& leaf, std::span<const ColumnCrossing> crossings) {
        std::uint64_t crossed = 0;
        for (const ColumnCrossing& crossing : crossings) {
            const std::int32_t k = std::max(crossing.above - leaf.origin().z(), 0);
            changes_[std::size_t(crossing.column * blockSide + k)] += crossing.sign;
            crossed |= std::uint64_t(1) << crossing.column;
        }
        return crossed;
    }

    /// Returns the winding number of a column below the leaf. A column that is not crossed has it in the whole leaf.
    std::int32_t below(std::size_t column) const { return winding_[column]; }

    /// Advances a column to the leaf's top, and calls visit(k, number) for each of its voxels. Call it once for each
    /// column that is crossed; others may be advanced too.
    template <class Visit>
    void climb(std::size_t column, const Visit& visit) {
        std::int32_t& winding = winding_[column];
        for (std::size_t k = 0; k < blockSide; ++k)
            visit(int(k), winding += std::exchange(changes_[column * blockSide + k], 0));
    }

  private:
    std::array<std::int32_t, columnsPerLeaf> winding_{};
    std::array<std::int32_t, columnsPerLeaf * blockSide> changes_{};  ///< at the voxels of one leaf
};

}  // namespace bilayer::detail
