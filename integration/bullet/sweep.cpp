#include "integration/bullet/sweep.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "collider/interpolant.h"
#include "collider/mesh_rays.h"

namespace bilayer::bullet {

namespace {

// Far below what a field knows of its surface [voxels].
constexpr float touchVoxels = 1e-3f;
// Steps in the band are shortened by this, since an interpolated distance may change by more than the way moved.
constexpr float caution = 0.8f;
// Steps are at least touchVoxels / 2 long, so that this only ends ways that graze the surface for thousands of voxels.
constexpr int mostSteps = 100000;
// Against triangles, a way is looked at piece by piece, and the nearest triangle looked for a few pieces ahead
// [voxels].
constexpr double pieceVoxels = 2, aheadVoxels = 8;
// What the nearest triangle may be off by [voxels], and as a part of its distance.
constexpr double slackVoxels = 1e-4, nearestRounding = 2e-6;

/// How far a point is from the mesh, looked for no farther than `reach`, both in metres.
double gapAt(const MeshTree& mesh, const glm::dvec3& point, double reach) {
    const std::uint32_t triangle = mesh.nearest(point, static_cast<float>(reach / mesh.voxelSize()));
    return triangle == noTriangle ? reach : glm::length(mesh.featureOf(triangle, point).way);
}

}  // namespace

bool sweepable(const Placed& body, float radius) {
    const Field& field = body.collider.field();
    // Beyond the band a bound is told, which falls to this near it: a sphere that it reaches could touch anywhere
    // there.
    const float voxel = field.voxelSize(),
                leastBound = surelyInBand(field.exteriorWidth(), voxel) - touchVoxels * voxel;
    return radius < body.scale * leastBound;
}

std::optional<SweepHit> sweepSphere(const Placed& body, const glm::vec3& from, const glm::vec3& to, float radius,
                                    float allowed) {
    const Field& field = body.collider.field();
    const glm::vec3 start = body.pose.toBody(from) / body.scale, end = body.pose.toBody(to) / body.scale;
    const float length = glm::length(end - start);
    if (!(length > 0)) return std::nullopt;
    const glm::vec3 direction = (end - start) / length;
    const float gapAtHit = (radius - allowed) / body.scale;
    const float touch = touchVoxels * field.voxelSize();

    float way = 0;
    for (int i = 0; i < mostSteps && way <= length; ++i) {
        const glm::vec3 centre = start + way * direction;
        const Sample sample = field.sample(centre);
        const float gap = sample.distance - gapAtHit;
        if (gap <= touch) {
            const bool inward = glm::dot(sample.gradient, direction) < 0;
            if (inward) {
                const glm::vec3 normal = glm::normalize(sample.gradient);
                const glm::vec3 point = centre - sample.distance * normal;
                return SweepHit{way / length, body.pose.toWorld(body.scale * point), body.pose.rotation * normal};
            }
            if (!sample.inBand) return std::nullopt;
        }
        const float step = sample.inBand ? caution * std::abs(gap) : std::abs(gap);
        way += std::max(step, 0.5f * touch);
    }
    return std::nullopt;
}

std::optional<SweepHit> sweepSphere(const MeshTree& mesh, const glm::vec3& from, const glm::vec3& to, float radius) {
    const glm::dvec3 way = glm::dvec3(to) - glm::dvec3(from);
    const double length = glm::length(way), voxel = mesh.voxelSize();
    if (!(length > 0)) return std::nullopt;
    const Path path{glm::dvec3(from), way / length, length};
    const double piece = pieceVoxels * voxel;
    // In strides through what is empty (J. C. Hart, "Sphere tracing", 1996), triangle by triangle where it is not.
    for (double along = 0; along <= length;) {
        const double gap = gapAt(mesh, path.at(along), radius + aheadVoxels * voxel);
        const double clear = gap * (1 - nearestRounding) - slackVoxels * voxel - radius;
        if (clear > piece) {
            along += clear;
            continue;
        }
        const Path next{path.at(along), path.direction, std::min(piece, length - along)};
        if (const auto hit = firstTouch(mesh, next, radius))
            return SweepHit{static_cast<float>((along + hit->along) / length), glm::vec3(hit->position),
                            glm::vec3(glm::normalize(next.at(hit->along) - hit->position)),
                            static_cast<int>(hit->triangle)};
        along += piece;
    }
    return std::nullopt;
}

bool touches(const MeshTree& mesh, const glm::vec3& centre, float radius) {
    return gapAt(mesh, glm::dvec3(centre), 2. * radius) < radius;
}

}  // namespace bilayer::bullet
