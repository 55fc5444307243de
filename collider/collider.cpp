// Contacts between two bodies: the surface points of either in the field of the other. The trees of points are
// descended with the relative pose, so that only points near the other body are sampled.
#include "collider/collider.h"

#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <utility>

#include "sdf/surface.h"

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

// How a field is touched, in its own coordinates.
struct Touch {
    float distance;      // of the point from the surface; of one that comes from afar from the plane that it will meet
    glm::vec3 normal;    // outward; zero where the field tells none
    float approach = 0;  // Contact::approach
};

glm::vec3 directionOf(const glm::vec3& gradient) {
    const float length = glm::length(gradient);
    return length > flattest ? gradient / length : glm::vec3(0);
}

// The touch of a point that comes from outside of the field and goes some way.
std::optional<Touch> touchOnWay(const Field& field, const glm::vec3& point, const glm::vec3& way) {
    const auto hit = field.segment(point, point + way);
    if (!hit) return std::nullopt;
    return Touch{std::max(glm::dot(point - hit->position, hit->normal), 0.f), hit->normal, -glm::dot(way, hit->normal)};
}

// Calls found(index, point, touch) for the points of one body within `margin` [m] of another's surface, in it, or on
// their way to it.
template <class Found>
void samplePoints(const Placed& body, const Placed& other, float margin, ContactReport& report, Found&& found) {
    const Map map(body, other);
    const Field& field = other.collider.field();
    const float reach = margin / other.scale;
    const RelativeWays ways(body.pose, body.motion, other.pose, other.motion);
    const Bounds& bounds = body.collider.bounds();
    const float most =
        ways.longest(other.scale * map(bounds.centre()), 0.5f * body.scale * glm::length(bounds.size())) / other.scale;
    const bool sweeps = most > reach;
    const Clearance clearance = field.clearance();
    const Map coarse = map.inParts(field);
    const float seen = sweeps ? reach + most : reach;
    const float kept = (seen / field.voxelSize() + fieldError) / float(Clearance::partSide);
    const auto reject = [&](const glm::vec3& centre, float radius) {
        return clearance.isOutside(coarse(centre), radius * coarse.scale + kept);
    };
    body.collider.points().visit(reject, [&](std::uint32_t index, const SurfacePoint& point) {
        const glm::vec3 place = coarse(point.position);
        if (clearance.isAbove(place, seen) || clearance.isOutside(place, kept)) return;
        ++report.pointsTested;
        const glm::vec3 at = map(point.position);
        const Sample sample = field.sampleWithin(at, reach);
        if (sample.distance <= reach) {
            if (sample.inBand) {
                const glm::vec3 normal = directionOf(sample.gradient);
                const float approach = sweeps ? -glm::dot(ways.of(other.scale * at), normal) / other.scale : 0;
                found(index, point, Touch{sample.distance, normal, std::max(approach, 0.f)});
            }
            if (!sample.inBand && sample.distance < 0) ++report.beyondBand;
        } else if (sweeps) {
            const glm::vec3 way = ways.of(other.scale * at) / other.scale;
            if (sample.distance > glm::length(way)) return;
            if (const auto touch = touchOnWay(field, at, way)) found(index, point, *touch);
        }
    });
}

// Outward of `other`, in the world; where its field tells none, against the surface of the body that touches it.
glm::vec3 outwardNormal(const Placed& other, const Touch& touch, const Placed& body, const SurfacePoint& point) {
    return touch.normal == glm::vec3(0) ? -(body.pose.rotation * point.normal) : other.pose.rotation * touch.normal;
}

std::optional<MassProperties> massOf(const Mesh& mesh) {
    try {
        return massProperties(mesh);
    } catch (const std::invalid_argument&) {
        return std::nullopt;  // an open sheet: it can only be static
    }
}

}  // namespace

/// A mesh, or the field that it is extracted from when somebody asks: few do, and it takes longer than all else that a
/// body from a file needs.
class Collider::Triangles {
  public:
    explicit Triangles(Mesh mesh) : mesh_(std::move(mesh)) {}
    explicit Triangles(const LevelSet& field) : field_(field) {}

    const Mesh& mesh() {
        std::call_once(once_, [&] {
            if (!field_) return;
            // a thread that waits for others here must not take up work that asks for this very mesh
            tbb::this_task_arena::isolate([&] { mesh_ = surface(*field_); });
            field_.reset();
        });
        return mesh_;
    }

  private:
    std::optional<LevelSet> field_;
    Mesh mesh_;
    std::once_flag once_;
};

Collider::Collider(Mesh mesh, const LevelSet& levelSet, const ColliderOptions& options)
    : triangles_(std::make_shared<Triangles>(std::move(mesh))), field_(levelSet) {
    if (!std::isfinite(options.margin)) throw std::invalid_argument("collider: the margin is not finite");
    body_.points = SurfacePoints(this->mesh(), options.pointSpacing * field_.voxelSize());
    body_.bounds = bilayer::bounds(this->mesh());
    body_.margin = options.margin < 0 ? field_.voxelSize() : options.margin;
    body_.mass = massOf(this->mesh());
}

Collider::Collider(const LevelSet& levelSet)
    : triangles_(std::make_shared<Triangles>(levelSet)), field_(levelSet), body_(bodyOf(levelSet)) {}

const Mesh& Collider::mesh() const {
    return triangles_->mesh();
}

const MassProperties& Collider::mass() const {
    if (!body_.mass) throw std::invalid_argument("collider: the mesh encloses no volume");
    return *body_.mass;
}

ContactReport collide(const Placed& a, const Placed& b, const ContactOptions& options, std::vector<Contact>& contacts) {
    ContactReport report;
    const auto opposes = [&](const glm::vec3& normal, const Placed& body, const SurfacePoint& point,
                             const Touch& touch) {
        const bool apart = touch.distance > 0 && touch.approach == 0 && !point.isSharp;
        return options.keeps(-glm::dot(normal, body.pose.rotation * point.normal), apart);
    };
    samplePoints(a, b, options.margin, report, [&](std::uint32_t index, const SurfacePoint& point, const Touch& touch) {
        const glm::vec3 normal = outwardNormal(b, touch, a, point);
        if (!opposes(normal, a, point, touch)) return;
        const float distance = touch.distance * b.scale;
        contacts.push_back({a.pose.toWorld(a.scale * point.position) - distance * normal, normal, distance, index,
                            touch.approach * b.scale});
    });
    samplePoints(b, a, options.margin, report, [&](std::uint32_t index, const SurfacePoint& point, const Touch& touch) {
        const glm::vec3 normal = outwardNormal(a, touch, b, point);
        if (!opposes(normal, b, point, touch)) return;
        contacts.push_back({b.pose.toWorld(b.scale * point.position), -normal, touch.distance * a.scale,
                            index | featureOfB, touch.approach * a.scale});
    });
    return report;
}

}  // namespace bilayer
