// Nodes are visited in front-to-back order. Highway compiles the searches once for each instruction set.
#include "collider/field/mesh_rays.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/field/mesh_rays.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "collider/field/triangle_tests.h"
#include "sdf/bvh/leaf_measure.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {

namespace {
/// Stack size: eight levels of groups hold 2^27 leaves, with at most seven pending nodes per level.
constexpr std::size_t maxWaiting = 96;
/// Max rounding of points and boxes in the tree's frame, relative to their size.
constexpr float placeRounding = 2.4e-7f;
/// Max distance at which a ray may pass a triangle and still hit it [voxels].
constexpr double rayTolerance = 1e-5;
/// Tolerances of the single-precision test, absolute [voxels] and relative to the distance from the start. Triangles
/// within them are tested in double precision.
constexpr float passTolerance = 1e-4f, passRounding = 1e-6f;
/// Min speed along an axis; below it the ray moves less than a voxel over the longest path.
constexpr float slowest = 1e-9f;
/// Tolerance for the rounding of a quotient.
constexpr float quotientRoundUp = 1 + 1e-6f;

// A stack of pending nodes with their keys.
struct Waiting {
    std::size_t count = 0;
    float keys[maxWaiting];
    std::uint32_t nodes[maxWaiting];

    void push(float key, std::uint32_t node) { keys[count] = key, nodes[count++] = node; }
};

// Pushes the children of a group whose bits are set, the one with the smallest key last.
inline void pushNear(Waiting& waiting, unsigned bits, const float* keys, std::uint32_t firstChild) {
    const std::size_t first = waiting.count;
    for (; bits != 0; bits &= bits - 1) {
        const auto lane = std::size_t(std::countr_zero(bits));
        std::size_t place = waiting.count++;
        for (; place > first && waiting.keys[place - 1] < keys[lane]; --place) {
            waiting.keys[place] = waiting.keys[place - 1];
            waiting.nodes[place] = waiting.nodes[place - 1];
        }
        waiting.keys[place] = keys[lane];
        waiting.nodes[place] = firstChild + std::uint32_t(lane);
    }
}

// Visits nodes in ascending order of their keys, except skipped ones. Returns true as soon as a visit of a leaf does.
template <class Skip, class Open, class Visit>
inline bool descend(const WideTree& tree, Skip skip, Open open, Visit visit) {
    Waiting waiting;
    waiting.push(0, tree.root());
    while (waiting.count > 0) {
        --waiting.count;
        if (skip(waiting.keys[waiting.count])) continue;
        const std::uint32_t node = waiting.nodes[waiting.count];
        if (!tree.isLeaf(node))
            open(tree.group(node), waiting);
        else if (visit(tree.leaves[node]))
            return true;
    }
    return false;
}

// Moves a point that is too far away towards the tree's corner. Everything in the tree becomes nearer by the same
// distance, up to the slack of a Place.
inline glm::dvec3 withinReach(const glm::dvec3& p) {
    const double away = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    return away > double(farthestPlace) ? p * (double(farthestPlace) / away) : p;
}

// A point in the tree's frame, as whole voxels and the rest, with the max rounding of boxes relative to it [voxels].
struct Place {
    glm::vec3 cell, inCell, point;
    float slack;

    Place(const WideTree& tree, const glm::dvec3& at) {
        const glm::dvec3 p = withinReach(at);
        cell = glm::floor(p);
        inCell = p - glm::floor(p);
        point = p;
        const glm::vec3 size = glm::max(glm::abs(point), glm::vec3(tree.size));
        slack = placeRounding * (size.x + size.y + size.z);
    }

    // The vector from a leaf's corners; whole voxels first, without rounding.
    template <class Load>
    Vec from(const WideLeaf& leaf, Load load, int k) const {
        return hn::Add(hn::Sub(hn::Set(Tag(), cell[k]), load(leaf.cell[k])),
                       hn::Sub(hn::Set(Tag(), inCell[k]), load(leaf.corner[k])));
    }
};

// The search for the first hit of a ray.
class RaySearch {
  public:
    // The start and the direction are in the tree's frame [voxels]; path and result are in metres.
    RaySearch(const MeshTree& mesh, const glm::dvec3& start, const Path& path)
        : mesh_(mesh.mesh()),
          tree_(mesh.tree()),
          place_(tree_, start),
          direction_(path.direction),
          exact_(path.origin, path.direction, rayTolerance * double(mesh.voxelSize())),
          perMetre_(1 / double(mesh.voxelSize())),
          best_(path.length) {
        for (int k = 0; k < 3; ++k) {
            const bool down = direction_[k] < 0;
            perDirection_[k] = (down ? -1 : 1) / std::max(std::abs(direction_[k]), slowest);
            forward_[k] = !down;
            nearOrigin_[k] = place_.point[k] + (down ? -place_.slack : place_.slack);
            farOrigin_[k] = place_.point[k] - (down ? -place_.slack : place_.slack);
        }
        limitTo(best_);
    }

    std::optional<MeshHit> run() {
        descend(
            tree_, [&](float key) { return key > limit_; },
            [&](const BoxGroup& group, Waiting& waiting) { open(group, waiting); },
            [&](const WideLeaf& leaf) { return visit(leaf), false; });
        if (triangle_ == noTriangle) return std::nullopt;
        return MeshHit{best_, position_, triangle_};
    }

  private:
    void limitTo(double along) {
        best_ = along;
        limit_ = std::min(float(along * perMetre_) * quotientRoundUp + place_.slack, std::numeric_limits<float>::max());
    }

    // Slab test: T. Kay, J. Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986, 269-278.
    void open(const BoxGroup& group, Waiting& waiting) const {
        const Tag tag;
        alignas(64) float enters[treeWidth];
        unsigned met = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            Vec enter = hn::Zero(tag), leave = hn::Set(tag, limit_);
            for (int k = 0; k < 3; ++k) {
                const float* first = forward_[k] ? group.lower[k] : group.upper[k];
                const float* second = forward_[k] ? group.upper[k] : group.lower[k];
                const Vec per = hn::Set(tag, perDirection_[k]);
                enter = hn::Max(enter, hn::Mul(hn::Sub(hn::Load(tag, first + i), hn::Set(tag, nearOrigin_[k])), per));
                leave = hn::Min(leave, hn::Mul(hn::Sub(hn::Load(tag, second + i), hn::Set(tag, farOrigin_[k])), per));
            }
            hn::Store(enter, tag, enters + i);
            met |= bitsOf(hn::Le(enter, hn::Mul(leave, hn::Set(tag, quotientRoundUp)))) << i;
        }
        pushNear(waiting, met, enters, group.firstChild);
    }

    // A bit mask of the triangles that the line passes, each in its own frame. All terms are multiplied by the cosine
    // between line and normal. Distances in the plane thereby become distances from the line, at any angle.
    unsigned passed(const WideLeaf& leaf, std::size_t i) const {
        const Tag tag;
        const auto load = [&](const float* from) { return hn::Load(tag, from + i); };
        const auto dot = [&](const Vec* a, const Vec* b) {
            return hn::Add(hn::Add(hn::Mul(a[0], b[0]), hn::Mul(a[1], b[1])), hn::Mul(a[2], b[2]));
        };
        const auto det = [&](Vec a, Vec b, Vec c, Vec d) { return hn::Sub(hn::Mul(a, d), hn::Mul(b, c)); };
        Vec q[3], d[3], n[3], a[3];
        for (int k = 0; k < 3; ++k) {
            q[k] = place_.from(leaf, load, k);
            d[k] = hn::Set(tag, direction_[k]);
            n[k] = load(leaf.normal[k]);
            a[k] = load(leaf.along[k]);
        }
        const Vec b[3] = {det(n[1], n[2], a[1], a[2]), det(n[2], n[0], a[2], a[0]), det(n[0], n[1], a[0], a[1])};
        const Vec height = dot(q, n), fall = dot(d, n), steep = hn::Abs(fall);
        const auto upright = [&](Vec v) { return hn::Xor(v, hn::And(fall, hn::SignBit(tag))); };
        const Vec x = upright(det(dot(q, a), dot(d, a), height, fall));
        const Vec y = upright(det(dot(q, b), dot(d, b), height, fall)), along = upright(hn::Neg(height));

        const Vec bcx = load(leaf.directionBC[0]), bcy = load(leaf.directionBC[1]);
        const Vec besideBC = det(bcx, bcy, hn::Sub(x, hn::Mul(load(leaf.lengthAB), steep)), y);
        const Vec besideAC = det(x, y, load(leaf.directionAC[0]), load(leaf.directionAC[1]));
        // the sum of the coordinates is an upper bound of the distance
        const Vec away = hn::Add(hn::Add(hn::Abs(q[0]), hn::Abs(q[1])), hn::Abs(q[2]));
        const Vec room = hn::Add(hn::Mul(hn::Set(tag, passRounding), away), hn::Set(tag, passTolerance));
        const Vec inside = hn::Min(hn::Min(y, along), hn::Min(besideBC, besideAC));
        return bitsOf(hn::And(hn::Ge(hn::Add(inside, room), hn::Zero(tag)),
                              hn::Le(along, hn::Add(hn::Mul(hn::Set(tag, limit_), steep), room))));
    }

    void visit(const WideLeaf& leaf) {
        unsigned bits = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(Tag())) bits |= passed(leaf, i) << i;
        for (; bits != 0; bits &= bits - 1) {
            const std::uint32_t triangle = leaf.triangles[std::countr_zero(bits)];
            if (!exact_.meets(cornersOf(mesh_, triangle), best_, position_)) continue;
            triangle_ = triangle;
            limitTo(best_);
        }
    }

    const Mesh& mesh_;
    const WideTree& tree_;
    Place place_;
    glm::vec3 direction_;
    TriangleRay exact_;
    double perMetre_, best_;
    float limit_ = 0;
    float perDirection_[3], nearOrigin_[3], farOrigin_[3];
    bool forward_[3];
    glm::dvec3 position_{0};
    std::uint32_t triangle_ = noTriangle;
};

// The squared distances to a leaf's triangles.
inline void measureLeaf(const WideLeaf& leaf, const Place& place, float* distance2) {
    const Tag tag;
    for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
        const auto load = [&](const float* from) { return hn::Load(tag, from + i); };
        const Vec x = place.from(leaf, load, 0), y = place.from(leaf, load, 1), z = place.from(leaf, load, 2);
        hn::Store(measureFromCorner(leaf, load, x, y, z).distance2, tag, distance2 + i);
    }
}

// The search for the first contact of a swept sphere, among the triangles that it may reach.
class TouchSearch {
  public:
    TouchSearch(const MeshTree& mesh, const glm::dvec3& start, const Path& path, double radius)
        : mesh_(mesh),
          tree_(mesh.tree()),
          place_(tree_, start),
          path_(path),
          radius_(radius),
          hit_{path.length, glm::dvec3(0), noTriangle} {
        limit();
    }

    std::optional<MeshHit> run() {
        descend(
            tree_, [&](float key) { return key > limit2_; },
            [&](const BoxGroup& group, Waiting& waiting) { open(group, waiting); },
            [&](const WideLeaf& leaf) { return visit(leaf), false; });
        if (hit_.triangle == noTriangle) return std::nullopt;
        return hit_;
    }

  private:
    // Only triangles within this distance from the start can be touched before the best one.
    void limit() {
        const double reach = (radius_ + hit_.along) / double(mesh_.voxelSize());
        const float rounded = std::min(float(reach) * (1 + passRounding) + passTolerance + place_.slack, longestReach);
        limit2_ = rounded * rounded * roundUp;
    }

    void open(const BoxGroup& group, Waiting& waiting) const {
        const Tag tag;
        alignas(64) float distance2[treeWidth];
        unsigned near = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            Vec sum = hn::Zero(tag);
            for (int k = 0; k < 3; ++k) {
                const Vec at = hn::Set(tag, place_.point[k]);
                const Vec gap = hn::Max(hn::Sub(hn::Load(tag, group.lower[k] + i), at),
                                        hn::Sub(at, hn::Load(tag, group.upper[k] + i)));
                sum = hn::Add(sum, square(hn::Max(gap, hn::Zero(tag))));
            }
            hn::Store(sum, tag, distance2 + i);
            near |= bitsOf(hn::Le(sum, hn::Set(tag, limit2_))) << i;
        }
        pushNear(waiting, near, distance2, group.firstChild);
    }

    void visit(const WideLeaf& leaf) {
        alignas(64) float distance2[treeWidth];
        measureLeaf(leaf, place_, distance2);
        for (std::size_t i = 0; i < treeWidth; ++i) {
            if (distance2[i] > limit2_) continue;
            if (!touches(mesh_, leaf.triangles[i], path_, radius_, hit_.along, hit_.position)) continue;
            hit_.triangle = leaf.triangles[i];
            limit();
        }
    }

    const MeshTree& mesh_;
    const WideTree& tree_;
    Place place_;
    Path path_;
    double radius_;
    MeshHit hit_;
    float limit2_ = 0;
};

// The search for a triangle that overlaps a box.
class BoxSearch {
  public:
    BoxSearch(const MeshTree& mesh, const glm::dvec3& centre, const RotatedBox& box)
        : mesh_(mesh.mesh()), tree_(mesh.tree()), place_(tree_, centre), box_(box) {
        const double perMetre = 1 / double(mesh.voxelSize());
        const glm::dvec3 half = box.halfSize * perMetre;
        const float room = passTolerance + place_.slack;
        const float radius = std::min(float(glm::length(half)) * (1 + passRounding) + room, longestReach);
        limit2_ = radius * radius * roundUp;
        for (int k = 0; k < 3; ++k) {
            axes_[k] = glm::vec3(box.axes[k]);
            half_[k] = float(half[k]) * (1 + passRounding) + 2 * room;
            around_[k] = float(glm::dot(glm::abs(glm::transpose(box.axes)[k]), half)) * (1 + passRounding) + 2 * room;
        }
    }

    bool run() {
        return descend(
            tree_, [](float) { return false; }, [&](const BoxGroup& group, Waiting& waiting) { open(group, waiting); },
            [&](const WideLeaf& leaf) { return visit(leaf); });
    }

  private:
    // Separating axes: the tree's and the box's own axes separate nearly all disjoint boxes.
    void open(const BoxGroup& group, Waiting& waiting) const {
        const Tag tag;
        const Vec halve = hn::Set(tag, 0.5f);
        alignas(64) float distance2[treeWidth];
        unsigned near = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            Vec centre[3], half[3], sum = hn::Zero(tag);
            Mask met = hn::FirstN(tag, treeWidth);
            for (int k = 0; k < 3; ++k) {
                const Vec lower = hn::Load(tag, group.lower[k] + i), upper = hn::Load(tag, group.upper[k] + i);
                half[k] = hn::Mul(halve, hn::Sub(upper, lower));
                centre[k] = hn::Sub(hn::Mul(halve, hn::Add(lower, upper)), hn::Set(tag, place_.point[k]));
                const Vec gap = hn::Sub(hn::Abs(centre[k]), half[k]);
                sum = hn::Add(sum, square(hn::Max(gap, hn::Zero(tag))));
                met = hn::And(met, hn::Le(gap, hn::Set(tag, around_[k])));
            }
            for (int axis = 0; axis < 3; ++axis) {
                Vec way = hn::Zero(tag), reach = hn::Set(tag, half_[axis]);
                for (int k = 0; k < 3; ++k) {
                    way = hn::Add(way, hn::Mul(centre[k], hn::Set(tag, axes_[axis][k])));
                    reach = hn::Add(reach, hn::Mul(half[k], hn::Set(tag, std::abs(axes_[axis][k]))));
                }
                met = hn::And(met, hn::Le(hn::Abs(way), reach));
            }
            hn::Store(sum, tag, distance2 + i);
            near |= bitsOf(met) << i;
        }
        pushNear(waiting, near, distance2, group.firstChild);
    }

    bool visit(const WideLeaf& leaf) const {
        alignas(64) float distance2[treeWidth];
        measureLeaf(leaf, place_, distance2);
        for (std::size_t i = 0; i < treeWidth; ++i)
            if (distance2[i] <= limit2_ && overlaps(box_, cornersOf(mesh_, leaf.triangles[i]))) return true;
        return false;
    }

    const Mesh& mesh_;
    const WideTree& tree_;
    Place place_;
    RotatedBox box_;
    float limit2_ = 0;
    glm::vec3 axes_[3];
    float half_[3], around_[3];  // extents of the box along its own axes, and along the tree's
};

std::optional<MeshHit> searchRay(const MeshTree& mesh, const glm::dvec3& start, const Path& path) {
    return RaySearch(mesh, start, path).run();
}

std::optional<MeshHit> searchTouch(const MeshTree& mesh, const glm::dvec3& start, const Path& path, double radius) {
    return TouchSearch(mesh, start, path, radius).run();
}

bool searchBox(const MeshTree& mesh, const glm::dvec3& centre, const RotatedBox& box) {
    return BoxSearch(mesh, centre, box).run();
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {
namespace {

HWY_EXPORT(searchRay);
HWY_EXPORT(searchTouch);
HWY_EXPORT(searchBox);

// A point in the tree's frame [voxels].
glm::dvec3 toTree(const MeshTree& mesh, const glm::dvec3& point) {
    return point / double(mesh.voxelSize()) - glm::dvec3(mesh.tree().base);
}

}  // namespace

std::optional<MeshHit> firstHit(const MeshTree& mesh, const Path& path) noexcept {
    // starts near the mesh, where single precision is sufficient
    const auto [lower, upper] = mesh.box();
    const auto part = partIn(path, lower, upper);
    if (!part) return std::nullopt;
    auto hit = HWY_DYNAMIC_DISPATCH(searchRay)(mesh, toTree(mesh, part->path.origin), part->path);
    if (hit) hit->along += part->from;
    return hit;
}

std::optional<MeshHit> firstTouch(const MeshTree& mesh, const Path& path, double radius) noexcept {
    return HWY_DYNAMIC_DISPATCH(searchTouch)(mesh, toTree(mesh, path.origin), path, radius);
}

bool meetsTriangle(const MeshTree& mesh, const RotatedBox& box) noexcept {
    return HWY_DYNAMIC_DISPATCH(searchBox)(mesh, toTree(mesh, box.centre), box);
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
