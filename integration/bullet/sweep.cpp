#include "integration/bullet/sweep.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace bilayer::bullet {

namespace {

// Far below what a field knows of its surface [voxels].
constexpr float touchVoxels = 1e-3f;
// Steps in the band are shortened by this, since an interpolated distance may change by more than the way moved.
constexpr float caution = 0.8f;
// Steps are at least touchVoxels / 2 long, so that this only ends ways that graze the surface for thousands of voxels.
constexpr int mostSteps = 100000;

}  // namespace

bool sweepable(const Placed& body, float radius) {
    const Field& field = body.collider.field();
    // One voxel is kept for the interpolation at the band's border.
    return radius < body.scale * (field.exteriorWidth() - field.voxelSize());
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

}  // namespace bilayer::bullet
