// SPDX-License-Identifier: Apache-2.0
// Cuts a triangle along segments in its plane.
// Tested by tests/sdf/unite.cpp.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <vector>

namespace bilayer::detail {

/// The corners of a convex polygon, counter-clockwise as seen against its normal.
using Polygon = std::vector<glm::dvec3>;

struct Segment {
    glm::dvec3 from, to;
};

/// Clips a segment to within `slack` of a convex polygon. Returns false if nothing is left.
/// @param normal  the polygon's unit normal
bool clip(Segment& segment, const Polygon& polygon, const glm::dvec3& normal, double slack);

/// A part of a polygon, with the label of its interior.
struct LabelledPiece {
    Polygon polygon;
    int label;
};

/// Cuts a convex polygon into pieces that no segment crosses. It splits the plane along one line after another. If all
/// pieces of a split have the same label, they remain one piece: a polygon of one label stays whole. Pieces thinner
/// than `slack` are merged into their neighbours.
/// @param normal    the polygon's unit normal
/// @param segments  in the polygon's plane; their parts outside of the polygon cut nothing
/// @param labelOf   called with an interior point of each piece
std::vector<LabelledPiece> cut(const Polygon& polygon, const glm::dvec3& normal, const std::vector<Segment>& segments,
                               double slack, const std::function<int(const glm::dvec3& inside)>& labelOf);

}  // namespace bilayer::detail
