// Points of many bodies in the fields of others, all at once: what a device can do for contacts. A sampler plugs into
// who has the bodies by a function type, as a BlockFiller does into who has the mesh.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include <bilayer/collider/query.h>
#include "collider/field/field_layout.h"

namespace bilayer::detail {

/// Consecutive points of a body, and a ball around them.
struct PointBall {
    glm::vec3 centre;          ///< [m]
    float radius;              ///< [m]
    std::uint32_t begin, end;  ///< of the points
};

/// The points of a body that may touch others. All of them are in some ball, in one only.
struct BallsOfPoints {
    std::vector<glm::vec3> points;  ///< [m]
    std::vector<PointBall> balls;
};

/// A body as a sampler sees it, which keeps what it has copied of it under its number.
struct SampledBody {
    std::uint64_t id;          ///< no other body of this process has it, ever
    const FieldLayout* field;  ///< of Storage::float32
    std::function<BallsOfPoints()> points;
};

/// All points of one body in the field of another.
struct PointQuery {
    std::uint32_t body, other;  ///< by their places among the bodies
    /// From the coordinates of the body into those of the other one: linear * point + shift.
    glm::mat3 linear;
    glm::vec3 shift;
    float scale;  ///< by which `linear` makes lengths larger
    float reach;  ///< of what is to be found [m]
};

/// A point where the other body may be touched: its sample, of which out of the band only the sign counts.
struct FoundPoint {
    std::uint32_t point;
    Sample sample;
};

/// The answers of a batch of queries.
class FoundPoints {
  public:
    /// In ascending order of the points.
    std::span<const FoundPoint> of(std::size_t query) const {
        return std::span(points).subspan(begins[query], begins[query + 1] - begins[query]);
    }

    std::vector<FoundPoint> points;     ///< query by query
    std::vector<std::uint32_t> begins;  ///< of each query's points, and the end
};

}  // namespace bilayer::detail
