// Contacts between two bodies: the surface points of either body in the field of the other. The point hierarchies are
// traversed with the relative pose, so that only points near the other body are sampled.
#include <bilayer/collider/contact.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <limits>
#include <optional>
#include <utility>

#include "collider/contact/collider_data.h"
#include "collider/contact/contact_cache.h"
#include "collider/contact/edge_search.h"
#include "collider/contact/motion.h"
#include "collider/contact/normal_filter.h"
#include "collider/contact/sampled_contacts.h"
#include "collider/contact/surface_query.h"
#include "collider/field/field_data.h"
#include "collider/field/interpolant.h"

namespace bilayer::detail {

namespace {

// Refinement of the closest points of a contact: max count of iterations, and the step at which they end [voxels].
constexpr int settlingTurns = 10;
constexpr float settled = 1e-4f;
// Max extrapolation, in lengths of the last step.
constexpr float farthestOn = 50;
// Min distance of the closest points that defines a direction [voxels].
constexpr float shortest = 1e-3f;
// Sharp points that penetrate another vertex see its sides. The surface that they oppose is looked up this far back
// along their normal [voxels].
constexpr float lift = 1;

// The transform from the coordinates of one body into those of another.
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
    glm::vec3 turned(const glm::vec3& direction) const { return linear * direction / scale; }

    // The same transform, into the coarse cells of a field's clearance.
    Map inParts(const Field& field) const {
        const float edge = float(Clearance::partSide) * field.voxelSize();
        Map map = *this;
        map.scale /= edge;
        map.linear *= 1 / edge;
        map.shift = glm::vec3((glm::dvec3(shift) - field.origin()) / double(edge));
        return map;
    }
};

// The speculative contact of a point outside the field with a displacement `way`.
std::optional<SurfaceSample> impactOnPath(const Field& field, const glm::vec3& point, const glm::vec3& way) {
    const auto hit = field.segment(point, point + way);
    if (!hit) return std::nullopt;
    return SurfaceSample{std::max(glm::dot(point - hit->position, hit->normal), 0.f), hit->normal,
                         -glm::dot(way, hit->normal)};
}

// The search for contacts of one body's surface points in the field of another.
class PointsInField {
  public:
    PointsInField(const Placed& body, const Placed& other, const ContactOptions& options)
        : body_(body),
          other_(other),
          field_(options.exact ? other.collider.exactField() : other.collider.field()),
          map_(body, other),
          coarse_(map_.inParts(field_)),
          relativeMotion_(body.pose, body.motion, other.pose, other.motion),
          clearance_(field_.data().coarse),
          options_(options),
          reach_(options.margin / other.scale) {
        const Bounds& bounds = body.collider.bounds();
        centre_ = bounds.centre();
        radius_ = 0.5f * glm::length(bounds.size());
        speculative_ =
            longestWay(centre_, radius_) > std::min(reach_, surelyInBand(field_.exteriorWidth(), field_.voxelSize()));
    }

    /// Calls found(index, point, touch) for the points within the margin of the surface, inside it, or predicted to hit
    /// it.
    template <class Found>
    void visit(CandidateLists::List* near, ContactReport& report, Found&& found) {
        if (!near || speculative_ || options_.exact) return visitAll(report, found);
        const float voxel = field_.voxelSize();
        // voxels outside the band have no values: a list must not reach that far
        const float maxSlack =
            std::min(voxel, (field_.exteriorWidth() - reach_) / steepestInterpolant - rounding * voxel);
        const CandidateLists::Place now{body_.collider.id(), other_.collider.id(), reach_, map_.linear, map_.shift};
        if (near->holds(now, centre_, radius_, voxel, maxSlack))
            visitListed(*near, report, found);
        else if (near->slack() > 0)
            visitAndList(*near, report, found);
        else
            visitAll(report, found);
    }

    /// The same for the points that a sampler has found.
    template <class Found>
    void visitFound(std::span<const FoundPoint> points, ContactReport& report, Found&& found) const {
        for (const auto& [index, sample] : points) {
            ++report.pointsTested;
            const SurfacePoint& point = body_.collider.data().points().points()[index];
            touch(index, point, map_(point.position), sample, report, found);
        }
    }

    /// The query for a sampler.
    std::optional<PointQuery> query() const {
        if (speculative_) return std::nullopt;
        return PointQuery{0, 0, map_.linear, map_.shift, map_.scale, reach_};
    }

  private:
    static constexpr float rounding = 1e-3f;  // [voxels]

    // An upper bound of the displacements of the body's points in a sphere, in the other body's units.
    float longestWay(const glm::vec3& centre, float radius) const {
        return relativeMotion_.longest(other_.scale * map_(centre), body_.scale * radius) / other_.scale;
    }

    // Max distance of points in a sphere that may make a contact.
    float seenFrom(const glm::vec3& centre, float radius) const {
        return speculative_ ? reach_ + longestWay(centre, radius) : reach_;
    }

    // Min distance at which points can be rejected [coarse cells].
    float keptWithin(float distance) const {
        return (distance / field_.voxelSize() + maxInterpolationError) / float(Clearance::partSide);
    }

    // @param kept  float (centre, radius): max distance of points in a sphere that may matter [coarse cells]
    template <class Kept, class Visit>
    void descend(Kept&& kept, Visit&& visit) const {
        const auto reject = [&](const glm::vec3& centre, float radius) {
            return clearance_.isOutside(coarse_(centre), radius * coarse_.scale + kept(centre, radius));
        };
        body_.collider.data().points().visit(reject, visit);
    }

    template <class Found>
    void visitAll(ContactReport& report, Found& found) {
        const auto kept = [&](const glm::vec3& centre, float radius) { return keptWithin(seenFrom(centre, radius)); };
        descend(kept, [&](std::uint32_t index, const SurfacePoint& point) {
            const glm::vec3 place = coarse_(point.position);
            const float seen = seenFrom(point.position, 0);
            const bool isAbove = !options_.exact && clearance_.isAbove(place, seen);  // or outside the band
            if (isAbove || clearance_.isOutside(place, keptWithin(seen))) return;
            const glm::vec3 at = map_(point.position);
            touch(index, point, at, sampleAt(at, report), report, found);
        });
    }

    // Lists the points that can touch before the bodies have moved by the slack. Until then the interpolant changes by
    // at most the max slope times the slack, and the distance by the slack.
    template <class Found>
    void visitAndList(CandidateLists::List& near, ContactReport& report, Found& found) {
        const float slack = near.slack(), above = reach_ + steepestInterpolant * slack, within = reach_ + slack,
                    beside = within + maxInterpolationError * field_.voxelSize(), kept = keptWithin(within);
        descend([&](const glm::vec3&, float) { return kept; },
                [&](std::uint32_t index, const SurfacePoint& point) {
                    const glm::vec3 place = coarse_(point.position);
                    if (clearance_.isAbove(place, above) || clearance_.isOutside(place, kept)) return;
                    const glm::vec3 at = map_(point.position);
                    const Sample sample = sampleAt(at, report);
                    if (sample.distance > (sample.inBand ? above : beside)) return;
                    near.add(index);
                    touch(index, point, at, sample, report, found);
                });
    }

    template <class Found>
    void visitListed(const CandidateLists::List& near, ContactReport& report, Found& found) {
        const auto points = body_.collider.data().points().points();
        for (const std::uint32_t index : near.points()) {
            const SurfacePoint& point = points[index];
            if (clearance_.isAbove(coarse_(point.position), reach_)) continue;
            const glm::vec3 at = map_(point.position);
            touch(index, point, at, sampleAt(at, report), report, found);
        }
    }

    Sample sampleAt(const glm::vec3& at, ContactReport& report) const {
        ++report.pointsTested;
        return field_.sampleWithin(at, reach_);
    }

    template <class Found>
    void touch(std::uint32_t index, const SurfacePoint& point, const glm::vec3& at, const Sample& sample,
               ContactReport& report, Found& found) const {
        if (!sample.inBand && sample.distance < 0) {
            ++report.beyondBand;
            return;
        }
        const auto here = sample.distance <= reach_ ? touchAt(at, sample, reach_) : std::nullopt;
        if (here && here->distance <= reach_) {
            SurfaceSample touched = point.isSharp && here->distance <= 0 ? opposed(point, at, *here) : *here;
            if (speculative_) touched.approach = approachOf(point, at, touched);
            found(index, point, touched);
            if (point.isSharp) followEdges(index, at, *here, found);
        } else if (speculative_) {
            const glm::vec3 way = displacementOf(at);
            if (sample.distance > glm::length(way) || !meets(point, at, way)) return;
            if (const auto touched = impactOnPath(field_, at, way)) found(index, point, *touched);
        }
    }

    // Also outside the band, up to a distance of `most`, if exact distances are requested.
    std::optional<SurfaceSample> touchAt(const glm::vec3& at, const Sample& sample, float most) const {
        if (sample.inBand)
            return surfaceSampleAt(field_, at, sample, other_.collider.data().isExactAt(at, options_.exact));
        if (!options_.exact || sample.distance < 0) return std::nullopt;
        const ClosestPoint closest = field_.closest(at, most);
        if (!closest.found) return std::nullopt;
        return SurfaceSample{closest.distance, directionOf(closest, at, field_.voxelSize())};
    }

    // For a sharp point in the other body that opposes no surface there, even on a medial axis. Returns the surface
    // that it opposes a little back along its own normal, if that place is outside.
    SurfaceSample opposed(const SurfacePoint& point, const glm::vec3& at, const SurfaceSample& here) const {
        const glm::vec3 normal = map_.turned(point.normal);
        const auto cosine = [&](const SurfaceSample& touch) { return -glm::dot(touch.normal, normal); };
        if (keeps(options_, cosine(here), false)) return here;
        const float back = lift * field_.voxelSize();
        const glm::vec3 outside = at - back * normal;
        const Sample sample = field_.sample(outside);
        if (!sample.inBand) return here;
        const SurfaceSample there =
            surfaceSampleAt(field_, outside, sample, other_.collider.data().isExactAt(outside, options_.exact));
        if (!(there.distance > 0) || !keeps(options_, cosine(there), false)) return here;
        return {std::min(there.distance - back * cosine(there), 0.f), there.normal};
    }

    float approachOf(const SurfacePoint& point, const glm::vec3& at, const SurfaceSample& touched) const {
        const glm::vec3 way = displacementOf(at);
        const float approach = -glm::dot(way, touched.normal);
        return approach > 0 && (touched.distance <= 0 || meets(point, at, way)) ? approach : 0;
    }

    // Whether a point's path into the field is more than a grazing hit: a point slightly inside its body also hits.
    bool meets(const SurfacePoint& point, const glm::vec3& at, const glm::vec3& way) const {
        const glm::vec3 normal = glm::normalize(map_.linear * point.normal);
        const glm::vec3 across = normal - glm::dot(normal, way) / glm::dot(way, way) * way;
        const glm::vec3 inside = at - grazingTolerance * field_.voxelSize() * across;
        return field_.segment(inside, inside + way).has_value();
    }

    // Finds edges that reach deeper between a touching point and the next one.
    template <class Found>
    void followEdges(std::uint32_t index, const glm::vec3& at, const SurfaceSample& here, Found& found) const {
        const SharpEdges& edges = body_.collider.data().edges();
        for (const std::uint32_t e : edges.around(index)) {
            const SharpEdge& edge = edges.edges()[e];
            const std::uint32_t next = edge.from == index ? edge.to : edge.from;
            const glm::vec3 end = map_(pointOf(next).position);
            const float length = glm::distance(at, end);
            const glm::vec3 along = (end - at) / length;
            const Sample sample = field_.sample(end);
            const auto there = touchAt(end, sample, reach_ + length);
            if (!there) continue;
            // if both ends touch, process the edge only once
            if (std::max(sample.distance, there->distance) <= reach_ && next < index) continue;
            const Slope from{0, here.distance, glm::dot(here.normal, along)},
                to{length, there->distance, glm::dot(there->normal, along)};
            if (!fallsBetween(from, to) && !mayKinkBetween(from, to)) continue;
            if (const auto touched = deepestOf(at, end, along, from, to, edge.conormals)) {
                const float part = touched->first / length;
                const SurfacePoint &a = pointOf(index), &b = pointOf(next);
                const SurfacePoint between{glm::mix(a.position, b.position, part), glm::normalize(a.normal + b.normal),
                                           true};
                found(std::uint32_t(body_.collider.data().points().points().size()) + e, between, touched->second);
            }
        }
    }

    // The position of the deepest point along an edge, and its contact.
    std::optional<std::pair<float, SurfaceSample>> deepestOf(const glm::vec3& at, const glm::vec3& end,
                                                             const glm::vec3& along, const Slope& from, const Slope& to,
                                                             const Conormals& conormals) const {
        const auto touchOn = [&](float way) {
            const glm::vec3 place = at + way * along;
            return touchAt(place, field_.sample(place), reach_ + to.place);
        };
        const auto slopeAt = [&](float way) -> std::optional<Slope> {
            const auto touched = touchOn(way);
            if (!touched) return std::nullopt;
            return Slope{way, touched->distance, glm::dot(touched->normal, along)};
        };
        const bool falls = fallsBetween(from, to);
        const std::optional<Slope> lowest = falls
                                                ? lowestBetween(from, to, searchTolerance * field_.voxelSize(), slopeAt)
                                            : from.value < to.value ? from
                                                                    : to;
        const auto touched = lowest ? touchOn(lowest->place) : std::nullopt;
        if (!touched) return std::nullopt;

        const glm::vec3 place = at + lowest->place * along;
        const Conormals seen{map_.turned(conormals[0]), map_.turned(conormals[1])};
        if (const auto crossing = other_.collider.data().edges().crossing(
                other_.collider.data().points(), at, end, seen, place, touched->distance, field_.voxelSize())) {
            if (crossing->distance > reach_) return std::nullopt;
            const glm::vec3 onEdge = crossing->position + crossing->distance * crossing->normal;
            return std::pair(glm::dot(onEdge - at, along), SurfaceSample{crossing->distance, crossing->normal});
        }
        if (!falls) return std::nullopt;
        const float aside = 2 * searchTolerance * field_.voxelSize();
        const auto held = acrossEdge(along, *touched, touchOn(lowest->place - aside), touchOn(lowest->place + aside));
        if (!held || held->distance > reach_) return std::nullopt;
        return std::pair(lowest->place, *held);
    }

    const SurfacePoint& pointOf(std::uint32_t index) const { return body_.collider.data().points().points()[index]; }

    glm::vec3 displacementOf(const glm::vec3& at) const { return relativeMotion_.of(other_.scale * at) / other_.scale; }

    const Placed &body_, &other_;
    const Field& field_;
    Map map_, coarse_;
    RelativeMotion relativeMotion_;
    Clearance clearance_;
    ContactOptions options_;
    float reach_;
    glm::vec3 centre_;  // of a bounding sphere of the body
    float radius_;
    bool speculative_;  // some point moves farther than the range in which contacts are certainly found
};

// The outward normal of `other` in the world. Where its field has none, the reversed normal of the touching point.
glm::vec3 outwardNormal(const Placed& other, const SurfaceSample& touch, const Placed& body,
                        const SurfacePoint& point) {
    return touch.normal == glm::vec3(0) ? -(body.pose.rotation * point.normal) : other.pose.rotation * touch.normal;
}

// The outward normal of the surface near a place in the world; zero where the field has none.
glm::vec3 normalNear(const Placed& body, const glm::vec3& place) {
    const glm::vec3 at = body.pose.toBody(place) / body.scale;
    const Field& field = body.collider.field();
    const Sample sample = field.sample(at);
    if (!sample.inBand) return glm::vec3(0);
    return body.pose.rotation * surfaceSampleAt(field, at, sample, body.collider.data().isExactAt(at)).normal;
}

// Adds the contacts of A's points in the field of B, then of B's points in the field of A, as the visits find them.
template <class VisitA, class VisitB>
ContactReport addContacts(const Placed& a, const Placed& b, const ContactOptions& options,
                          std::vector<Contact>& contacts, VisitA&& visitA, VisitB&& visitB) {
    ContactReport report;
    const auto opposes = [&](const glm::vec3& normal, const Placed& body, const Placed& other,
                             const SurfacePoint& point, const SurfaceSample& touch) {
        const bool apart = touch.distance > 0 && !point.isSharp;
        const glm::vec3 own = body.pose.rotation * point.normal;
        if (!keeps(options, normal, own, body.motion.rotation - other.motion.rotation, apart)) return false;
        if (options.keepsObliqueEdges || !apart || touch.approach > 0) return true;
        return !seesEdgeObliquely(body.pose.toWorld(body.scale * point.position), own, touch.distance * other.scale,
                                  normal, [&](const glm::vec3& place) { return normalNear(other, place); });
    };
    // points are fixed to their body, places between them are not
    const auto turningRadiusOf = [](const Placed& body, std::uint32_t feature) {
        return feature < body.collider.data().points().points().size() ? 0.f : -1.f;
    };
    const auto addOfA = [&](std::uint32_t index, const SurfacePoint& point, const SurfaceSample& touch) {
        const glm::vec3 normal = outwardNormal(b, touch, a, point);
        if (!opposes(normal, a, b, point, touch)) return;
        const float distance = touch.distance * b.scale;
        contacts.push_back({a.pose.toWorld(a.scale * point.position) - distance * normal, normal, distance, index,
                            touch.approach * b.scale, turningRadiusOf(a, index)});
    };
    const auto addOfB = [&](std::uint32_t index, const SurfacePoint& point, const SurfaceSample& touch) {
        const glm::vec3 normal = outwardNormal(a, touch, b, point);
        if (!opposes(normal, b, a, point, touch)) return;
        contacts.push_back({b.pose.toWorld(b.scale * point.position), -normal, touch.distance * a.scale,
                            index | featureOfB, touch.approach * a.scale, turningRadiusOf(b, index)});
    };
    const std::size_t first = contacts.size();
    visitA(PointsInField(a, b, options), report, addOfA);
    const std::size_t second = contacts.size();
    visitB(PointsInField(b, a, options), report, addOfB);
    // edges are found next to their points; sorting moves them after all points
    const auto byFeature = [](const Contact& one, const Contact& other) { return one.feature < other.feature; };
    std::stable_sort(contacts.begin() + std::ptrdiff_t(first), contacts.begin() + std::ptrdiff_t(second), byFeature);
    std::stable_sort(contacts.begin() + std::ptrdiff_t(second), contacts.end(), byFeature);
    return report;
}

// The closest point on a body's surface for a place outside it, in world coordinates.
std::optional<glm::vec3> closestOn(const Placed& body, const glm::vec3& place, float most) {
    const ClosestPoint closest =
        body.collider.exactField().closest(body.pose.toBody(place) / body.scale, most / body.scale);
    if (!closest.found || closest.distance < 0) return std::nullopt;
    return body.pose.toWorld(body.scale * closest.position);
}

// Refines the closest points of a contact by alternating projection. Edges made of surface points may cut across the
// surface between these. Where round bodies nearly touch, convergence is slow; A. C. Aitken's extrapolation accelerates
// it.
void settle(Contact& contact, const Placed& a, const Placed& b) {
    const float voxel = b.scale * b.collider.field().voxelSize();
    const auto turned = [&](const glm::vec3& place) -> std::optional<Contact> {
        const auto onA = closestOn(a, place, contact.distance + voxel);
        const auto onB = onA ? closestOn(b, *onA, contact.distance + voxel) : std::nullopt;
        if (!onB) return std::nullopt;
        const glm::vec3 way = *onA - *onB;
        const float distance = glm::length(way);
        const glm::vec3 normal = distance > shortest * voxel ? way / distance : contact.normal;
        return Contact{*onB, normal, distance, contact.feature, contact.approach, contact.turningRadius};
    };
    glm::vec3 before(0);  // displacement of the closest point in the last iteration
    for (int turn = 0; turn < settlingTurns; ++turn) {
        const auto next = turned(contact.position);
        if (!next) return;
        const glm::vec3 gone = next->position - contact.position;
        contact = *next;
        if (!(glm::length(gone) > settled * voxel)) return;
        const float ratio = glm::dot(gone, before) / glm::dot(before, before);
        before = gone;
        if (!(ratio > 0 && ratio < 1)) continue;
        const auto beyond = turned(contact.position + std::min(ratio / (1 - ratio), farthestOn) * gone);
        if (!beyond || beyond->distance >= contact.distance) continue;
        contact = *beyond;
        before = glm::vec3(0);
    }
}

// Refines the contacts that may be the closest.
void settle(std::span<Contact> contacts, const Placed& a, const Placed& b) {
    float nearest = std::numeric_limits<float>::max();
    for (const Contact& contact : contacts) nearest = std::min(nearest, contact.distance);
    for (Contact& contact : contacts)
        if (contact.distance > 0 && contact.distance < nearest + b.scale * b.collider.field().voxelSize())
            settle(contact, a, b);
}

}  // namespace

std::optional<PointQuery> pointQuery(const Placed& body, const Placed& other, float margin) {
    return PointsInField(body, other, {.margin = margin}).query();
}

SampledBody sampledBody(const Collider& collider) {
    const auto ballsOfPoints = [&collider] {
        BallsOfPoints balls;
        for (const SurfacePoint& point : collider.data().points().points()) balls.points.push_back(point.position);
        const auto nodes = collider.data().points().nodes();
        for (std::uint32_t i = 0; i < nodes.size(); ++i)
            if (nodes[i].next == i + 1)
                balls.balls.push_back({nodes[i].centre, nodes[i].radius, nodes[i].begin, nodes[i].end});
        return balls;
    };
    return {collider.id(), &collider.field().data(), ballsOfPoints};
}

ContactReport collideFound(const Placed& a, const Placed& b, const ContactOptions& options,
                           std::span<const FoundPoint> ofA, std::span<const FoundPoint> ofB,
                           std::vector<Contact>& contacts) {
    const auto visit = [](std::span<const FoundPoint> some) {
        return [=](const PointsInField& points, ContactReport& report, const auto& found) {
            points.visitFound(some, report, found);
        };
    };
    return addContacts(a, b, options, contacts, visit(ofA), visit(ofB));
}

}  // namespace bilayer::detail

namespace bilayer {

using namespace detail;

ContactCache::ContactCache() : data_(std::make_unique<CandidateLists>()) {}
ContactCache::~ContactCache() = default;
ContactCache::ContactCache(ContactCache&&) noexcept = default;
ContactCache& ContactCache::operator=(ContactCache&&) noexcept = default;

ContactReport collide(const Placed& a, const Placed& b, const ContactOptions& options, std::vector<Contact>& contacts,
                      ContactCache* cache) {
    const auto visit = [](CandidateLists::List* list) {
        return
            [=](PointsInField points, ContactReport& report, const auto& found) { points.visit(list, report, found); };
    };
    const std::size_t first = contacts.size();
    const ContactReport report = addContacts(a, b, options, contacts, visit(cache ? &cache->data().ofA : nullptr),
                                             visit(cache ? &cache->data().ofB : nullptr));
    if (options.exact) settle(std::span(contacts).subspan(first), a, b);
    return report;
}

}  // namespace bilayer
