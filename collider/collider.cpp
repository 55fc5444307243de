// Contacts between two bodies: the surface points of either in the field of the other. The trees of points are
// descended with the relative pose, so that only points near the other body are sampled.
#include "collider/collider.h"

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <utility>

namespace bilayer {
namespace {

constexpr float fieldError = 0.5f;  // [voxels] that a field may overestimate: kept from costing contacts
constexpr float flattest = 0.1f;    // a gradient shorter than this tells no direction: the point is on a medial axis

// The map from the coordinates of one body into those of another.
struct Map {
    glm::mat3 linear;
    glm::vec3 shift;
    float scale;

    Map(const Placed& from, const Placed& into) : scale(from.scale / into.scale) {
        const Pose pose = relative(into.pose, from.pose);
        linear = scale * glm::mat3_cast(pose.rotation);
        shift = pose.position / into.scale;
    }
    glm::vec3 operator()(const glm::vec3& point) const { return linear * point + shift; }

    // The same map, into the parts of a field's clearance.
    Map inParts(const Field& field) const {
        const float edge = float(Clearance::partSide) * field.voxelSize();
        Map map = *this;
        map.scale /= edge;
        map.linear *= 1 / edge;
        map.shift = glm::vec3((glm::dvec3(shift) - field.origin()) / double(edge));
        return map;
    }
};

// Calls found(index, point, sample) for the points of one body within `margin` [m] of another's surface or in it.
template <class Found>
void samplePoints(const Placed& body, const Placed& other, float margin, ContactReport& report, Found&& found) {
    const Map map(body, other);
    const Field& field = other.collider.field();
    const float reach = margin / other.scale;
    const Clearance clearance = field.clearance();
    const Map coarse = map.inParts(field);
    const float kept = (reach / field.voxelSize() + fieldError) / float(Clearance::partSide);
    const auto reject = [&](const glm::vec3& centre, float radius) {
        return clearance.isOutside(coarse(centre), radius * coarse.scale + kept);
    };
    body.collider.points().visit(reject, [&](std::uint32_t index, const SurfacePoint& point) {
        const glm::vec3 place = coarse(point.position);
        if (clearance.isAbove(place, reach) || clearance.isOutside(place, kept)) return;
        ++report.pointsTested;
        const Sample sample = field.sampleWithin(map(point.position), reach);
        if (!(sample.distance <= reach)) return;
        if (sample.inBand) found(index, point, sample);
        if (!sample.inBand && sample.distance < 0) ++report.beyondBand;
    });
}

// Outward of `other`, in the world; where its field tells none, against the surface of the body that touches it.
glm::vec3 outwardNormal(const Placed& other, const Sample& sample, const Placed& body, const SurfacePoint& point) {
    const float length = glm::length(sample.gradient);
    return length > flattest ? other.pose.rotation * (sample.gradient / length) : -(body.pose.rotation * point.normal);
}

}  // namespace

Collider::Collider(Mesh mesh, const LevelSet& levelSet, const ColliderOptions& options)
    : mesh_(std::move(mesh)),
      field_(levelSet),
      points_(mesh_, options.pointSpacing * field_.voxelSize()),
      bounds_(bilayer::bounds(mesh_)) {}

ContactReport collide(const Placed& a, const Placed& b, const ContactOptions& options, std::vector<Contact>& contacts) {
    ContactReport report;
    const auto opposes = [&](const glm::vec3& normal, const Placed& body, const SurfacePoint& point) {
        return -glm::dot(normal, body.pose.rotation * point.normal) >= options.leastOpposition;
    };
    samplePoints(
        a, b, options.margin, report, [&](std::uint32_t index, const SurfacePoint& point, const Sample& sample) {
            const glm::vec3 normal = outwardNormal(b, sample, a, point);
            if (!opposes(normal, a, point)) return;
            const float distance = sample.distance * b.scale;
            contacts.push_back({a.pose.toWorld(a.scale * point.position) - distance * normal, normal, distance, index});
        });
    samplePoints(
        b, a, options.margin, report, [&](std::uint32_t index, const SurfacePoint& point, const Sample& sample) {
            const glm::vec3 normal = outwardNormal(a, sample, b, point);
            if (!opposes(normal, b, point)) return;
            contacts.push_back(
                {b.pose.toWorld(b.scale * point.position), -normal, sample.distance * a.scale, index | featureOfB});
        });
    return report;
}

}  // namespace bilayer
