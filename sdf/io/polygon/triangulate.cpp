// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/polygon/triangulate.h"

#include <algorithm>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "sdf/base/line_side.h"
#include "sdf/io/polygon/ear_clipper.h"
#include "sdf/io/polygon/simple_outline.h"

namespace bilayer::detail {
namespace {

// The projection along the coordinate axis nearest to a normal, viewed from the side to which the normal points.
class View {
  public:
    explicit View(const glm::dvec3& normal) {
        const glm::dvec3 size = glm::abs(normal);
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        u_ = (axis + 1) % 3;
        v_ = (axis + 2) % 3;
        if (normal[axis] < 0) std::swap(u_, v_);
    }

    glm::dvec2 operator()(const glm::dvec3& point) const { return {point[u_], point[v_]}; }

  private:
    int u_, v_;
};

// Returns twice the area vector, by M. E. Newell's method for non-planar outlines.
glm::dvec3 areaOf(std::span<const glm::dvec3> outline) {
    glm::dvec3 sum(0);
    for (std::size_t i = 1; i + 1 < outline.size(); ++i)
        sum += glm::cross(outline[i] - outline[0], outline[i + 1] - outline[0]);
    return sum;
}

bool hasArea(std::span<const glm::dvec3> triangle) {
    const View view(areaOf(triangle));
    return lineSide(view(triangle[0]), view(triangle[1]), view(triangle[2])) != 0;
}

// Cuts along the first diagonal that leaves two triangles with area. There is none if the outline crosses itself or has
// no area.
bool cutQuad(std::span<const glm::dvec3> outline, std::vector<glm::uvec3>& triangles) {
    const View view(glm::cross(outline[2] - outline[0], outline[3] - outline[1]));
    const glm::dvec2 p[4] = {view(outline[0]), view(outline[1]), view(outline[2]), view(outline[3])};
    if (lineSide(p[0], p[1], p[2]) > 0 && lineSide(p[2], p[3], p[0]) > 0) {
        triangles.push_back({0, 1, 2});
        triangles.push_back({0, 2, 3});
        return true;
    }
    if (lineSide(p[1], p[2], p[3]) > 0 && lineSide(p[3], p[0], p[1]) > 0) {
        triangles.push_back({0, 1, 3});
        triangles.push_back({1, 2, 3});
        return true;
    }
    return false;
}

bool haveArea(std::span<const glm::dvec2> outline, std::span<const glm::uvec3> triangles) {
    return std::any_of(triangles.begin(), triangles.end(),
                       [&](const glm::uvec3& t) { return lineSide(outline[t.x], outline[t.y], outline[t.z]) > 0; });
}

bool cutPolygon(std::span<const glm::dvec3> outline, std::vector<glm::uvec3>& triangles) {
    thread_local std::vector<glm::dvec2> flat;
    thread_local EarClipper clipper;
    const View view(areaOf(outline));
    flat.clear();
    for (const glm::dvec3& point : outline) flat.push_back(view(point));
    const std::size_t before = triangles.size();
    const bool fits = clipper.clip(flat, triangles);
    if (!fits || !haveArea(flat, std::span(triangles).subspan(before))) return false;
    return clipper.wasConvex() || enclosesOnce(flat);
}

}  // namespace

bool triangulate(std::span<const glm::dvec3> outline, std::vector<glm::uvec3>& triangles) {
    if (outline.size() < 3) return false;
    if (outline.size() == 3) {
        triangles.push_back({0, 1, 2});
        return hasArea(outline);
    }
    if (outline.size() == 4 && cutQuad(outline, triangles)) return true;
    return cutPolygon(outline, triangles);
}

}  // namespace bilayer::detail
