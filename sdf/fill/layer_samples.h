// SPDX-License-Identifier: Apache-2.0
// The samples of the double layer method in one brick. They are sorted by spatial cell and stored as columns for SIMD.
// Tested by tests/sdf/double_layer.cpp.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>

namespace bilayer::detail {

/// The brick for which samples are generated, with its options.
struct SampledBrick {
    glm::ivec3 origin;  ///< index coordinates of the first voxel
    int side;           ///< [voxels]
    float reach;        ///< samples farther than this from the brick are discarded [voxels]
    double voxelsPerUnit;
    const DoubleLayerOptions& options;
};

/// Samples as a structure of arrays. One SIMD vector beyond the last sample may be read and written.
struct SampleColumns {
    std::array<std::vector<float>, 3> place;   ///< [brick voxels]
    std::array<std::vector<float>, 3> offset;  ///< outer layer point minus sample; negated for the inner layer [voxels]
    std::vector<std::int32_t> triangle;        ///< source triangle

    /// Ensures capacity for `count` samples; never shrinks.
    void reserve(std::size_t count);
};

/// Samples in triangle order.
struct AddedSamples {
    SampleColumns columns;
    std::vector<std::int32_t> cell;
    std::size_t count = 0;

    /// Ensures capacity for `size` samples.
    void reserve(std::size_t size) {
        columns.reserve(size);
        if (cell.size() < columns.triangle.size()) cell.resize(columns.triangle.size());
    }
};

/// The cells of a brick.
struct SampleCells {
    int around = 1;                ///< layers of cells around the brick, and around a queried cell
    int size = 1;                  ///< cells along each axis
    float firstCorner = 0;         ///< minimum corner of all cells, on each axis
    glm::vec3 lower{0}, upper{0};  ///< bounds of all samples that can contribute
};

/// The samples of a brick. Reuses its memory for each brick.
class LayerSamples {
  public:
    /// Side of a cell [voxels]. Cell (0, 0, 0) covers the first voxels of the brick and half a voxel around them.
    static constexpr int cellSide = 4;

    /// Returns the count of cells around a brick, on each side, that hold samples within reach [voxels].
    static int cellsAround(float reach) { return 1 + int(std::floor((reach - 0.4f) / float(cellSide))); }

    /// Returns the lattice point nearest to a position. Halves round up, independent of rounding errors.
    static glm::vec3 nearestLattice(const glm::vec3& place) { return glm::floor(place + 0.5001f); }

    /// Starts a brick.
    void begin(const SampledBrick& brick);

    /// Adds the samples of triangles.
    void add(const Mesh& mesh, std::span<const std::uint32_t> triangles);

    /// Sorts the samples. Call it after the last triangle.
    void finish();

    std::size_t count() const { return added_.count; }
    const SampleColumns& columns() const { return sorted_; }

    /// Samples `begin` to `end` - 1.
    struct SampleRange {
        std::uint32_t begin, end;
    };

    /// Returns ranges with all samples that may reach a cube of cells, and possibly others.
    /// @param cells   count along each axis
    /// @param memory  storage for the result
    std::span<const SampleRange> near(const glm::ivec3& first, int cells, std::vector<SampleRange>& memory) const {
        const int along = cells + 2 * cells_.around;
        if (memory.size() < std::size_t(along * along)) memory.resize(std::size_t(along * along));
        std::size_t count = 0;
        for (int x = first.x; x < first.x + along; ++x)
            for (int y = first.y; y < first.y + along; ++y) {
                // The range is always written, and counted only if it is not empty. A branch would be mispredicted half
                // of the time.
                const std::uint32_t* row = begins_.data() + (x * cells_.size + y) * cells_.size + first.z;
                memory[count] = {row[0], row[along]};
                count += row[0] < row[along];
            }
        return {memory.data(), count};
    }

  private:
    std::optional<SampledBrick> brick_;
    SampleCells cells_;
    AddedSamples added_;
    std::vector<std::uint32_t> begins_;
    SampleColumns sorted_;
};

}  // namespace bilayer::detail
