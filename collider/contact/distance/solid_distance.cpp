// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/distance/solid_distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <utility>

#include "collider/contact/distance/gjk.h"
#include "collider/contact/distance/posed_tree.h"

namespace bilayer::detail {

namespace {

// Tolerance of the distance of a triangle [sizes of the mesh].
constexpr double searchPrecision = 1e-8;
// Weights of corners below this are rounding.
constexpr double minWeight = 1e-9;

/// The closest points of a triangle and a solid.
struct TriangleDistance {
    double distance = std::numeric_limits<double>::infinity();
    TrianglePoint onTriangle;
    glm::dvec3 onSolid{0};
};

double extentAlong(const glm::dvec3& normal, const OrientedBounds& box) {
    return glm::dot(glm::abs(normal * box.axes), box.half);
}

/// The feature that holds a point with these weights of the corners.
TrianglePoint pointOn(const std::array<double, 3>& weights, const glm::dvec3& position) {
    std::array<int, 3> used{};
    int count = 0;
    for (int i = 0; i < 3; ++i)
        if (weights[std::size_t(i)] > minWeight) used[std::size_t(count++)] = i;
    if (count == 1) return {position, Feature::vertex, std::uint8_t(used[0])};
    // edge 2 runs from the last corner to the first
    if (count == 2) return {position, Feature::edge, std::uint8_t(used[0] == 0 && used[1] == 2 ? 2 : used[0])};
    return {position, Feature::face, 0};
}

// Each solid has
// - minDistance: it is no nearer to anything;
// - double bound(const OrientedBounds&): a lower bound of the distance of what is in a box;
// - TriangleDistance of(const TriangleCorners&, double limit): the distance of a triangle, if it is below the limit.

class PosedConvex {
  public:
    static constexpr double minDistance = 0;

    PosedConvex(const Convex& convex, const Similarity& toMesh, double size)
        : convex_(convex),
          toMesh_(toMesh),
          growth_(toMesh.scale * double(convex.growth())),
          tolerance_(searchPrecision * size) {}

    double bound(const OrientedBounds& box) const {
        const NearestPoint nearest =
            convex_.nearest(glm::vec3(toMesh_.inverse(box.centre)), std::numeric_limits<float>::max());
        // the whole body lies below this plane
        return toMesh_.scale * double(nearest.distance) -
               extentAlong(toMesh_.rotation * glm::dvec3(nearest.normal), box);
    }

    TriangleDistance of(const TriangleCorners& corners, double limit) const {
        const auto cornerAlong = [&](const glm::dvec3& direction) {
            int farthest = 0;
            for (int i = 1; i < 3; ++i)
                if (glm::dot(direction, corners[std::size_t(i)]) > glm::dot(direction, corners[std::size_t(farthest)]))
                    farthest = i;
            return std::pair(corners[std::size_t(farthest)], farthest);
        };
        const auto support = [&](const glm::dvec3& direction) {
            const glm::dvec3 own = direction * toMesh_.rotation;
            return toMesh_(glm::dvec3(convex_.support(glm::vec3(own / glm::length(own)))));
        };
        const ConvexPair pair = convexDistance(cornerAlong, support, tolerance_, limit + growth_);
        if (!(pair.distance < std::numeric_limits<double>::infinity())) return {};
        std::array<double, 3> weights{};
        for (std::size_t i = 0; i < pair.simplex.count; ++i)
            weights[std::size_t(pair.simplex.vertices[i].cornerOfA)] += pair.simplex.weights[i];
        const double distance = std::max(pair.distance - growth_, 0.0);
        const glm::dvec3 outward = pair.distance > 0 ? (pair.onA - pair.onB) / pair.distance : glm::dvec3(0);
        return {distance, pointOn(weights, pair.onA), pair.onB + growth_ * outward};
    }

  private:
    const Convex& convex_;
    const Similarity& toMesh_;
    double growth_, tolerance_;
};

class PosedHalfSpace {
  public:
    static constexpr double minDistance = -std::numeric_limits<double>::infinity();

    PosedHalfSpace(const HalfSpace& solid, const Similarity& toMesh)
        : normal_(toMesh.rotation * glm::dvec3(solid.normal)),
          offset_(toMesh.scale * double(solid.offset) + glm::dot(normal_, toMesh.shift)) {}

    double bound(const OrientedBounds& box) const { return heightOf(box.centre) - extentAlong(normal_, box); }

    TriangleDistance of(const TriangleCorners& corners, double) const {
        std::uint8_t lowest = 0;
        for (std::uint8_t i = 1; i < 3; ++i)
            if (heightOf(corners[i]) < heightOf(corners[lowest])) lowest = i;
        const double height = heightOf(corners[lowest]);
        return {height, {corners[lowest], Feature::vertex, lowest}, corners[lowest] - height * normal_};
    }

  private:
    double heightOf(const glm::dvec3& point) const { return glm::dot(normal_, point) - offset_; }

    glm::dvec3 normal_;
    double offset_;
};

class PosedTriangle {
  public:
    static constexpr double minDistance = 0;

    PosedTriangle(const Triangle& triangle, const Similarity& toMesh) {
        for (std::size_t i = 0; i < 3; ++i) corners_[i] = toMesh(glm::dvec3(triangle[i]));
    }

    double bound(const OrientedBounds& box) const {
        const TrianglePair nearest = closestPoints({box.centre, box.centre, box.centre}, corners_);
        const double distance = std::sqrt(nearest.distance2);
        if (!(distance > 0)) return 0;
        return distance - extentAlong((box.centre - nearest.b.position) / distance, box);
    }

    TriangleDistance of(const TriangleCorners& corners, double) const {
        const TrianglePair pair = closestPoints(corners, corners_);
        return {std::sqrt(pair.distance2), pair.a, pair.b.position};
    }

  private:
    TriangleCorners corners_;
};

/// The search for the triangle of a mesh that is nearest to a solid: the nodes of its hierarchy, nearest first.
template <class Solid>
class SolidSearch {
  public:
    SolidSearch(const Solid& solid, const MeshTree& mesh, double limit)
        : solid_(solid), mesh_(mesh), posed_(mesh, identity_) {
        best_.distance = limit;
    }

    SolidDistance run(std::uint32_t start) {
        if (start < posed_.triangleCount()) measure(start);
        push({mesh_.tree().root()});
        while (!stack_.isEmpty() && best_.distance > Solid::minDistance) {
            const Pending next = stack_.pop();
            if (!(next.bound < best_.distance)) continue;
            if (mesh_.tree().isLeaf(next.node.index))
                for (const std::uint32_t triangle : LeafTriangles(mesh_.tree().leaves[next.node.index]))
                    measure(triangle);
            else
                open(next.node.index);
        }
        return best_;
    }

  private:
    struct Pending {
        double bound;
        PosedNode node;
    };

    void push(const PosedNode& node) {
        const double bound = solid_.bound(posed_.boundsOf(node));
        if (bound < best_.distance) stack_.push({bound, node});
    }

    /// Replaces a node by its children, the nearest last.
    void open(std::uint32_t node) {
        const OrientedBoxes& group = mesh_.group(node);
        stack_.pushSorted([&] {
            for (std::uint32_t slot = 0; slot < treeWidth; ++slot)
                if (group.lower[0][slot] <= group.upper[0][slot]) push({group.firstChild + slot, &group, slot});
        });
    }

    void measure(std::uint32_t triangle) {
        const TriangleDistance found = solid_.of(posed_.corners(triangle), best_.distance);
        if (found.distance <= best_.distance && (found.distance < best_.distance || !best_.found()))
            best_ = {triangle, found.onTriangle, found.onSolid, found.distance};
    }

    const Solid& solid_;
    const MeshTree& mesh_;
    const Similarity identity_;
    PosedTree posed_;
    SolidDistance best_;
    NearestStack<Pending> stack_;
};

double lengthOf(const MeshTree& mesh) {
    const auto [lower, upper] = mesh.box();
    return glm::distance(lower, upper);
}

}  // namespace

SolidDistance nearestTo(const Convex& convex, const MeshTree& mesh, const Similarity& toMesh, double limit,
                        std::uint32_t start) {
    return SolidSearch(PosedConvex(convex, toMesh, lengthOf(mesh)), mesh, limit).run(start);
}

SolidDistance nearestTo(const HalfSpace& solid, const MeshTree& mesh, const Similarity& toMesh, double limit,
                        std::uint32_t start) {
    return SolidSearch(PosedHalfSpace(solid, toMesh), mesh, limit).run(start);
}

SolidDistance nearestTo(const Triangle& triangle, const MeshTree& mesh, const Similarity& toMesh, double limit,
                        std::uint32_t start) {
    return SolidSearch(PosedTriangle(triangle, toMesh), mesh, limit).run(start);
}

}  // namespace bilayer::detail
