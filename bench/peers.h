// SPDX-License-Identifier: Apache-2.0
// Peers of the query benchmark: the field, OpenVDB, NanoVDB and Embree.
//
// All have the same interface: a batch of queries at a time, in world coordinates. A peer creates its own helpers (an
// accessor, a stencil) for each batch, so that batches can run on several threads.
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

/// Answers queries, one answer per query.
template <class Question, class Answer>
struct Peer {
    std::string name;
    std::function<void(std::span<const Question>, std::span<Answer>)> answer;
};

/// Value and gradient of the trilinear interpolant at points [m]. Peers do not set Sample::inBand.
using Sampler = Peer<glm::vec3, Sample>;

/// Closest points of the surface [m].
using Closest = Peer<glm::vec3, ClosestPoint>;

/// The answer to a ray without a hit.
inline constexpr RayHit missed{.distance = std::numeric_limits<float>::infinity()};

/// First hits of rays on the surface.
using RayCaster = Peer<Ray, RayHit>;

/// openvdb::tools::BoxSampler for the value, openvdb::math::BoxStencil for the gradient: OpenVDB's own tool for each.
Sampler openvdbSampler(openvdb::FloatGrid::ConstPtr grid);

/// openvdb::math::BoxStencil for both, with one fetch of eight voxels.
Sampler openvdbStencil(openvdb::FloatGrid::ConstPtr grid);

/// One fetch of eight voxels by BoxSampler::getValues, and only the arithmetic of value and gradient, which is
/// NanoVDB's. This is the best that OpenVDB's tree allows. BoxStencil's gradient copies a shared pointer to the grid's
/// map each time, and threads that do so contend for it.
Sampler openvdbCell(openvdb::FloatGrid::ConstPtr grid);

/// openvdb::tools::LevelSetRayIntersector with position, normal and distance: hits on the interpolant.
RayCaster openvdbRays(openvdb::FloatGrid::ConstPtr grid);

/// A NanoVDB grid with its trilinear sampler, which fetches eight voxels once for value and gradient.
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
