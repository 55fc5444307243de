// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "sdf/base/finite.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/checks.h"

namespace bilayer::test {
namespace {

constexpr unsigned maxQueries = 8;
constexpr float voxel = 0.15f;

struct QueriedFields {
    Mesh mesh = shapes::join({shapes::box({0.5f, 0.3f, 0.2f}), shapes::moved(shapes::sphere(0.3f, 2), {0.2f, 1, 0})});
    LevelSet levelSet = build(mesh, {.voxelSize = voxel});
    Field withMesh{levelSet, mesh}, withoutMesh{levelSet}, fixed{levelSet, {.storage = Storage::fixed16}};
};

bool isUnit(const glm::vec3& v) {
    return std::abs(glm::length(v) - 1) < 1e-4f;
}

void checkHit(const std::optional<RayHit>& hit, const Ray& ray, float radius) {
    if (!hit) return;
    require(detail::isFinite(ray.origin) && detail::isFinite(ray.direction) && ray.direction != glm::vec3(0) &&
                ray.maxDistance >= 0 && std::isfinite(radius) && radius >= 0,
            "an invalid ray hits");
    require(hit->distance >= 0 && double(hit->distance) <= double(ray.maxDistance) * (1 + 1e-6) + 1e-5,
            "a hit lies outside of its ray");
    require(detail::isFinite(hit->position) && isUnit(hit->normal), "a hit has no finite position or no unit normal");
}

void checkPoint(const Field& field, const glm::vec3& point, float reach) {
    const Sample sample = field.sample(point);
    require(!std::isnan(sample.distance) && field.distance(point) == sample.distance, "a sample is not its distance");
    require(detail::isFinite(sample.gradient), "a gradient is not finite");
    const bool inside = field.inside(point);
    const ClosestPoint closest = field.closest(point, reach);
    if (!detail::isFinite(point)) {
        require(sample.distance == std::numeric_limits<float>::infinity() && !inside && !closest.found,
                "a point that is not finite has an answer");
        return;
    }
    if (!closest.found) return;
    require(std::abs(closest.distance) <= reach, "a closest point is farther than the search radius");
    require(detail::isFinite(closest.position) && isUnit(closest.normal),
            "a closest point has no position or no unit normal");
    const double away = glm::length(glm::dvec3(point) - glm::dvec3(closest.position));
    require(std::abs(away - std::abs(double(closest.distance))) <= 1e-4 * (away + 1) ||
                away > double(std::numeric_limits<float>::max()),
            "a closest point does not lie at its distance");
}

void checkOverlaps(const Field& field, ByteSource& bytes, const glm::vec3& point, float radius) {
    const bool overlaps = field.overlapsSphere(point, radius);
    if (!detail::isFinite(point) || !std::isfinite(radius) || radius < 0)
        require(!overlaps, "an invalid sphere overlaps");
    else if (field.inside(point))
        require(overlaps, "a sphere around an inner point does not overlap");
    const OrientedBox box{point, bytes.anyVector(), bytes.flag() ? bytes.anyRotation() : glm::quat(1, 0, 0, 0)};
    const bool boxOverlaps = field.overlapsBox(box);
    if (!detail::isFinite(box.centre) || !detail::isFinite(box.halfSize))
        require(!boxOverlaps, "an invalid box overlaps");
}

}  // namespace

void checkQueries(Bytes numbers) {
    static const QueriedFields fields;
    ByteSource bytes(numbers);
    for (unsigned i = 0; i < maxQueries && !bytes.empty(); ++i) {
        const unsigned kind = bytes.below(5);
        // queries without the mesh take a hundred times longer
        const Field& field = kind == 0 ? fields.withoutMesh : kind == 1 ? fields.fixed : fields.withMesh;
        const glm::vec3 point = bytes.anyVector();
        checkPoint(field, point, bytes.anyFloat());
        const Ray ray{point, bytes.anyVector(), bytes.anyFloat()};
        const std::optional<RayHit> hit = field.raycast(ray);
        checkHit(hit, ray, 0);
        if (hit && hit->distance > 0) require(!field.inside(point), "a ray that starts inside hits later");
        const float radius = bytes.anyFloat();
        checkHit(field.sphereCast(ray, radius), ray, radius);
        const auto segment = field.segment(point, bytes.anyVector());
        if (segment) require(isUnit(segment->normal), "a segment's hit has no unit normal");
        checkOverlaps(field, bytes, point, radius);
    }
}

}  // namespace bilayer::test
