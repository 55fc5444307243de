// The samples of the double layer method in one brick: tiles spread out into runs, runs gathered into groups that a block
// can look at or leave out as a whole.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "sdf/tiles.h"

namespace bilayer {

/// Samples of one tile. They lie in a plane, and their inner and outer samples are the same offset away from all of
/// them. So for a voxel p with squared distance A to the nearest of them and height h over the plane, the nearest inner
/// and outer samples are at squared distances A + delta^2 + 2 delta h and A + delta^2 - 2 delta h.
struct LayerRun {
    glm::vec3 twiceOffset;     ///< 2 delta times the outward normal [voxels]
    std::int32_t triangle;     ///< owner
    std::uint32_t begin, end;  ///< its samples, at least one
};

/// Runs that lie together.
struct LayerGroup {
    glm::vec3 sample;  ///< the middle of all samples, in the voxels of the brick
    /// No sample is farther from the middle, no inner or outer sample from the middle less or plus `offset` [voxels].
    float radius;
    glm::vec3 normal;          ///< of a plane through the middle
    float thickness;           ///< no sample is farther from that plane [voxels]
    glm::vec3 offset;          ///< mean of the runs' offsets [voxels]
    std::uint32_t begin, end;  ///< its runs; the first one is near the middle
};

/// The samples of a brick. Memory is used again from brick to brick.
class LayerSamples {
  public:
    /// Begins with a brick.
    /// @param origin  index coordinates of its first voxel
    /// @param side    [voxels]
    /// @param reach   samples farther than this from the brick are left out [voxels]
    /// @param cells   whether the lattice point nearest to each sample is asked for
    void begin(const glm::ivec3& origin, int side, float reach, bool cells);

    /// Adds the samples of a tile.
    void add(const Tile& tile, std::int32_t triangle);

    /// Gathers runs into groups; call it after the last tile.
    void finish();

    std::span<const LayerGroup> groups() const { return groups_; }
    std::span<const LayerRun> runs() const { return runs_; }
    std::span<const glm::vec3> places() const { return places_; }  ///< of all samples, in the voxels of the brick
    std::span<const glm::vec3> cells() const { return cells_; }    ///< the lattice points nearest to them, if asked for

  private:
    void addPart(const Tile& tile, std::int32_t triangle, int firstRow, int firstColumn);
    void groupRuns();
    void sortByCell(const glm::vec3& lower, const glm::ivec3& size);
    void addCluster(std::uint32_t begin, std::uint32_t end);

    glm::ivec3 origin_{0};
    glm::vec3 lower_{0}, upper_{0};  // of all places that can matter
    bool wantCells_ = false;
    double sizes_ = 0;  // of all runs together [voxels]
    std::vector<LayerGroup> groups_;
    std::vector<LayerRun> runs_, unsorted_;
    std::vector<glm::vec3> places_, cells_;
    std::vector<std::uint32_t> cellOf_, cursors_;
};

}  // namespace bilayer
