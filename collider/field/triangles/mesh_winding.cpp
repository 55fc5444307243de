// SPDX-License-Identifier: Apache-2.0
// The ray is parallel to an axis and leaves the mesh's box on the shortest way. The winding number sums its signed
// crossings edge by edge, as J. O'Rourke ("Computational Geometry in C", 1998, 7.4) does for polygons. Highway compiles
// the search once for each instruction set.
#include "collider/field/triangles/mesh_winding.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/field/triangles/mesh_winding.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>

#include "collider/field/triangles/ray_traversal.h"
#include "collider/field/triangles/triangle_tests.h"
#include "sdf/base/finite.h"
#include "sdf/base/line_side.h"
#include "sdf/base/plane_side.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {

namespace {
/// Max count of triangles that a ray crosses: more crossings than a point needs to have a clear side.
constexpr std::size_t maxCrossed = 256;

// A ray from a point along an axis, upward or downward.
struct AxisRay {
    glm::dvec3 origin;
    int axis;
    bool upward;
    double length;  // to the mesh's box

    AxisRay(const glm::dvec3& point, const glm::dvec3& lower, const glm::dvec3& upper) : origin(point) {
        axis = 0, upward = true, length = upper.x - point.x;
        for (int k = 0; k < 3; ++k) {
            if (upper[k] - point[k] < length) axis = k, upward = true, length = upper[k] - point[k];
            if (point[k] - lower[k] < length) axis = k, upward = false, length = point[k] - lower[k];
        }
    }

    Path path() const {
        glm::dvec3 direction(0);
        direction[axis] = upward ? 1 : -1;
        return {origin, direction, length};
    }

    // The plane across the axis; the axis points towards the viewer.
    glm::dvec2 across(const glm::dvec3& p) const { return {p[(axis + 1) % 3], p[(axis + 2) % 3]}; }
};

// How often an edge runs counter-clockwise past a half-line from the point in the plane. Each edge owns its lower end.
int passes(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& point) {
    const bool rises = b.y > point.y;
    if ((a.y > point.y) == rises) return 0;
    const int side = lineSide(a, b, point);
    return rises ? side > 0 : -int(side < 0);
}

// 1 if the ray leaves through the front of a triangle, -1 if it enters there, 0 if it passes by.
int crossing(const AxisRay& ray, const TriangleCorners& c) {
    const glm::dvec2 a = ray.across(c[0]), b = ray.across(c[1]), d = ray.across(c[2]), point = ray.across(ray.origin);
    const int facing = passes(a, b, point) + passes(b, d, point) + passes(d, a, point);
    if (facing == 0) return 0;
    const int side = facing * planeSide(c[0], c[1], c[2], ray.origin);
    if (ray.upward) return side < 0 ? facing : 0;
    return side > 0 ? -facing : 0;
}

std::optional<int> sumCrossings(const MeshTree& mesh, const glm::dvec3& point) {
    const auto [lower, upper] = mesh.box();
    const AxisRay ray(point, lower, upper);
    std::array<std::uint32_t, maxCrossed> crossed;  // long triangles are met several times
    std::size_t count = 0;
    int sum = 0;
    bool complete = true;
    RayTraversal(mesh, ray.path()).run([&](std::uint32_t triangle) {
        const int sign = crossing(ray, cornersOf(mesh.mesh(), triangle));
        if (sign == 0 || std::find(crossed.begin(), crossed.begin() + count, triangle) != crossed.begin() + count)
            return;
        complete &= count < maxCrossed;
        if (!complete) return;
        crossed[count++] = triangle;
        sum += sign;
    });
    if (!complete) return std::nullopt;
    return sum;
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {

HWY_EXPORT(sumCrossings);

std::optional<int> windingNumber(const MeshTree& mesh, const glm::vec3& point) noexcept {
    const glm::dvec3 exact(point);
    if (!isFinite(point)) return std::nullopt;
    if (!mesh.mayEnclose(exact)) return 0;
    return HWY_DYNAMIC_DISPATCH(sumCrossings)(mesh, exact);
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
