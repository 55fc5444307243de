// The samples of the double layer method in one brick: triangles spread out into samples, sorted by cells of space, in
// columns that SIMD instructions read many of at once.
#pragma once

#include <array>
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

/// What samples are made for.
struct SampledBrick {
    glm::ivec3 origin;  ///< index coordinates of its first voxel
    int side;           ///< [voxels]
    float reach;        ///< samples farther than this from the brick are left out [voxels]
    double voxelsPerUnit;
    const DoubleLayerOptions& options;
};

/// Samples in columns. As many numbers may be read, and written, beyond the last as a SIMD vector holds.
struct SampleColumns {
    std::array<std::vector<float>, 3> place;   ///< in the voxels of the brick
    std::array<std::vector<float>, 3> offset;  ///< of the outer layer from it, minus that of the inner layer [voxels]
    std::vector<std::int32_t> triangle;        ///< owner

    /// Makes room for so many; memory only grows.
    void reserve(std::size_t count);
};

/// Samples in the order of their triangles.
struct AddedSamples {
    SampleColumns columns;
    std::vector<std::int32_t> cell;
    std::size_t count = 0;

    /// Makes room for so many.
    void reserve(std::size_t size) {
        columns.reserve(size);
        if (cell.size() < columns.triangle.size()) cell.resize(columns.triangle.size());
    }
};

/// The cells of a brick.
struct SampleCells {
    int around = 1;                ///< cells beyond the brick, and around a cell that it looks at
    int size = 1;                  ///< cells along each axis
    float firstCorner = 0;         ///< of all cells, on each axis
    glm::vec3 lower{0}, upper{0};  ///< of all places that can matter
};

/// The samples of a brick. Memory is used again from brick to brick.
class LayerSamples {
  public:
    /// Side of a cell [voxels]. Cell (0, 0, 0) is around the first voxels of the brick, half a voxel beyond them.
    static constexpr int cellSide = 4;

    /// The lattice point nearest to a place. Halves go up, whatever the rounding.
    static glm::vec3 nearestLattice(const glm::vec3& place) { return glm::floor(place + 0.5001f); }

    /// Begins with a brick.
    void begin(const SampledBrick& brick);

    /// Adds the samples of triangles.
    void add(const Mesh& mesh, std::span<const std::uint32_t> triangles);

    /// Sorts the samples; call it after the last triangle.
    void finish();

    std::size_t count() const { return added_.count; }
    const SampleColumns& columns() const { return sorted_; }

    /// Samples `begin` to `end` - 1.
    struct Range {
        std::uint32_t begin, end;
    };

    /// Tells which samples may reach some cells, and perhaps others.
    /// @param cells   along each axis
    /// @param memory  that of the result
    std::span<const Range> near(const glm::ivec3& first, int cells, std::vector<Range>& memory) const {
        const int along = cells + 2 * cells_.around;
        if (memory.size() < std::size_t(along * along)) memory.resize(std::size_t(along * along));
        std::size_t count = 0;
        for (int x = first.x; x < first.x + along; ++x)
            for (int y = first.y; y < first.y + along; ++y) {
                // written in any case and kept if it holds some: a branch would be guessed wrong half of the time
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
