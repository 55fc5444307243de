// A triangle divided along segments in its plane.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <vector>

namespace bilayer::detail {

/// The corners of a convex polygon, counter-clockwise seen from where its normal points.
using Polygon = std::vector<glm::dvec3>;

struct Segment {
    glm::dvec3 from, to;
};

/// Shortens a segment to the part within `slack` of a convex polygon; false if no part is left.
/// @param normal  the polygon's, of unit length
bool clip(Segment& segment, const Polygon& polygon, const glm::dvec3& normal, double slack);

/// Divides a convex polygon into pieces that no segment crosses, and returns those that are kept. It splits the plane
/// along one line after another; where all of what a line has split is kept, it stays one piece. Pieces thinner than
/// `slack` go with their neighbours.
/// @param normal    the polygon's, of unit length
/// @param segments  in the polygon's plane and within it, as clip() leaves them
/// @param keeps     called with a point within each piece
std::vector<Polygon> cut(const Polygon& polygon, const glm::dvec3& normal, std::vector<Segment> segments, double slack,
                         const std::function<bool(const glm::dvec3& inside)>& keeps);

}  // namespace bilayer::detail
