#include "integration/bullet/narrow.h"

#include <BulletCollision/CollisionShapes/btTriangleCallback.h>
#include <LinearMath/btAabbUtil2.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <limits>
#include <map>
#include <optional>

#include "collider/edge_search.h"
#include "collider/interpolant.h"
#include "collider/path.h"
#include "collider/touch.h"
#include "integration/bullet/convert.h"

namespace bilayer::bullet {

namespace {

// Edges get no more parts: numbers beyond are those of the next edge.
constexpr int partBits = 15;
// Of what is found of a triangle: three edges, three corners, and from here on what lies over it.
constexpr std::uint32_t overPoints = 6;
constexpr float searchTolerance = 2e-3f;  // of the deepest place between two probes [voxels]
// Where a field's edge is deepest in a round body, the normal across it looks no farther aside from the body's
// (cosine).
constexpr float leastAcross = 0.3f;
// A surface point touches a face that looks against its own normal, by this cosine at least: the points below the edge
// of a box must not be pushed out sideways. The corners of a cube, whose normals are mixed of three, reach 0.57.
// Those of faces that do not touch yet: farther aslant is an edge of the other body beside them.
constexpr ContactOptions opposition{.leastOpposition = 0.3f, .leastOppositionApart = 0.9f, .keepsEdgesAslant = false};
// Steps towards the deepest place of a round surface; each divides the error by the ratio of the radii of curvature.
constexpr int mostRefinements = 6;
// A point lies over a face if it is no farther beyond its sides than this [probe spacings]: rounding.
constexpr float onFace = 1e-4f;
// Triangles whose wings enclose more than 179.9 degrees (cosine) have no edge between them.
constexpr float flatEdge = -0.9999985f;
// Faces that fall by less lie on what they touch: the next surface points are as deep to a hundredth of a voxel.
constexpr float leastDownhill = 0.05f;
constexpr float touchingFace = 0.25f;  // [voxels]
// What a face's place sees of a body nearer than this touches the face [voxels]: beside an edge or a corner, normals
// are mixed there.
constexpr float touchingFoot = 0.05f;
// What looks at a face by less (cosine) does not tell on which side of it its body is.
constexpr float leastFacing = 0.1f;
// A side that looks the other way by this (cosine) is the far one of what is thin.
constexpr float farSide = -0.8f;
// Normals that enclose less than a degree are those of one face (cosine).
constexpr float straight = 0.99985f;
// A way has met a convex body where it is this near to it [voxels]: by more, it would meet edges that it goes past.
constexpr float sweepTolerance = 1e-3f;
// By less than this a way only grazes, and goes past [voxels].
constexpr float grazing = 0.25f;
// The feature of what is lowest over a plane, for contact tests: no surface point's, no edge's.
constexpr std::uint32_t lowestVertex = featureOfB - 1;

/// A field in metres of the world and the axes of its body, and how another body moves towards it.
class Local {
  public:
    /// @param reach     up to which contacts are made [m]
    /// @param measured  as in ContactOptions
    Local(const Placed& field, const Pose& other, const Motion& motion, float reach, bool measured)
        : collider_(field.collider),
          field_(measured ? field.collider.measured() : field.collider.field()),
          measured_(measured),
          scale_(field.scale),
          voxel_(field.scale * field.collider.field().voxelSize()),
          pose_(field.pose),
          ways_(other, motion, field.pose, field.motion) {
        const Bounds& bounds = field.collider.bounds();
        if (reach > surelyInBand(scale_ * field_.exteriorWidth(), voxel_)) farReach_ = reach / scale_;
        exactReach_ = reach + mostInterpolationError * voxel_;
        longestWay_ = ways_.longest(scale_ * bounds.centre(), 0.5f * scale_ * glm::length(bounds.size()));
    }

    const Collider& collider() const { return collider_; }
    /// Of the other body's points as the field sees them.
    const RelativeWays& ways() const { return ways_; }
    /// The longest way of any that is in the field's box; those that come from afar may go farther by their turn.
    float longestWay() const { return longestWay_; }

    struct Answer {
        enum { near, outside, inside, unclear } where = unclear;
        float distance = 0;   ///< [m]
        glm::vec3 normal{0};  ///< of unit length if near
        glm::vec3 gradient{0};

        bool isKnown() const { return where == near || where == unclear; }
    };

    /// @param radius  by which the point is grown [m]
    Answer at(const glm::vec3& point, float radius = 0) const {
        const Sample sample = field_.sample(point / scale_);
        if (!sample.inBand && sample.distance > 0 && farReach_ > 0) return farAway(point, radius, sample.distance);
        if (!sample.inBand) return {sample.distance > 0 ? Answer::outside : Answer::inside, scale_ * sample.distance};
        if (scale_ * sample.distance - radius <= exactReach_ && collider_.asksTriangles(point / scale_, measured_))
            return exactly(point, sample);
        const glm::vec3 normal = directionOf(sample, field_.voxelSize());
        const auto where = normal == glm::vec3(0) ? Answer::unclear : Answer::near;
        return {where, scale_ * sample.distance, normal, sample.gradient};
    }

    /// The contact of a point of the other body's core, grown by a radius.
    std::optional<Contact> probe(const glm::vec3& point, const Answer& answer, float radius, std::uint32_t feature,
                                 float margin, ContactReport& report) const {
        ++report.pointsTested;
        if (answer.where == Answer::inside) ++report.beyondBand;
        if (answer.distance - radius > margin) return probeOnWay(point, radius, feature, margin, answer.distance);
        if (answer.where != Answer::near) return std::nullopt;
        return turning(contact(point - answer.distance * answer.normal, answer.normal, answer.distance - radius,
                               feature, approach(point, answer.normal, margin)),
                       radius);
    }

    /// An edge of the other body, or the middle of one that is round.
    struct Edge {
        std::function<glm::vec3(float)> place;  ///< by the part of the way
        float radius[2];                        ///< by which it is grown at its ends [m]
        bool isStraight;
        std::uint32_t feature;       ///< the first of 2^(partBits + 1)
        std::optional<Wings> wings;  ///< of a sharp edge between two faces
        bool isSearched = true;      ///< between the probes

        float radiusAt(float part) const { return radius[0] + part * (radius[1] - radius[0]); }
        glm::vec3 directionAt(float part) const {
            const float aside = isStraight ? 0.5f : 1e-3f;
            return glm::normalize(place(part + aside) - place(part - aside));
        }
    };

    /// The contacts along an edge, ends excluded: of places that lie close enough to each other, and where it goes
    /// deeper between two of them of the deepest one.
    /// @param first, last  the answers at its ends
    void probeEdge(const Edge& edge, const Answer& first, const Answer& last, float margin, ContactReport& report,
                   std::vector<Contact>& contacts) const {
        const float length = glm::distance(edge.place(0), edge.place(1));
        if (!(length > 0)) return;
        // farther from the field the probes get sparser
        const int parts = probeParts(length, voxel_, (1 << partBits) - 1);
        const float way = ways_.longest(edge.place(0.5f), length);
        const float reach = margin + way + mostInterpolationError * voxel_ + std::max(edge.radius[0], edge.radius[1]);
        if (edge.isStraight && !comesNear(edge.place(0), edge.place(1), reach)) return;
        Answer before = first;
        for (int i = 0; i < parts;) {
            // What is clear of everything needs no probes.
            const float clear = (before.distance - reach) * float(parts) / length;
            const int next = i + std::max(1, int(std::min(clear, float(parts - i))));
            const float part = float(next) / float(parts);
            Answer there = last;
            if (next < parts) {
                const glm::vec3 point = edge.place(part);
                there = at(point, edge.radiusAt(part));
                const std::uint32_t feature = edge.feature + 2 * std::uint32_t(next);
                if (const auto found = probe(point, there, edge.radiusAt(part), feature, margin, report))
                    contacts.push_back(*found);
            }
            if (edge.isSearched && next == i + 1)
                if (const auto found = deepestBetween(edge, float(i) / float(parts), before, part, there, margin)) {
                    contacts.push_back(*found);
                    contacts.back().feature = edge.feature + 2 * std::uint32_t(i) + 1;
                }
            i = next;
            before = there;
        }
    }

    /// Contact::approach of the other body's point.
    float approach(const glm::vec3& point, const glm::vec3& normal, float margin) const {
        return longestWay_ > margin ? std::max(-glm::dot(ways_.of(point), normal), 0.f) : 0;
    }

    Contact contact(const glm::vec3& position, const glm::vec3& normal, float distance, std::uint32_t feature,
                    float approach = 0) const {
        return {pose_.toWorld(position), pose_.rotation * normal, distance, feature, approach};
    }

    /// Where an edge between two of its places is deepest, if it falls from either, or crosses a sharp edge.
    std::optional<Contact> deepestBetween(const Edge& edge, float from, const Answer& atFrom, float to,
                                          const Answer& atTo, float margin) const;

  private:
    static Contact turning(Contact contact, float radius) {
        contact.turningRadius = radius;
        return contact;
    }

    /// Whether a straight line gets as near as this to the box around the surface.
    bool comesNear(const glm::vec3& from, const glm::vec3& to, float reach) const {
        const Bounds& bounds = collider_.bounds();
        const double length = glm::distance(from, to);
        const Path path{from, glm::dvec3(to - from) / length, length};
        return clip(path, scale_ * bounds.lower - reach, scale_ * bounds.upper + reach).has_value();
    }

    /// The same for a point that is farther away: where its way meets the surface.
    std::optional<Contact> probeOnWay(const glm::vec3& point, float radius, std::uint32_t feature, float margin,
                                      float distance) const {
        if (longestWay_ <= margin) return std::nullopt;
        const glm::vec3 way = ways_.of(point);
        const float length = glm::length(way);
        if (distance - radius > length) return std::nullopt;
        const Ray ray{point / scale_, way, length / scale_};
        const auto hit = radius > 0 ? field_.sphereCast(ray, radius / scale_) : field_.raycast(ray);
        if (!hit) return std::nullopt;
        const float gap = glm::dot(point - scale_ * hit->position, hit->normal);
        return turning(contact(point - gap * hit->normal, hit->normal, std::max(gap - radius, 0.f), feature,
                               -glm::dot(way, hit->normal)),
                       radius);
    }

    /// By the triangles, in the band.
    Answer exactly(const glm::vec3& point, const Sample& sample) const {
        const Touch touch = touchInBand(field_, point / scale_, sample, true);
        if (touch.normal == glm::vec3(0)) return {Answer::unclear, scale_ * touch.distance, {}, sample.gradient};
        return {Answer::near, scale_ * touch.distance, touch.normal, touch.normal};
    }

    /// Beyond the band, where a contact test asks for more than the band tells.
    Answer farAway(const glm::vec3& point, float radius, float bound) const {
        const ClosestPoint closest = field_.closest(point / scale_, farReach_ + radius / scale_);
        if (!closest.found) return {Answer::outside, std::max(scale_ * bound, scale_ * farReach_ + radius)};
        const glm::vec3 normal = (point / scale_ - closest.position) / closest.distance;
        return {Answer::near, scale_ * closest.distance, normal, normal};
    }

    const Collider& collider_;
    const Field& field_;
    bool measured_;
    float scale_, voxel_;
    Pose pose_;
    RelativeWays ways_;
    float longestWay_;
    float exactReach_;    ///< up to which triangles are asked, where the field has any [m]
    float farReach_ = 0;  ///< where contacts are asked for beyond the band; in the field's size
};

std::optional<Contact> Local::deepestBetween(const Edge& edge, float from, const Answer& atFrom, float to,
                                             const Answer& atTo, float margin) const {
    if (!atFrom.isKnown() || !atTo.isKnown()) return std::nullopt;
    const float length = glm::distance(edge.place(from), edge.place(to));
    // no longer than rounding, it leads nowhere
    if (!(length > searchTolerance * voxel_)) return std::nullopt;
    const float growth = (edge.radius[1] - edge.radius[0]) * (to - from) / length;
    const auto partAt = [&](float way) { return from + way / length * (to - from); };
    const auto slopeOf = [&](float way, const Answer& answer) {
        const float part = partAt(way);
        return Slope{way, answer.distance - edge.radiusAt(part),
                     glm::dot(answer.gradient, edge.directionAt(part)) - growth};
    };
    const Slope first = slopeOf(0, atFrom), last = slopeOf(length, atTo);
    const bool isNear = std::min(first.value, last.value) - 0.5f * length <= margin;
    const bool falls = fallsBetween(first, last);
    if (!isNear || !(falls || mayKinkBetween(first, last))) return std::nullopt;
    const auto slopeAt = [&](float way) -> std::optional<Slope> {
        const float part = partAt(way);
        const Answer answer = at(edge.place(part), edge.radiusAt(part));
        if (!answer.isKnown()) return std::nullopt;
        return slopeOf(way, answer);
    };
    const std::optional<Slope> lowest = falls ? lowestBetween(first, last, searchTolerance * voxel_, slopeAt)
                                        : first.value < last.value ? first
                                                                   : last;
    if (!lowest) return std::nullopt;

    const float part = partAt(lowest->place), radius = edge.radiusAt(part);
    const glm::vec3 point = edge.place(part);
    const Answer here = at(point, radius);
    if (edge.wings && radius <= 0)
        if (const auto crossing =
                collider_.edges().crossing(collider_.points(), edge.place(0) / scale_, edge.place(1) / scale_,
                                           *edge.wings, point / scale_, here.distance / scale_, voxel_ / scale_)) {
            if (scale_ * crossing->distance > margin) return std::nullopt;
            return contact(scale_ * crossing->position, crossing->normal, scale_ * crossing->distance, 0,
                           approach(point, crossing->normal, margin));
        }
    if (!falls || here.where != Answer::near) return std::nullopt;
    const auto touchAt = [&](float way) -> std::optional<Touch> {
        const Answer answer = at(edge.place(partAt(way)), radius);
        if (answer.where != Answer::near) return std::nullopt;
        return Touch{answer.distance, answer.normal};
    };
    const float aside = 2 * searchTolerance * voxel_;
    const auto held = acrossEdge(edge.directionAt(part), Touch{here.distance, here.normal},
                                 touchAt(lowest->place - aside), touchAt(lowest->place + aside));
    if (!held || held->distance - radius > margin) return std::nullopt;
    return contact(point - held->distance * held->normal, held->normal, held->distance - radius, 0,
                   approach(point, held->normal, margin));
}

/// A convex body in the coordinates of a Local field.
class Touching {
  public:
    Touching(const Convex& convex, const Pose& pose, const Motion& motion, const Placed& field, float margin,
             bool measured)
        : convex_(convex),
          local_(field, pose, motion, margin, measured),
          margin_(margin),
          measured_(measured),
          scale_(field.scale),
          voxel_(field.scale * field.collider.field().voxelSize()) {
        const Pose inField = relative(field.pose, pose);
        toField_ = glm::mat3(inField.rotation);
        toConvex_ = glm::transpose(toField_);
        origin_ = inField.position;
        // the deepest place of an edge is no farther than half of it from one of its ends
        if (convex.isCurved()) edgeReach_ += 0.5f * scale_ * field.collider.edges().longest();
    }

    bool reject(const glm::vec3& centre, float radius) const {
        const float way = local_.ways().longest(scale_ * centre, scale_ * radius);
        const float reach = scale_ * radius + std::max(edgeReach_, margin_ + way);
        return convex_.nearest(intoConvex(scale_ * centre), reach).distance > reach;
    }

    /// A surface point against the convex body's formula.
    void visit(std::uint32_t index, const SurfacePoint& point, ContactReport& report,
               std::vector<Contact>& contacts) const {
        ++report.pointsTested;
        const glm::vec3 position = scale_ * point.position;
        const std::uint32_t feature = index | featureOfB;
        const Convex::Near near = convex_.nearest(intoConvex(position), edgeReach_);
        if (convex_.isCurved() && point.isSharp && near.distance <= edgeReach_) followEdges(index, near, contacts);
        if (near.distance > margin_) return visitOnWay(position, point, feature, near.distance, contacts);
        const glm::vec3 normal = -(toField_ * near.normal);
        float approach = local_.approach(position, normal, margin_);
        if (near.distance > 0 && approach > 0 && !meets(position, point)) approach = 0;
        // What is round has no edge that a point could see aslant.
        const bool apart = near.distance > 0 && !point.isSharp && !convex_.isRound(near) && !measured_;
        if (!opposition.keeps(-normal, point.normal, -local_.ways().turn(), apart)) return;
        if (apart && approach == 0 &&
            looksAtEdge(intoConvex(position), toConvex_ * point.normal, near.distance, near.normal,
                        [&](const glm::vec3& place) { return convex_.nearest(place, edgeReach_).normal; }))
            return;
        if (!convex_.isFlat(near)) {
            // corners and edges are exact, and samples next to them are not
            const auto better = refine(near, feature);
            if (better && !(point.isSharp && near.distance < better->distance)) {
                contacts.push_back(*better);
                return;
            }
        } else if (!point.isSharp) {
            const glm::vec3 place = intoField(near.core + near.radius * near.normal);
            if (auto deeper = downhill(near, place, local_.at(place))) {
                deeper->feature = feature;
                deeper->turningRadius = 0;
                contacts.push_back(*deeper);
                return;
            }
        }
        contacts.push_back(local_.contact(position, normal, near.distance, feature, approach));
        contacts.back().turningRadius = 0;
    }

    /// The convex body's own corners and edges in the field.
    void visitProbes(ContactReport& report, std::vector<Contact>& contacts) const {
        const auto corners = convex_.corners();
        std::vector<Local::Answer> answers;
        for (std::uint32_t i = 0; i < corners.size(); ++i) {
            const glm::vec3 point = intoField(corners[i]);
            answers.push_back(local_.at(point, convex_.radius(i)));
            if (const auto found = local_.probe(point, answers[i], convex_.radius(i), i, margin_, report))
                contacts.push_back(*found);
        }
        auto number = static_cast<std::uint32_t>(corners.size());
        for (const Convex::Edge& edge : convex_.edges()) {
            Local::Edge seen{[&](float part) { return intoField(convex_.place(edge, part)); },
                             {convex_.radius(edge, 0), convex_.radius(edge, 1)},
                             !(edge.rim > 0),
                             number,
                             edge.wings};
            if (edge.wings) seen.wings = Wings{toField_ * (*edge.wings)[0], toField_ * (*edge.wings)[1]};
            local_.probeEdge(seen, answers[edge.from], answers[edge.to], margin_, report, contacts);
            number = (number + (2u << partBits)) & ~featureOfB;
        }
    }

  private:
    glm::vec3 intoConvex(const glm::vec3& point) const { return toConvex_ * (point - origin_); }
    glm::vec3 intoField(const glm::vec3& point) const { return toField_ * point + origin_; }

    /// Where a way meets the convex body, both in that one's coordinates.
    std::optional<Convex::Entry> meeting(const glm::vec3& start, const glm::vec3& way) const {
        return convex_.enter(start, way, sweepTolerance * voxel_);
    }

    glm::vec3 wayIntoConvex(const glm::vec3& position) const { return -(toConvex_ * local_.ways().of(position)); }

    /// Whether a surface point's way does more than graze the convex body (see collide()).
    bool meets(const glm::vec3& position, const SurfacePoint& point) const {
        const glm::vec3 way = wayIntoConvex(position), normal = toConvex_ * point.normal;
        const glm::vec3 across = normal - glm::dot(normal, way) / glm::dot(way, way) * way;
        return meeting(intoConvex(position) - grazing * voxel_ * across, way).has_value();
    }

    /// The same as visit() for a point that is farther away.
    void visitOnWay(const glm::vec3& position, const SurfacePoint& point, std::uint32_t feature, float distance,
                    std::vector<Contact>& contacts) const {
        if (local_.longestWay() <= margin_) return;
        const glm::vec3 way = wayIntoConvex(position);
        if (distance > glm::length(way) || !meets(position, point)) return;
        const auto met = meeting(intoConvex(position), way);
        if (!met) return;
        const float gap = -glm::dot(met->near.normal, met->part * way);  // to the plane that is met
        if (!(gap > 0)) return;
        const glm::vec3 normal = -(toField_ * met->near.normal);
        const bool apart = !point.isSharp && !convex_.isRound(met->near);
        if (!opposition.keeps(-normal, point.normal, -local_.ways().turn(), apart)) return;
        contacts.push_back(local_.contact(position, normal, gap, feature, -glm::dot(met->near.normal, way)));
        contacts.back().turningRadius = 0;
    }

    /// Where sharp edges of the field go deeper into a round body from a point that touches before they come up again.
    void followEdges(std::uint32_t index, const Convex::Near& near, std::vector<Contact>& contacts) const {
        const Collider& collider = local_.collider();
        const auto points = collider.points().points();
        const SharpEdges& edges = collider.edges();
        for (const std::uint32_t e : edges.around(index)) {
            const SharpEdge& edge = edges.edges()[e];
            const std::uint32_t next = edge.from == index ? edge.to : edge.from;
            const glm::vec3 from = intoConvex(scale_ * points[index].position),
                            to = intoConvex(scale_ * points[next].position);
            const float length = glm::distance(from, to);
            const glm::vec3 along = (to - from) / length;
            const auto nearAt = [&](float way) { return convex_.nearest(from + way * along, edgeReach_); };
            const auto slopeOf = [&](float way, const Convex::Near& there) {
                return Slope{way, there.distance, glm::dot(there.normal, along)};
            };
            const Convex::Near there = nearAt(length);
            const Slope first = slopeOf(0, near), last = slopeOf(length, there);
            // Where both ends are within reach, one of them is enough.
            const bool isOther = there.distance <= edgeReach_ && next < index;
            if (!fallsBetween(first, last) || isOther) continue;
            const auto lowest =
                lowestBetween(first, last, searchTolerance * scale_ * collider.field().voxelSize(),
                              [&](float way) { return std::optional<Slope>(slopeOf(way, nearAt(way))); });
            const Convex::Near deepest = nearAt(lowest->place);
            const glm::vec3 across = deepest.normal - glm::dot(deepest.normal, along) * along;
            const float steepness = glm::length(across);
            const glm::vec3 normal = -(toField_ * across) / steepness;
            const float distance = deepest.distance < 0 ? deepest.distance / steepness : deepest.distance;
            const bool opposes = opposition.keeps(glm::dot(normal, points[index].normal + points[next].normal), false);
            if (!(steepness > leastAcross) || distance > margin_ || !opposes) continue;
            const glm::vec3 place = intoField(from + lowest->place * along);
            contacts.push_back(local_.contact(place, normal, distance, (std::uint32_t(points.size()) + e) | featureOfB,
                                              local_.approach(place, normal, margin_)));
        }
    }

    /// Follows the field's normal from the place of a round surface under a surface point to the deepest place nearby.
    std::optional<Contact> refine(const Convex::Near& near, std::uint32_t feature) const {
        glm::vec3 place = intoField(near.core + near.radius * near.normal);
        Local::Answer here = local_.at(place);
        if (here.where != Local::Answer::near) return std::nullopt;
        for (int i = 0; i < mostRefinements; ++i) {
            const glm::vec3 next = intoField(convex_.slide(near, -(toConvex_ * here.normal)));
            const Local::Answer there = local_.at(next);
            if (there.where != Local::Answer::near || !(there.distance < here.distance)) break;
            place = next;
            here = there;
        }
        std::optional<Contact> found = downhill(near, place, here);
        if (!found && here.distance <= margin_)
            found = local_.contact(place - here.distance * here.normal, here.normal, here.distance, feature,
                                   local_.approach(place, here.normal, margin_));
        if (found) found->feature = feature;
        return found;
    }

    /// Where a face, or the straight line on the side of a cylinder or a cone, goes deeper near a place on it.
    std::optional<Contact> downhill(const Convex::Near& near, const glm::vec3& place, const Local::Answer& here) const {
        const float step = probeSpacing * scale_ * local_.collider().field().voxelSize();
        const glm::vec3 slope = toConvex_ * here.gradient, start = intoConvex(place);
        glm::vec3 end;
        float least = std::numeric_limits<float>::lowest();
        bool isWithinFace = false;
        if (const auto line = convex_.sideLine(near, start)) {
            const glm::vec3 from = (*line)[0] + near.radius * near.normal, along = (*line)[1] - (*line)[0];
            const float length = glm::length(along), steepness = glm::dot(slope, along) / length;
            if (!(std::abs(steepness) > leastDownhill)) return std::nullopt;
            const float middle = glm::dot(start - from, along) / (length * length);
            const float there = std::clamp(middle - std::copysign(step / length, steepness), 0.f, 1.f);
            end = start + (there - middle) * along;
        } else {
            // Where faces touch, points are exact, and the interpolant is not beside sharp edges.
            const bool isSmooth = local_.collider().edges().edges().empty();
            if (!measured_ && !isSmooth) least = touchingFace * scale_ * local_.collider().field().voxelSize();
            if (!convex_.isFlat(near) || near.distance < least) return std::nullopt;
            const glm::vec3 uphill = slope - glm::dot(slope, near.normal) * near.normal;
            const float steepness = glm::length(uphill);
            if (!(steepness > leastDownhill)) return std::nullopt;
            // no farther than to the border of the face
            const Convex::Near last = convex_.nearest(start - step / steepness * uphill, step);
            end = last.core + last.radius * near.normal;
            isWithinFace = glm::dot(last.normal, near.normal) > straight;
        }
        const Local::Edge way{
            [&, to = intoField(end)](float part) { return glm::mix(place, to, part); }, {0, 0}, true, 0, std::nullopt};
        auto found = local_.deepestBetween(way, 0, here, 1, local_.at(intoField(end)), margin_);
        if (!found || found->distance < least) return std::nullopt;
        // within a face it is the face's normal that counts, on its border the field's
        const Contact border = local_.contact(intoField(end), -(toField_ * near.normal), 0, 0);
        const glm::vec3 onFace = found->position + found->distance * found->normal;
        if (isWithinFace && glm::distance(onFace, border.position) > 2 * searchTolerance * voxel_)
            found->normal = border.normal;
        return found;
    }

    const Convex& convex_;
    Local local_;
    float margin_;
    bool measured_;
    float scale_, voxel_;
    float edgeReach_ = margin_;  ///< within which points of sharp edges are looked at
    glm::mat3 toField_, toConvex_;
    glm::vec3 origin_;
};

/// Triangles as Bullet hands them over: what they share is asked about once.
class TriangleProbes : public btTriangleCallback {
  public:
    TriangleProbes(const btTransform& transform, const Motion& motion, const Placed& field, float margin, bool measured,
                   ContactReport& report, std::vector<Contact>& contacts)
        : inField_(relative(field.pose, toPose(transform))),
          field_(field),
          local_(field, toPose(transform), motion, margin, measured),
          margin_(margin),
          reach_(std::max(margin, field.scale * field.collider.field().interiorWidth()) + local_.longestWay()),
          voxel_(field.scale * field.collider.field().voxelSize()),
          spacing_(probeSpacing * voxel_),
          report_(report),
          contacts_(contacts) {}

    /// Triangles farther than this from the field's box are of no interest [m].
    float room() const { return margin_ + local_.longestWay(); }

    void processTriangle(btVector3* triangle, int part, int index) override {
        // The two triangles of a height field's cell come one after the other, and bear the same numbers.
        const bool isSecond = part == part_ && index == index_;
        part_ = isSecond ? -1 : part;
        index_ = index;
        Face face{{inField_.toWorld(toGlm(triangle[0])), inField_.toWorld(toGlm(triangle[1])),
                   inField_.toWorld(toGlm(triangle[2]))},
                  mixed(mixed(mixed(std::uint64_t(part)) ^ std::uint64_t(index)) ^ std::uint64_t(isSecond))};
        const auto& corners = face.corners;
        const glm::vec3 middle = (corners[0] + corners[1] + corners[2]) / 3.f;
        float around = 0;
        for (int i = 0; i < 3; ++i) around = std::max(around, glm::distance(corners[i], middle));
        if (local_.at(middle).distance <= around + room() + spacing_) faces_.push_back(face);
    }

    /// Asks about all triangles that were handed over.
    void probe() {
        for (std::uint32_t f = 0; f < faces_.size(); ++f)
            for (int i = 0; i < 3; ++i) sides_[keyOf(f, i)].push_back({f, i});
        for (std::uint32_t f = 0; f < faces_.size(); ++f) visit(f);
        keepOverFaces();
    }

  private:
    struct Face {
        std::array<glm::vec3, 3> corners;
        std::uint64_t id;  ///< of Bullet's numbers
    };
    struct Side {
        std::uint32_t face;
        int first;  ///< corner
    };
    /// What a surface point of the field finds on a triangle.
    struct OverFace {
        std::uint32_t point;
        std::uint64_t face;  ///< its id
        Contact contact;
    };
    /// The ends of a side in one order.
    using Key = std::array<float, 6>;

    Key keyOf(std::uint32_t face, int first) const {
        const glm::vec3 &a = faces_[face].corners[first], &b = faces_[face].corners[(first + 1) % 3];
        const Key key{a.x, a.y, a.z, b.x, b.y, b.z}, back{b.x, b.y, b.z, a.x, a.y, a.z};
        return std::min(key, back);
    }

    void visit(std::uint32_t f) {
        const auto& [corners, id] = faces_[f];
        Local::Answer answers[3];
        std::array<std::optional<Wings>, 3> wings;
        std::array<bool, 3> flat;
        float longest = 0;
        for (int i = 0; i < 3; ++i) {
            answers[i] = local_.at(corners[i]);
            wings[i] = wingsOf(f, i);
            flat[i] = wings[i] && glm::dot((*wings[i])[0], (*wings[i])[1]) <= flatEdge;
            longest = std::max(longest, glm::distance(corners[i], corners[(i + 1) % 3]));
        }
        // Within a plane of large triangles the field's own points tell more.
        const bool isLarge = longest > spacing_;
        for (int i = 0; i < 3; ++i) {
            if (!isLarge || !flat[i] || !flat[(i + 2) % 3])
                keep(local_.probe(corners[i], answers[i], 0, featureOf(id, 3 + i), margin_, report_));
            const Side& first = sides_.at(keyOf(f, i)).front();
            if (first.face != f || first.first != i || (isLarge && flat[i])) continue;
            const glm::vec3 &from = corners[i], &to = corners[(i + 1) % 3];
            const Local::Edge edge{[&](float part) { return glm::mix(from, to, part); },
                                   {0, 0},
                                   true,
                                   featureOf(id, i),
                                   wings[i],
                                   !flat[i]};
            local_.probeEdge(edge, answers[i], answers[(i + 1) % 3], margin_, report_, contacts_);
        }
        if (isLarge) visitFace(faces_[f]);
    }

    /// Of a side that two triangles share.
    std::optional<Wings> wingsOf(std::uint32_t face, int first) const {
        const auto& sides = sides_.at(keyOf(face, first));
        if (sides.size() != 2) return std::nullopt;
        return Wings{wingOf(sides[0]), wingOf(sides[1])};
    }

    /// From a side into its triangle; nowhere for a triangle without area.
    glm::vec3 wingOf(const Side& side) const {
        const auto& corners = faces_[side.face].corners;
        const glm::vec3 &from = corners[side.first], &to = corners[(side.first + 1) % 3],
                        &opposite = corners[(side.first + 2) % 3];
        const glm::vec3 along = to - from, way = opposite - from;
        const float squared = glm::dot(along, along);
        const glm::vec3 across = squared > 0 ? way - glm::dot(way, along) / squared * along : way;
        const float length = glm::length(across);
        return length > 0 ? across / length : glm::vec3(0);
    }

    /// Scatters numbers over all bits (S. Vigna's SplitMix64).
    static std::uint64_t mixed(std::uint64_t bits) {
        bits += 0x9e3779b97f4a7c15u;
        bits = (bits ^ bits >> 30) * 0xbf58476d1ce4e5b9u;
        bits = (bits ^ bits >> 27) * 0x94d049bb133111ebu;
        return bits ^ bits >> 31;
    }

    /// The first of an edge's, a corner's, or a face's above a surface point: the same from step to step, and no
    /// other's but for a chance of one in 2^31.
    static std::uint32_t featureOf(std::uint64_t triangle, std::uint32_t part) {
        constexpr std::uint32_t count = featureOfB - (2u << partBits);
        return std::uint32_t(mixed(triangle ^ part) % count);
    }

    void keep(const std::optional<Contact>& contact) {
        if (contact) contacts_.push_back(*contact);
    }

    /// Whether a surface point is as far from a face as its height tells. One whose surface lies on the face is, and so
    /// is a corner that points to it, or an edge along it. One aslant may have passed an edge of what the sheet belongs
    /// to; and to the foot of one that looks away from a sheet that has not reached it, on the far side of what is
    /// thin, the near side is nearer. So are the sides of a tip that has sunk in, but then its body goes on behind the
    /// face, and if that is by more than a voxel, no far side is near, it goes through the face, and no other one is
    /// nearer to the tip.
    /// @param normal  of the face, on the side that the point looks at
    /// @param height  over the point
    /// @param foot    what is nearest to the foot
    bool isExact(std::uint32_t index, const glm::vec3& normal, float height, const Local::Answer& foot) const {
        const Collider& collider = field_.collider;
        const SurfacePoint& point = collider.points().points()[index];
        const float cosine = glm::dot(normal, point.normal), unsure = mostInterpolationError * voxel_;
        // where the foot lies in the middle of its body, that side counts which a point of a face looks to
        const bool isUnclear = foot.where == Local::Answer::unclear && !point.isSharp;
        const float facing = glm::dot(foot.normal, normal), least = point.isSharp ? leastFacing : 0;
        const bool isNearSide = height >= 0 || isUnclear || (foot.where == Local::Answer::near && facing >= least);
        const bool isNearest = std::abs(foot.distance - height) <= unsure && isNearSide;
        if (isNearest && opposition.keeps(cosine, true)) return true;
        if (!(isNearest || height < 0) || !point.isSharp || !collider.edges().isTip(collider.points(), index, normal))
            return false;
        if (isNearest) return true;
        const glm::vec3 place = field_.scale * point.position;
        const glm::vec3 through = place + height / std::max(cosine, leastFacing) * point.normal;
        const auto goesOn = [&](float parts) {
            return local_.at(through - parts * unsure * point.normal).distance < 0;
        };
        if (!goesOn(1) && !goesOn(2) && !goesOn(3)) return false;
        if (-height < voxel_) return true;
        return glm::dot(local_.at(through).normal, normal) > farSide && distanceFrom(through) < touchingFoot * voxel_ &&
               distanceFrom(place) > (onFace - 1) * height;
    }

    /// How far a place is from the triangles.
    float distanceFrom(const glm::vec3& place) const {
        float least = std::numeric_limits<float>::max();
        for (const auto& [corners, id] : faces_) {
            const glm::vec3 nearest = nearestOnTriangle(place, corners[0], corners[1], corners[2]);
            least = std::min(least, glm::distance(nearest, place));
        }
        return least;
    }

    /// A point over several faces, as in a valley, has a contact with each of them, and a feature for each.
    void keepOverFaces() {
        const auto isEarlier = [](const OverFace& a, const OverFace& b) { return a.point < b.point; };
        std::stable_sort(overFaces_.begin(), overFaces_.end(), isEarlier);
        for (auto first = overFaces_.begin(); first != overFaces_.end();) {
            const auto last = std::upper_bound(first, overFaces_.end(), *first, isEarlier);
            const bool isAlone = last - first == 1;
            for (; first != last; ++first) {
                first->contact.feature =
                    (isAlone ? first->point : featureOf(first->face, overPoints + first->point)) | featureOfB;
                contacts_.push_back(first->contact);
            }
        }
    }

    /// Asks the field at the feet of its own surface points on the triangle: a bump finds a large face. Points that are
    /// not over the face are its edges' and its neighbours', and a foot that others are much nearer to is theirs.
    void visitFace(const Face& face) {
        const auto& corners = face.corners;
        const glm::vec3 square = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
        const float area = glm::length(square), scale = field_.scale, rounding = onFace * spacing_;
        if (!(area > 0)) return;
        const glm::vec3 up = square / area;
        std::array<glm::vec3, 3> outwards;
        for (int i = 0; i < 3; ++i) outwards[i] = glm::normalize(glm::cross(corners[(i + 1) % 3] - corners[i], square));
        const auto isBeside = [&](const glm::vec3& place, float by) {
            for (int i = 0; i < 3; ++i)
                if (glm::dot(outwards[i], place - corners[i]) > by) return true;
            return std::abs(glm::dot(up, place - corners[0])) > reach_ + by;
        };
        const auto reject = [&](const glm::vec3& centre, float radius) {
            return isBeside(scale * centre, scale * radius + rounding);
        };
        const Collider& collider = field_.collider;
        collider.points().visit(reject, [&](std::uint32_t index, const SurfacePoint& point) {
            const glm::vec3 place = scale * point.position;
            if (isBeside(place, rounding)) return;
            const glm::vec3 below = nearestOnTriangle(place, corners[0], corners[1], corners[2]);
            const glm::vec3 normal = glm::dot(up, point.normal) < 0 ? -up : up;
            const float height = glm::dot(below - place, normal);
            const Local::Answer answer = local_.at(below);
            const bool isFar = std::abs(height) > std::abs(answer.distance) + spacing_ + local_.longestWay();
            if (isFar && !(point.isSharp && height < 0)) return;
            std::optional<Contact> found;
            if (height <= margin_ && isExact(index, normal, height, answer)) {
                ++report_.pointsTested;
                found = local_.contact(place, normal, height, 0, local_.approach(below, normal, margin_));
                found->turningRadius = 0;
            } else if (isFar) {
                return;
            } else {
                found = local_.probe(below, answer, 0, 0, margin_, report_);
                if (!found) return;
                // What the middle of a face sees aslant is beside it, but where it touches: there an edge or a corner
                // has no direction of its own.
                const bool touches = std::abs(answer.distance) <= touchingFoot * voxel_;
                const glm::quat& inWorld = field_.pose.rotation;
                if (!opposition.keeps(found->normal, -(inWorld * normal), inWorld * local_.ways().turn(), !touches))
                    return;
                if (touches)
                    found->normal = inWorld * normal;
                else if (answer.distance > 0 &&
                         looksAtEdge(below, -normal, answer.distance, answer.normal,
                                     [&](const glm::vec3& there) { return local_.at(there).normal; }))
                    return;
                found->turningRadius = -1;  // it stays below the point
            }
            overFaces_.push_back({index, face.id, *found});
        });
    }

    Pose inField_;  ///< of the mesh
    const Placed& field_;
    Local local_;
    float margin_, reach_, voxel_, spacing_;
    ContactReport& report_;
    std::vector<Contact>& contacts_;
    std::vector<Face> faces_;
    std::vector<OverFace> overFaces_;
    int part_ = -1, index_ = -1;  ///< of the last triangle that was handed over
    std::map<Key, std::vector<Side>> sides_;
};

}  // namespace

ContactReport collideFields(const Placed& a, const Placed& b, float margin, bool measured, NearPoints& near,
                            std::vector<Contact>& contacts) {
    ContactOptions options = opposition;
    options.margin = margin;
    options.measured = measured;
    // a test is told how far apart bodies are, whichever way their points look
    if (measured) {
        options.leastOppositionApart = options.leastOpposition;
        options.keepsEdgesAslant = true;
    }
    return collide(a, b, options, contacts, &near);
}

ContactReport collideFields(const Placed& a, const Placed& b, float margin, std::span<const FoundPoint> ofA,
                            std::span<const FoundPoint> ofB, std::vector<Contact>& contacts) {
    ContactOptions options = opposition;
    options.margin = margin;
    return collideFound(a, b, options, ofA, ofB, contacts);
}

ContactReport collidePlane(const glm::vec3& normal, float offset, const Motion& motion, const Placed& field,
                           float margin, bool measured, std::vector<Contact>& contacts) {
    ContactReport report;
    // The plane in the collider's own coordinates.
    const glm::vec3 up = glm::conjugate(field.pose.rotation) * normal;
    const float height = (offset - glm::dot(normal, field.pose.position)) / field.scale;
    const float reach = margin / field.scale;
    const Local local(field, {}, motion, margin, false);
    const auto above = [&](const glm::vec3& point) { return glm::dot(up, point) - height; };
    const auto reject = [&](const glm::vec3& centre, float radius) {
        return above(centre) - radius > reach + local.longestWay() / field.scale;
    };
    field.collider.points().visit(reject, [&](std::uint32_t index, const SurfacePoint& point) {
        ++report.pointsTested;
        const float distance = above(point.position);
        // the plane's own points come up to this one
        const float approach = local.approach(field.scale * point.position, -up, margin) / field.scale;
        if (distance > std::max(reach, approach)) return;
        const glm::vec3 position = field.pose.toWorld(field.scale * point.position);
        contacts.push_back({position, -normal, field.scale * distance, index | featureOfB, field.scale * approach, 0});
    });
    if (!measured || !field.collider.body().mesh) return report;
    const auto& vertices = field.collider.body().mesh->points;
    const auto isLower = [&](const glm::vec3& a, const glm::vec3& b) { return above(a) < above(b); };
    const auto lowest = std::min_element(vertices.begin(), vertices.end(), isLower);
    if (above(*lowest) <= reach)
        contacts.push_back({field.pose.toWorld(field.scale * *lowest), -normal, field.scale * above(*lowest),
                            lowestVertex | featureOfB, 0});
    return report;
}

ContactReport collideConvex(const Convex& convex, const Pose& pose, const Motion& motion, const Placed& field,
                            float margin, bool measured, std::vector<Contact>& contacts) {
    ContactReport report;
    const Touching touching(convex, pose, motion, field, margin, measured);
    field.collider.points().visit(
        [&](const glm::vec3& centre, float radius) { return touching.reject(centre, radius); },
        [&](std::uint32_t index, const SurfacePoint& point) { touching.visit(index, point, report, contacts); });
    touching.visitProbes(report, contacts);
    return report;
}

ContactReport collideTriangles(const btConcaveShape& mesh, const btTransform& transform, const Motion& motion,
                               const Placed& field, float margin, bool measured, std::vector<Contact>& contacts) {
    ContactReport report;
    TriangleProbes probes(transform, motion, field, margin, measured, report, contacts);
    const Pose inMesh = relative(toPose(transform), field.pose);
    const Bounds& bounds = field.collider.bounds();
    btVector3 lower, upper;
    const btTransform place(toBullet(inMesh.rotation), toBullet(inMesh.toWorld(field.scale * bounds.centre())));
    btTransformAabb(toBullet(0.5f * field.scale * bounds.size()), probes.room(), place, lower, upper);
    mesh.processAllTriangles(&probes, lower, upper);
    probes.probe();
    return report;
}

}  // namespace bilayer::bullet
