// SPDX-License-Identifier: Apache-2.0
// Nodes are visited in front-to-back order. Highway compiles the search once for each instruction set.
#include "collider/field/triangles/mesh_rays.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/field/triangles/mesh_rays.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "collider/field/triangles/ray_traversal.h"
#include "collider/field/triangles/triangle_tests.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {

namespace {
/// Max distance at which a ray may pass a triangle and still hit it [voxels].
constexpr double rayTolerance = 1e-5;

std::optional<MeshHit> searchRay(const MeshTree& mesh, const Path& path) {
    const TriangleRay ray(path.origin, path.direction, rayTolerance * double(mesh.voxelSize()));
    RayTraversal traversal(mesh, path);
    MeshHit hit{.along = path.length, .position = {}, .triangle = noTriangle};
    traversal.run([&](std::uint32_t triangle) {
        if (!ray.meets(cornersOf(mesh.mesh(), triangle), hit.along, hit.position)) return;
        hit.triangle = triangle;
        traversal.limitTo(hit.along);
    });
    if (hit.triangle == noTriangle) return std::nullopt;
    return hit;
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {

HWY_EXPORT(searchRay);

std::optional<MeshHit> firstHit(const MeshTree& mesh, const Path& path) noexcept {
    // starts near the mesh, where single precision is sufficient
    const auto [lower, upper] = mesh.box();
    const auto section = sectionIn(path, lower, upper);
    if (!section) return std::nullopt;
    auto hit = HWY_DYNAMIC_DISPATCH(searchRay)(mesh, section->path);
    if (hit) hit->along += section->from;
    return hit;
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
