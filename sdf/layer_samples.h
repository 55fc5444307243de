// The samples of the double layer method in one brick: parts of triangles spread out into runs, runs gathered into
// groups that a block can look at or leave out as a whole.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "sdf/cell_sort.h"
#include "sdf/tile_cutter.h"

namespace bilayer {

/// Samples of one part of a triangle. They lie in a plane, and their inner and outer samples are the same offset away
/// from all of them. So for a voxel p with squared distance A to the nearest of them and height h over the plane, the
/// nearest inner and outer samples are at squared distances A + delta^2 + 2 delta h and A + delta^2 - 2 delta h.
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
    /// The lattice point nearest to a place. Halves go up, whatever the rounding.
    static glm::vec3 nearestLattice(const glm::vec3& place) { return glm::floor(place + 0.5001f); }

    /// Begins with a brick.
    /// @param origin  index coordinates of its first voxel
    /// @param side    [voxels]
    /// @param reach   samples farther than this from the brick are left out [voxels]
    /// @param delta   distance of each layer from the surface [voxels]
    /// @param cells   whether the lattice point nearest to each sample is asked for
    void begin(const glm::ivec3& origin, int side, float reach, float delta, bool cells);

    /// Adds the samples of a part of a triangle.
    [[gnu::always_inline]] void add(const TilePart& part, std::uint32_t triangle) {
        if (part.rows == 1 && !wantCells_)
            addOne(part, triangle);
        else
            addRows(part, triangle);
    }

    /// Gathers runs into groups; call it after the last tile.
    void finish();

    std::span<const LayerGroup> groups() const { return groups_; }
    std::span<const LayerRun> runs() const { return runs_; }
    std::span<const glm::vec3> places() const { return places_; }  ///< of all samples, in the voxels of the brick
    std::span<const glm::vec3> cells() const { return cells_; }    ///< the lattice points nearest to them, if asked for

  private:
    // Most parts of a fine mesh have one sample.
    [[gnu::always_inline]] void addOne(const TilePart& part, std::uint32_t triangle) {
        const TriangleCorners& c = part.corners;
        const glm::vec3 place((c[0] + c[1] + c[2]) * (1.0 / 3.0) - origin_);
        if (staysAway(place, place)) return;
        places_.push_back(place);
        addRun(part, triangle, std::uint32_t(places_.size() - 1));
    }
    // A run of all places from `begin` on.
    [[gnu::always_inline]] void addRun(const TilePart& part, std::uint32_t triangle, std::uint32_t begin) {
        areas_ += part.length;
        // divided in double: floats cannot hold the area of a very small triangle
        const glm::vec3 normal(part.normal / part.length);
        runs_.push_back({twiceDelta_ * normal, std::int32_t(triangle), begin, std::uint32_t(places_.size())});
    }
    void addRows(const TilePart& part, std::uint32_t triangle);
    bool staysAway(const glm::vec3& lower, const glm::vec3& upper) const {
        return glm::any(glm::lessThan(upper, lower_)) || glm::any(glm::greaterThan(lower, upper_));
    }
    LayerGroup groupOf(std::uint32_t run) const;
    void gatherRuns();
    LayerGroup cluster(std::uint32_t begin, std::uint32_t end);

    glm::dvec3 origin_{0};
    glm::vec3 lower_{0}, upper_{0};  // of all places that can matter
    float twiceDelta_ = 1;
    bool wantCells_ = false;
    double areas_ = 0;  // of all runs' triangles, twice [voxels^2]
    std::vector<LayerGroup> groups_;
    std::vector<LayerRun> runs_;
    CellSort<LayerRun> sort_;
    std::vector<glm::vec3> places_, cells_;
};

}  // namespace bilayer
