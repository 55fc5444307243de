// SPDX-License-Identifier: Apache-2.0
// Batch sampling of the points of many bodies in each other's fields, as a device can do it.
// Tested by tests/bullet/sampled_pairs.cpp.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include <bilayer/collider/query.h>
#include <bilayer/sdf/level_set.h>
#include "collider/field/layout/field_layout.h"

namespace bilayer::detail {

/// Consecutive points of a body and their bounding sphere.
struct PointBall {
    glm::vec3 centre;          ///< [m]
    float radius;              ///< [m]
    std::uint32_t begin, end;  ///< range of points
};

/// The surface points of a body. Each of them is in exactly one ball.
struct BallsOfPoints {
    std::vector<glm::vec3> points;  ///< [m]
    std::vector<PointBall> balls;
};

/// A body as a sampler's input. The sampler caches its copies under the id.
struct SampledBody {
    std::uint64_t id;          ///< unique within this process, never reused
    const FieldLayout* field;  ///< of Storage::float32
    std::function<BallsOfPoints()> points;
};

/// A query for all points of one body in the field of another.
struct PointQuery {
    std::uint32_t body, other;  ///< indices in the array of bodies
    /// The transform from the coordinates of the body to those of the other one: linear * point + shift.
    glm::mat3 linear;
    glm::vec3 shift;
    float scale;  ///< the factor by which `linear` scales lengths
    float reach;  ///< max distance of the points to find [m]
};

/// A point that may touch the other body, with its sample. Outside the band only the sign of the sample matters.
struct FoundPoint {
    std::uint32_t point;
    Sample sample;
};

/// The results of a batch of queries.
class FoundPoints {
  public:
    /// The points of one query, in ascending order.
    std::span<const FoundPoint> of(std::size_t query) const {
        return std::span(points).subspan(begins[query], begins[query + 1] - begins[query]);
    }

    std::vector<FoundPoint> points;     ///< grouped by query
    std::vector<std::uint32_t> begins;  ///< the first point of each query, and the end
    DeviceTimes times;                  ///< of the batch
};

/// What a PointSampler holds.
struct DeviceSampler {
    std::string backend;  ///< "opencl"
    std::string device;   ///< the device's name
    /// Throws on device errors; the next call may succeed.
    std::function<void(std::span<const SampledBody>, std::span<const PointQuery>, FoundPoints&)> sample;
};

}  // namespace bilayer::detail
