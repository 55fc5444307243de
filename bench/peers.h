// Who answers queries in the comparison: OpenVDB, NanoVDB and Embree beside the field.
//
// All are asked in the same way, a stretch of questions at a time, in world coordinates. What a peer needs for itself
// (an accessor, a stencil) it makes anew for each stretch, so that stretches can run on several threads.
#pragma once

#include <openvdb/openvdb.h>

#include <functional>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <span>
#include <string>

#include <bilayer/collider/field.h>

namespace bilayer::bench {

/// One who answers: as many answers as questions.
template <class Question, class Answer>
struct Peer {
    std::string name;
    std::function<void(std::span<const Question>, std::span<Answer>)> answer;
};

/// Value and gradient of the trilinear interpolant at points [m]. Peers leave Sample::inBand alone.
using Sampler = Peer<glm::vec3, Sample>;

/// Closest points of the surface [m].
using Closest = Peer<glm::vec3, ClosestPoint>;

/// The answer to a ray that meets nothing.
inline constexpr RayHit missed{.distance = std::numeric_limits<float>::infinity()};

/// Where rays meet the surface first.
using RayCaster = Peer<Ray, RayHit>;

/// openvdb::tools::BoxSampler for the value, openvdb::math::BoxStencil for the gradient: what the library has for each.
Sampler openvdbSampler(openvdb::FloatGrid::ConstPtr grid);

/// openvdb::math::BoxStencil for both, with one fetch of eight voxels.
Sampler openvdbStencil(openvdb::FloatGrid::ConstPtr grid);

/// One fetch of eight voxels by BoxSampler::getValues, and no more than the arithmetic of value and gradient, which is
/// NanoVDB's: the most that can be made of OpenVDB's tree. BoxStencil's gradient takes a shared pointer to the grid's
/// map each time, and two threads that do so wait for each other.
Sampler openvdbCell(openvdb::FloatGrid::ConstPtr grid);

/// openvdb::tools::LevelSetRayIntersector with position, normal and distance: crossings of the interpolant.
RayCaster openvdbRays(openvdb::FloatGrid::ConstPtr grid);

/// A grid of NanoVDB with its trilinear sampler, which fetches eight voxels once for value and gradient.
class Nanovdb {
  public:
    explicit Nanovdb(const openvdb::FloatGrid& grid);
    std::size_t bytes() const;
    Sampler sampler() const;

  private:
    struct Grid;
    std::shared_ptr<const Grid> grid_;
};

}  // namespace bilayer::bench
