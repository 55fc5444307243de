// Contacts between a field and triangles that Bullet passes one at a time.
// Tested by tests/bullet/open_surface.cpp.
#include <BulletCollision/CollisionShapes/btTriangleCallback.h>
#include <LinearMath/btAabbUtil2.h>
#include <bilayer/collider/contact.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <limits>
#include <optional>

#include "collider/contact/collider_data.h"
#include "collider/contact/normal_filter.h"
#include "collider/contact/surface_query.h"
#include "collider/field/interpolant.h"
#include "integration/bullet/detail/convert.h"
#include "integration/bullet/detail/local_field.h"
#include "integration/bullet/detail/narrow_phase.h"
#include "integration/bullet/detail/open_surface.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Feature numbers of a triangle: three edges, three vertices, and from here on surface points over its face.
constexpr std::uint32_t overPoints = 6;
// A point is over a face if it is no farther beyond its edges than this [probe spacings]: rounding.
constexpr float onFace = 1e-4f;
// Triangles whose conormals enclose more than 179.9 degrees (cosine) are coplanar, without an edge between them.
constexpr float flatEdge = -0.9999985f;
// A vertex or an edge of the triangles touches points whose normals oppose one of its own normals to within this
// cosine.
constexpr float minNormalCosine = 0.9f;
// A face touches points whose normals oppose its own to within 5 degrees (cosine and sine).
constexpr float straight = 0.9962f, maxLean = 0.0872f;
// Small triangles whose planes enclose less than 108 degrees have no crease that a convex vertex could be below
// (tangent).
constexpr float steepestCrease = 3;
// A body closer than this to a point of the face touches the face [voxels]: next to an edge or a vertex, normals are
// mixed.
constexpr float touchingFoot = 0.05f;
// Below this cosine to the face, a normal does not indicate the side of the face that its body is on.
constexpr float minFacing = 0.1f;
// A surface with an opposite normal by this cosine is the far side of a thin body.
constexpr float farSide = -0.8f;

/// Collects the triangles that Bullet passes, and tests shared features once.
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

    /// Maximum distance of relevant triangles from the field's box [m].
    float room() const { return margin_ + local_.longestWay(); }

    void processTriangle(btVector3* triangle, int part, int index) override {
        // The two triangles of a height field's cell arrive in succession with the same numbers.
        const bool isSecond = part == part_ && index == index_;
        part_ = isSecond ? -1 : part;
        index_ = index;
        const Triangle corners{inField_.toWorld(toGlm(triangle[0])), inField_.toWorld(toGlm(triangle[1])),
                               inField_.toWorld(toGlm(triangle[2]))};
        const glm::vec3 middle = (corners[0] + corners[1] + corners[2]) / 3.f;
        float around = 0;
        for (int i = 0; i < 3; ++i) around = std::max(around, glm::distance(corners[i], middle));
        if (!(local_.at(middle).distance <= around + room() + spacing_)) return;
        triangles_.push_back(corners);
        ids_.push_back(mixed(mixed(mixed(std::uint64_t(part)) ^ std::uint64_t(index)) ^ std::uint64_t(isSecond)));
    }

    /// Tests all collected triangles.
    void probe() {
        adjacency_.emplace(triangles_);
        for (std::uint32_t f = 0; f < triangles_.size(); ++f) visit(f);
        visitSmallFaces();
        keepOverFaces();
    }

  private:
    /// A sharp surface point of the field.
    struct Sharp {
        glm::vec3 place;
        std::uint32_t index;
    };
    /// The contact of a surface point of the field with a triangle.
    struct OverFace {
        std::uint32_t point;
        std::uint64_t face;  ///< its id
        Contact contact;
    };

    void visit(std::uint32_t f) {
        const Triangle& corners = triangles_[f];
        LocalField::Answer answers[3];
        std::array<std::optional<Conormals>, 3> conormals;
        std::array<bool, 3> flat;
        float longest = 0;
        for (int i = 0; i < 3; ++i) {
            answers[i] = local_.at(corners[i]);
            conormals[i] = adjacency_->conormalsOf(f, i);
            flat[i] = conormals[i] && glm::dot((*conormals[i])[0], (*conormals[i])[1]) <= flatEdge;
            longest = std::max(longest, glm::distance(corners[i], corners[(i + 1) % 3]));
        }
        // Inside a plane of large triangles the field's own points are more accurate.
        const bool isLarge = longest > spacing_;
        for (int i = 0; i < 3; ++i) {
            if (!isLarge || !flat[i] || !flat[(i + 2) % 3]) visitCorner(f, i, answers[i]);
            const Adjacency::Member& first = adjacency_->atEdge(f, i).front();
            if (first.triangle != f || first.index != i || (isLarge && flat[i])) continue;
            const glm::vec3 &from = corners[i], &to = corners[(i + 1) % 3];
            const LocalField::Edge edge{[&](float part) { return glm::mix(from, to, part); },
                                        {0, 0},
                                        true,
                                        featureOf(ids_[f], std::uint32_t(i)),
                                        conormals[i],
                                        !flat[i]};
            const std::size_t before = contacts_.size();
            local_.probeEdge(edge, answers[i], answers[(i + 1) % 3], margin_, report_, contacts_);
            const auto normalOf = [&](const glm::vec3& towards) { return adjacency_->edgeNormal(f, i, towards); };
            std::size_t kept = before;
            for (std::size_t k = before; k < contacts_.size(); ++k)
                if (const auto contact = withNormal(contacts_[k], normalOf)) contacts_[kept++] = *contact;
            contacts_.resize(kept);
        }
        if (isLarge)
            visitFace(f);
        else
            small_.push_back(f);
    }

    void visitCorner(std::uint32_t f, int i, const LocalField::Answer& answer) {
        const std::uint32_t feature = featureOf(ids_[f], std::uint32_t(3 + i));
        const auto found = local_.probe(triangles_[f][i], answer, 0, feature, margin_, report_);
        if (!found) return;
        const auto normalOf = [&](const glm::vec3& towards) { return adjacency_->cornerNormal(f, i, towards); };
        if (const auto contact = withNormal(*found, normalOf)) contacts_.push_back(*contact);
    }

    /// The contact of an edge or a vertex with its own normal that is nearest to the field's. Nothing if it is far from
    /// the field's normal: another feature of the triangles is then nearer to the field's surface there.
    /// @param normalOf  callback for a direction towards the field, in its axes
    template <class NormalOf>
    std::optional<Contact> withNormal(Contact contact, NormalOf&& normalOf) const {
        const glm::vec3 towards = -(glm::conjugate(field_.pose.rotation) * contact.normal);
        const auto normal = normalOf(towards);
        if (!normal || glm::dot(*normal, towards) < minNormalCosine) return std::nullopt;
        turn(contact, -*normal);
        contact.turningRadius = -1;
        return contact;
    }

    /// Replaces the normal of a contact at a point of the triangles, in the field's axes.
    void turn(Contact& contact, const glm::vec3& normal) const {
        const glm::vec3 place = contact.position + contact.distance * contact.normal;
        contact.normal = field_.pose.rotation * normal;
        contact.position = place - contact.distance * contact.normal;
    }

    /// Hashes a number over all bits (S. Vigna's SplitMix64).
    static std::uint64_t mixed(std::uint64_t bits) {
        bits += 0x9e3779b97f4a7c15u;
        bits = (bits ^ bits >> 30) * 0xbf58476d1ce4e5b9u;
        bits = (bits ^ bits >> 27) * 0x94d049bb133111ebu;
        return bits ^ bits >> 31;
    }

    /// The first feature number of an edge, a vertex, or a face over a surface point. It is the same from step to step,
    /// and unique up to a collision probability of 2^-31.
    static std::uint32_t featureOf(std::uint64_t triangle, std::uint32_t part) {
        constexpr std::uint32_t count = featureOfB - (2u << partBits);
        return std::uint32_t(mixed(triangle ^ part) % count);
    }

    /// Whether the height of a surface point over a face is its exact distance. It is for a point whose surface is
    /// parallel to the face, for a vertex that points to the face, and for an edge along it.
    ///
    /// It may be wrong in these cases:
    /// - An oblique point may have passed an edge of the open surface.
    /// - A point on the far side of a thin body may point away from triangles that have not reached it: the near side
    ///   is then nearer to its foot.
    /// - The sides of a penetrating convex vertex are nearer in the same way.
    /// @param normal  of the face, on the side that the point faces
    /// @param height  over the point
    /// @param foot    the field's answer at the foot
    bool isExact(std::uint32_t index, const glm::vec3& normal, float height, const LocalField::Answer& foot) const {
        const Collider& collider = field_.collider;
        const SurfacePoint& point = collider.data().points().points()[index];
        // where the foot is in the middle of its body, the side counts that a point of a face points to
        const bool isUnclear = foot.where == LocalField::Answer::unclear && !point.isSharp;
        const float facing = glm::dot(foot.normal, normal), least = point.isSharp ? minFacing : 0;
        const bool isNearSide = height >= 0 || isUnclear || (foot.where == LocalField::Answer::near && facing >= least);
        const bool isNearest = std::abs(foot.distance - height) <= maxInterpolationError * voxel_ && isNearSide;
        const bool isKept = keeps({}, glm::dot(normal, point.normal), true);
        if (isNearest && isKept && (point.isSharp || turnsTo(field_.scale * point.position, point.normal, normal)))
            return true;
        if (!(isNearest || height < 0) || !isConvexVertex(index, normal)) return false;
        return isNearest || hasSunk(point, normal, height, wayThrough(point, normal, height));
    }

    /// Whether the field's surface, seen along one normal from a point, bends to another normal within the spacing of
    /// its points, at present or during the rotation in the step. If not, it continues deeper, and touches elsewhere:
    /// at the bend, or at the border of the face.
    bool turnsTo(const glm::vec3& place, const glm::vec3& seen, const glm::vec3& normal) const {
        const glm::vec3 turn = local_.relativeMotion().rotation();
        const auto isMet = [&](float part) {
            return turnsNowTo(place, seen, glm::normalize(normal + part * glm::cross(turn, normal)));
        };
        return isMet(0) || (turn != glm::vec3(0) && (isMet(0.5f) || isMet(1)));
    }

    bool turnsNowTo(const glm::vec3& place, const glm::vec3& seen, const glm::vec3& normal) const {
        const float cosine = glm::dot(seen, normal);
        if (cosine >= straight) return true;
        const glm::vec3 deeper = glm::normalize(normal - cosine * seen), lean = glm::normalize(seen - cosine * normal);
        const LocalField::Answer there = local_.at(place + spacing_ * deeper);
        return there.where == LocalField::Answer::near && glm::dot(there.normal, lean) <= maxLean;
    }

    bool isConvexVertex(std::uint32_t index, const glm::vec3& normal) const {
        const Collider& collider = field_.collider;
        return collider.data().points().points()[index].isSharp &&
               collider.data().edges().isConvexVertex(collider.data().points(), index, normal);
    }

    /// The distance from a convex vertex back along its axis to the plane of a face that it is below.
    static float wayThrough(const SurfacePoint& tip, const glm::vec3& normal, float height) {
        return -height / std::max(glm::dot(normal, tip.normal), minFacing);
    }

    /// Whether a convex vertex under a face has penetrated it: its body continues behind the face. If the vertex is
    /// deeper than a voxel, also no far side of the body is near, its axis meets the triangles, and no other triangle
    /// is nearer to it.
    /// @param way  distance along its axis to the triangles
    bool hasSunk(const SurfacePoint& tip, const glm::vec3& normal, float height, float way) const {
        const glm::vec3 place = field_.scale * tip.position, through = place - way * tip.normal;
        const auto goesOn = [&](float parts) {
            return local_.at(through - parts * maxInterpolationError * voxel_ * tip.normal).distance < 0;
        };
        if (!goesOn(1) && !goesOn(2) && !goesOn(3)) return false;
        if (-height < voxel_) return true;
        return glm::dot(local_.at(through).normal, normal) > farSide && distanceFrom(through) < touchingFoot * voxel_ &&
               distanceFrom(place) > (onFace - 1) * height;
    }

    /// The distance of a point from the triangles.
    float distanceFrom(const glm::vec3& place) const {
        float least = std::numeric_limits<float>::max();
        for (const Triangle& corners : triangles_) {
            const glm::vec3 nearest = nearestOnTriangle(place, corners[0], corners[1], corners[2]);
            least = std::min(least, glm::distance(nearest, place));
        }
        return least;
    }

    /// Keeps the contacts over faces. A point over several faces, as in a valley, has a contact and a feature for each
    /// of them.
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

    /// The plane of a triangle and its edges.
    struct Plane {
        Triangle corners;
        std::array<glm::vec3, 3> outwards;
        /// at an edge: into the neighbouring triangle, outward of this one
        std::array<std::optional<glm::vec3>, 3> neighbours;
        glm::vec3 up;

        /// Whether a point is farther than this beyond the edges.
        bool isBeside(const glm::vec3& place, float by) const {
            for (int i = 0; i < 3; ++i)
                if (glm::dot(outwards[i], place - corners[i]) > by) return true;
            return false;
        }
        /// The same, but not for a point below a crease and over neither triangle: it has passed both.
        bool isBesideAll(const glm::vec3& place, float by) const {
            for (int i = 0; i < 3; ++i) {
                const glm::vec3 way = place - corners[i];
                if (glm::dot(outwards[i], way) > by && !(neighbours[i] && isBelow(i, way, by))) return true;
            }
            return false;
        }
        /// Whether a point is below the crease at an edge.
        bool isBelow(int i, const glm::vec3& way, float by) const {
            const float rise = -glm::dot(*neighbours[i], up);
            return glm::dot(*neighbours[i], way) > -by && std::copysign(1.f, rise) * glm::dot(up, way) < by;
        }
        /// The normal on the side that a surface point faces.
        glm::vec3 normalFacing(const SurfacePoint& point) const { return glm::dot(up, point.normal) < 0 ? -up : up; }
        float heightOf(const glm::vec3& place) const { return std::abs(glm::dot(up, place - corners[0])); }
    };

    /// The plane of a triangle; nothing for one without area.
    std::optional<Plane> planeOf(std::uint32_t f) const {
        const Triangle& corners = triangles_[f];
        const glm::vec3 square = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
        const float area = glm::length(square);
        if (!(area > 0)) return std::nullopt;
        Plane plane{corners, {}, {}, square / area};
        for (int i = 0; i < 3; ++i)
            plane.outwards[i] = glm::normalize(glm::cross(corners[(i + 1) % 3] - corners[i], square));
        return plane;
    }

    void findNeighbours(std::uint32_t f, Plane& plane) const {
        for (int i = 0; i < 3; ++i) {
            const auto neighbour = adjacency_->neighbourOf(f, i);
            if (neighbour && glm::dot(*neighbour, plane.outwards[i]) < -flatEdge) plane.neighbours[i] = -*neighbour;
        }
    }

    /// Tests the field at the feet of its own surface points on the triangle, which finds bumps over a large face.
    /// Points that are not over the face belong to its edges and neighbours.
    void visitFace(std::uint32_t f) {
        std::optional<Plane> plane = planeOf(f);
        if (!plane) return;
        findNeighbours(f, *plane);
        const float scale = field_.scale, rounding = onFace * spacing_;
        const auto isBeside = [&](const glm::vec3& place, float by) {
            return plane->isBesideAll(place, by) || plane->heightOf(place) > reach_ + by;
        };
        const auto reject = [&](const glm::vec3& centre, float radius) {
            return isBeside(scale * centre, scale * radius + rounding);
        };
        field_.collider.data().points().visit(reject, [&](std::uint32_t index, const SurfacePoint& point) {
            if (isBeside(scale * point.position, rounding)) return;
            if (const auto found = overFace(*plane, true, index, point)) overFaces_.push_back({index, ids_[f], *found});
        });
    }

    /// Tests small triangles. Their vertices and edges are enough, except for a convex vertex of the field between
    /// them.
    void visitSmallFaces() {
        if (small_.empty()) return;
        const std::vector<Sharp> sharp = sharpNear();
        const auto isBefore = [](const Sharp& one, float x) { return one.place.x < x; };
        for (const std::uint32_t f : small_) {
            const Triangle& corners = triangles_[f];
            const float around = reach_ + spacing_;
            std::optional<Plane> plane;
            auto at = std::lower_bound(sharp.begin(), sharp.end(), corners[0].x - around, isBefore);
            for (; at != sharp.end() && at->place.x <= corners[0].x + around; ++at) {
                if (glm::distance(at->place, corners[0]) > around) continue;
                if (!plane) plane = planeOf(f);
                if (!plane) break;
                visitSmallFace(f, *plane, *at);
            }
        }
    }

    void visitSmallFace(std::uint32_t f, Plane& plane, const Sharp& sharp) {
        const SurfacePoint& point = field_.collider.data().points().points()[sharp.index];
        const glm::vec3 normal = plane.normalFacing(point);
        if (glm::dot(normal, plane.corners[0] - sharp.place) > margin_) return;
        const float height = plane.heightOf(sharp.place), rounding = onFace * spacing_;
        if (height > reach_ || plane.isBeside(sharp.place, rounding + steepestCrease * height)) return;
        if (plane.isBeside(sharp.place, rounding)) {
            findNeighbours(f, plane);
            if (plane.isBesideAll(sharp.place, rounding)) return;
        }
        if (!isConvexVertex(sharp.index, normal)) return;
        if (const auto found = overFace(plane, false, sharp.index, point))
            overFaces_.push_back({sharp.index, ids_[f], *found});
    }

    /// The field's sharp vertices near small triangles, sorted by x.
    std::vector<Sharp> sharpNear() const {
        glm::vec3 lower = triangles_[small_.front()][0], upper = lower;
        for (const std::uint32_t f : small_) {
            lower = glm::min(lower, triangles_[f][0]);
            upper = glm::max(upper, triangles_[f][0]);
        }
        const glm::vec3 middle = 0.5f * (lower + upper), half = 0.5f * (upper - lower) + reach_ + spacing_;
        const auto reject = [&](const glm::vec3& centre, float radius) {
            return glm::any(glm::greaterThan(glm::abs(field_.scale * centre - middle), half + field_.scale * radius));
        };
        std::vector<Sharp> sharp;
        field_.collider.data().points().visit(reject, [&](std::uint32_t index, const SurfacePoint& point) {
            if (point.isSharp && !field_.collider.data().edges().isWithinEdge(field_.collider.data().points(), index))
                sharp.push_back({field_.scale * point.position, index});
        });
        std::sort(sharp.begin(), sharp.end(), [](const Sharp& a, const Sharp& b) {
            return a.place.x < b.place.x || (a.place.x == b.place.x && a.index < b.index);
        });
        return sharp;
    }

    /// The contact of a surface point with the face under it. A foot that is much nearer to other triangles belongs to
    /// them.
    /// @param asksFoot  whether to test the field at the foot where the height is not exact
    std::optional<Contact> overFace(const Plane& plane, bool asksFoot, std::uint32_t index, const SurfacePoint& point) {
        const glm::vec3 place = field_.scale * point.position;
        const glm::vec3 foot = nearestOnTriangle(place, plane.corners[0], plane.corners[1], plane.corners[2]);
        const glm::vec3 normal = plane.normalFacing(point);
        const float height = glm::dot(foot - place, normal);
        if (plane.isBeside(place, onFace * spacing_)) return belowCrease(plane, index, normal, height);
        const LocalField::Answer there = local_.at(foot);
        const bool isFar = std::abs(height) > std::abs(there.distance) + spacing_ + local_.longestWay();
        if (isFar && !(point.isSharp && height < 0)) return std::nullopt;
        if (height <= margin_ && isExact(index, normal, height, there)) return touching(place, normal, height);
        if (isFar || !asksFoot) return std::nullopt;
        if (glm::dot(point.normal, normal) < minFacing || !turnsTo(foot, there.normal, normal)) return std::nullopt;
        return atFoot(foot, normal, there);
    }

    /// The contact of a convex vertex that has penetrated an open surface next to a crease and is over neither
    /// triangle: it has come from above both.
    std::optional<Contact> belowCrease(const Plane& plane, std::uint32_t index, const glm::vec3& normal, float height) {
        const SurfacePoint& point = field_.collider.data().points().points()[index];
        if (height >= 0 || !isConvexVertex(index, normal)) return std::nullopt;
        const glm::vec3 place = field_.scale * point.position;
        float way = wayThrough(point, normal, height), deepest = height;
        for (int i = 0; i < 3; ++i) {
            const glm::vec3 from = place - plane.corners[i];
            if (!(glm::dot(plane.outwards[i], from) > onFace * spacing_)) continue;
            const glm::vec3 along = plane.corners[(i + 1) % 3] - plane.corners[i];
            const glm::vec3 across = glm::normalize(glm::cross(along, *plane.neighbours[i]));
            const glm::vec3 other = glm::dot(across, point.normal) < 0 ? -across : across;
            const float below = -glm::dot(from, other);
            if (below >= 0) return std::nullopt;
            way = std::max(way, wayThrough(point, other, below));
            deepest = std::min(deepest, below);
        }
        if (!hasSunk(point, normal, deepest, way)) return std::nullopt;
        return touching(place, normal, height);
    }

    /// The contact of a surface point with a plane.
    Contact touching(const glm::vec3& place, const glm::vec3& normal, float height) {
        ++report_.pointsTested;
        const glm::vec3 foot = place + height * normal;
        Contact found = local_.contact(place, normal, height, 0, local_.approach(foot, normal, margin_));
        found.turningRadius = 0;
        return found;
    }

    /// The contact of the face as the field's answer at the foot gives it. An oblique normal there means that the body
    /// is next to the face. The exception is a touching foot: there an edge or a vertex has no direction of its own.
    std::optional<Contact> atFoot(const glm::vec3& foot, const glm::vec3& normal, const LocalField::Answer& there) {
        std::optional<Contact> found = local_.probe(foot, there, 0, 0, margin_, report_);
        if (!found) return std::nullopt;
        const bool touches = std::abs(there.distance) <= touchingFoot * voxel_;
        const glm::quat& inWorld = field_.pose.rotation;
        if (!keeps({}, found->normal, -(inWorld * normal), inWorld * local_.relativeMotion().rotation(), !touches))
            return std::nullopt;
        const auto normalAt = [&](const glm::vec3& place) { return local_.at(place).normal; };
        if (!touches && there.distance > 0 && seesEdgeObliquely(foot, -normal, there.distance, there.normal, normalAt))
            return std::nullopt;
        turn(*found, normal);
        found->turningRadius = -1;  // it stays below the point
        return found;
    }

    Pose inField_;  ///< of the mesh
    const Placed& field_;
    LocalField local_;
    float margin_, reach_, voxel_, spacing_;
    ContactReport& report_;
    std::vector<Contact>& contacts_;
    std::vector<Triangle> triangles_;
    std::vector<std::uint64_t> ids_;  ///< hashes of Bullet's numbers
    std::optional<Adjacency> adjacency_;
    std::vector<std::uint32_t> small_;  ///< indices of small triangles
    std::vector<OverFace> overFaces_;
    int part_ = -1, index_ = -1;  ///< of the last triangle
};

}  // namespace

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

}  // namespace bilayer::bullet::detail
