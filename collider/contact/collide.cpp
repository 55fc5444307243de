// SPDX-License-Identifier: Apache-2.0
// Contacts between two bodies: the surface points of either body in the field of the other.
// Tested by tests/collider/collide.cpp through collide().
#include <bilayer/collider/contact.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "collider/contact/body/collider_data.h"
#include "collider/contact/distance/closest_points.h"
#include "collider/contact/reduction/contact_cache.h"
#include "collider/contact/reduction/finite_contacts.h"
#include "collider/contact/search/contact_range.h"
#include "collider/contact/search/normal_filter.h"
#include "collider/contact/search/points_in_field.h"
#include "collider/contact/search/sampled_contacts.h"
#include "collider/contact/search/surface_query.h"
#include "collider/contact/shapes/placed_shapes.h"
#include "collider/field/samples/field_data.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

namespace {

// The outward normal of `other` in the world. Where its field has none, the reversed normal of the surface point.
glm::vec3 contactNormal(const Placed& other, const SurfaceSample& sample, const Placed& body,
                        const SurfacePoint& point) {
    return sample.normal == glm::vec3(0) ? -(body.pose.rotation * point.normal) : other.pose.rotation * sample.normal;
}

// A point's plane crosses an edge if the normal of the other surface changes by more than the angle of this cosine (25
// degrees) within `beyondEdge` of the point [voxels]. Samples are too smooth within a voxel of an edge, which is 1.4
// voxels from a corner; a voxel above the surface, the normal changes half a voxel later. Elsewhere samples are better
// than the normals of facets.
constexpr float sharpCosine = 0.9f, beyondEdge = 2;

// The outward normals of a body's surface near places in the world; zero where they are unknown.
class NormalsNear {
  public:
    // @param maxDistance  from the surface beyond the band [m]; 0: none
    NormalsNear(const Placed& body, float maxDistance)
        : body_(body), surface_(body.collider, false, maxDistance > 0), maxDistance_(maxDistance / body.scale) {}

    // Whether a test holds for the normal near a place. Next to an edge that is the normal of the triangles, elsewhere
    // that of samples. The edge is looked for only if the two give different answers.
    // @param outward  the direction in which the edge is
    // @param test     bool (const glm::vec3& normal)
    template <class Test>
    bool holdsAt(const glm::vec3& place, const glm::vec3& outward, const Test& test) const {
        const glm::vec3 here = at(place, true);
        const bool holdsForTriangles = test(here), holdsForSamples = test(at(place, false));
        if (holdsForTriangles == holdsForSamples) return holdsForSamples;
        const float reach = beyondEdge * body_.scale * surface_.voxelSize();
        const bool isEdge = glm::dot(here, at(place + reach * outward, true)) < sharpCosine;
        return isEdge ? holdsForTriangles : holdsForSamples;
    }

  private:
    // @param byTriangles  if the field has them
    glm::vec3 at(const glm::vec3& place, bool byTriangles) const {
        const glm::vec3 point = body_.pose.toBody(place) / body_.scale;
        const Field& field = surface_.field();
        const Sample sample = field.sample(point);
        const bool isExact = byTriangles && field.mesh() && sample.inBand;
        const auto there =
            isExact ? surfaceSampleAt(field, point, sample, true) : surface_.at(point, sample, maxDistance_);
        return there ? body_.pose.rotation * there->normal : glm::vec3(0);
    }

    const Placed& body_;
    ContactField surface_;
    float maxDistance_;  // in the body's units
};

// Adds the contacts of A's points in the field of B, then of B's points in the field of A, as the visits find them.
template <class VisitA, class VisitB>
ContactReport addContacts(const Placed& a, const Placed& b, const ContactOptions& options, ContactRange range,
                          std::vector<Contact>& contacts, VisitA&& visitA, VisitB&& visitB) {
    ContactReport report;
    const auto normalsNear = [&](const Placed& other) {
        const float voxel = other.scale * other.collider.field().voxelSize();
        return NormalsNear(
            other, reachesBeyondBand(other, options.margin, range) ? options.margin + 2 * beyondEdge * voxel : 0);
    };
    const auto passes = [&](const glm::vec3& normal, const Placed& body, const Placed& other, const SurfacePoint& point,
                            const SurfaceSample& sample) {
        const glm::vec3 own = body.pose.rotation * point.normal;
        const auto facesEdge = [&] {
            const auto holdsAt = [&](const glm::vec3& place, auto&& test) {
                return normalsNear(other).holdsAt(place, glm::normalize(normal - glm::dot(normal, own) * own), test);
            };
            return facesEdgeObliquely(body.pose.toWorld(body.scale * point.position), own,
                                      sample.distance * other.scale, normal, holdsAt);
        };
        const bool isSeparated =
            sample.distance > -minFaceDepthVoxels * other.collider.field().voxelSize() && !point.isSharp;
        return passesNormalFilter(options, normal, own, body.motion.rotation - other.motion.rotation, isSeparated,
                                  facesEdge);
    };
    // points are fixed to their body, places between them are not
    const auto roundingRadiusOf = [](const Placed& body, std::uint32_t feature) {
        return feature < dataOf(body.collider).points().points().size() ? 0.f : -1.f;
    };
    const auto addOf = [&](const Placed& body, const Placed& other, bool isB) {
        return [&, isB](std::uint32_t index, const SurfacePoint& point, const SurfaceSample& sample) {
            const glm::vec3 normal = contactNormal(other, sample, body, point);
            if (!passes(normal, body, other, point, sample)) return;
            const glm::vec3 place = body.pose.toWorld(body.scale * point.position);
            const float distance = sample.distance * other.scale;
            contacts.push_back({isB ? place : place - distance * normal, isB ? -normal : normal, distance,
                                isB ? index | featureOfB : index, sample.approach * other.scale,
                                roundingRadiusOf(body, index)});
        };
    };
    const std::size_t first = contacts.size();
    visitA(PointsInField(a, b, options, range), report, addOf(a, b, false));
    const std::size_t second = contacts.size();
    visitB(PointsInField(b, a, options, range), report, addOf(b, a, true));
    // edges are found next to their points; sorting moves them after all points
    const auto byFeature = [](const Contact& one, const Contact& other) { return one.feature < other.feature; };
    std::stable_sort(contacts.begin() + std::ptrdiff_t(first), contacts.begin() + std::ptrdiff_t(second), byFeature);
    std::stable_sort(contacts.begin() + std::ptrdiff_t(second), contacts.end(), byFeature);
    return report;
}

}  // namespace

std::optional<PointQuery> pointQuery(const Placed& body, const Placed& other, float margin) {
    return PointsInField(body, other, {.margin = margin}, ContactRange::band).query();
}

SampledBody sampledBody(const Collider& collider) {
    const auto ballsOfPoints = [&collider] {
        BallsOfPoints balls;
        for (const SurfacePoint& point : dataOf(collider).points().points()) balls.points.push_back(point.position);
        dataOf(collider).points().tree().forEachLeaf(
            [](const auto&) { return false; },
            [&](const auto& leaf) {
                balls.balls.push_back({leaf.centre, leaf.radius, leaf.begin, leaf.end});
                return true;
            });
        return balls;
    };
    return {collider.id(), &dataOf(collider.field()), ballsOfPoints};
}

ContactReport collideFound(const Placed& a, const Placed& b, const ContactOptions& options,
                           std::span<const FoundPoint> ofA, std::span<const FoundPoint> ofB,
                           std::vector<Contact>& contacts) {
    const auto visit = [](std::span<const FoundPoint> some) {
        return [=](const PointsInField& points, ContactReport& report, const auto& found) {
            points.visitFound(some, report, found);
        };
    };
    const std::size_t first = contacts.size();
    const ContactReport report = addContacts(a, b, options, ContactRange::band, contacts, visit(ofA), visit(ofB));
    removeNonFinite(contacts, first);
    return report;
}

ContactReport collideWithin(ContactRange range, const Placed& a, const Placed& b, const ContactOptions& options,
                            std::vector<Contact>& contacts, ContactCache* cache) {
    for (const Placed* body : {&a, &b}) requireUnitRotation(body->pose);
    const auto visit = [](CandidateLists::List* list) {
        return
            [=](PointsInField points, ContactReport& report, const auto& found) { points.visit(list, report, found); };
    };
    const std::size_t first = contacts.size();
    CandidateLists* lists = cache ? &dataOf(*cache).candidates : nullptr;
    const ContactReport report = addContacts(a, b, options, range, contacts, visit(lists ? &lists->ofA : nullptr),
                                             visit(lists ? &lists->ofB : nullptr));
    if (options.exact) refineClosest(std::span(contacts).subspan(first), a, b);
    removeNonFinite(contacts, first);
    if (options.reduced) reduceFrom(first, contacts, a.pose, b.pose, relativeRotation(a.motion, b.motion), cache);
    return report;
}

}  // namespace bilayer::detail

namespace bilayer {

using namespace detail;

PointSampler::PointSampler(DeviceSampler sampler) : data_(std::make_shared<const DeviceSampler>(std::move(sampler))) {}

const std::string& PointSampler::backend() const {
    return data_->backend;
}

const std::string& PointSampler::device() const {
    return data_->device;
}

ContactReport collide(const Placed& a, const Placed& b, const ContactOptions& options, std::vector<Contact>& contacts,
                      ContactCache* cache) {
    return collideWithin(ContactRange::margin, a, b, options, contacts, cache);
}

}  // namespace bilayer
