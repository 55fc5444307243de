// SPDX-License-Identifier: Apache-2.0
// Boxes and points for tests of unions.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <random>
#include <utility>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "demos/shared/shapes.h"
#include "tests/support/cells.h"
#include "tests/support/truth.h"

namespace bilayer::test {

struct Box {
    glm::vec3 lower, upper;

    Mesh mesh() const {
        return solidOf({{{lower.x, upper.x}, {lower.y, upper.y}, {lower.z, upper.z}}},
                       [](const glm::ivec3&) { return true; });
    }
};

// The surface of the union, by the cells between all planes of all boxes.
inline Mesh truthOf(const std::vector<Box>& boxes) {
    Planes planes;
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<float>& along = planes[std::size_t(axis)];
        for (const Box& box : boxes) along.insert(along.end(), {box.lower[axis], box.upper[axis]});
        std::sort(along.begin(), along.end());
        along.erase(std::unique(along.begin(), along.end()), along.end());
    }
    return solidOf(planes, [&](const glm::ivec3& cell) {
        return std::any_of(boxes.begin(), boxes.end(), [&](const Box& box) {
            for (int axis = 0; axis < 3; ++axis) {
                const auto& along = planes[std::size_t(axis)];
                const auto at = std::size_t(cell[axis]);
                if (along[at] < box.lower[axis] || along[at + 1] > box.upper[axis]) return false;
            }
            return true;
        });
    });
}

// Boxes that often have planes in common, so that they touch or are flush.
inline std::vector<Box> randomBoxes(std::mt19937& random, int count) {
    std::uniform_real_distribution<float> anywhere(-1, 1);
    std::uniform_int_distribution<int> coarse(-4, 4);
    const bool flush = random() % 2 == 0;
    std::vector<Box> boxes;
    for (int i = 0; i < count; ++i) {
        Box box;
        for (int axis = 0; axis < 3; ++axis) {
            float a = 0, b = 0;
            while (a == b) {
                a = flush ? 0.25f * float(coarse(random)) : anywhere(random);
                b = flush ? 0.25f * float(coarse(random)) : anywhere(random);
            }
            box.lower[axis] = std::min(a, b);
            box.upper[axis] = std::max(a, b);
        }
        boxes.push_back(box);
    }
    return boxes;
}

inline Mesh joined(const std::vector<Box>& boxes) {
    std::vector<Mesh> meshes;
    for (const Box& box : boxes) meshes.push_back(box.mesh());
    return shapes::join(meshes);
}

inline Mesh turned(Mesh mesh, const glm::dquat& rotation) {
    for (glm::vec3& p : mesh.points) p = glm::vec3(rotation * glm::dvec3(p));
    return mesh;
}

inline std::vector<glm::dvec3> randomPoints(std::mt19937& random, int count, double reach = 1.3) {
    std::uniform_real_distribution<double> anywhere(-reach, reach);
    std::vector<glm::dvec3> points;
    for (int i = 0; i < count; ++i) points.emplace_back(anywhere(random), anywhere(random), anywhere(random));
    return points;
}

// The maximum difference of distances to two surfaces.
inline double difference(const Mesh& a, const Mesh& b, const std::vector<glm::dvec3>& points) {
    const Truth first(a), second(b);
    double largest = 0;
    for (const glm::dvec3& p : points) largest = std::max(largest, std::abs(first.distance(p) - second.distance(p)));
    return largest;
}

// A rotated box: a convex solid of six half-spaces.
struct RotatedBox {
    glm::dvec3 centre, half;
    glm::dquat rotation;

    glm::dvec3 toLocal(const glm::dvec3& p) const { return glm::inverse(rotation) * (p - centre); }
    glm::dvec3 toWorld(const glm::dvec3& p) const { return rotation * p + centre; }
    Mesh mesh() const {
        Mesh box = shapes::box(glm::vec3(half));
        for (glm::vec3& p : box.points) p = glm::vec3(toWorld(glm::dvec3(p)));
        return box;
    }
    // The part of a segment within the box, as an interval; empty if first > last.
    std::pair<double, double> within(const glm::dvec3& from, const glm::dvec3& to) const {
        const glm::dvec3 a = toLocal(from), b = toLocal(to);
        double first = 0, last = 1;
        for (int axis = 0; axis < 3; ++axis)
            for (const double side : {-1.0, 1.0}) {
                const double atA = side * a[axis] - half[axis], atB = side * b[axis] - half[axis];
                if (atA > 0 && atB > 0) return {1, 0};
                if (atA > 0) first = std::max(first, atA / (atA - atB));
                if (atB > 0) last = std::min(last, atA / (atA - atB));
            }
        return {first, last};
    }
    std::vector<std::vector<glm::dvec3>> faces() const {
        std::vector<std::vector<glm::dvec3>> found;
        for (int axis = 0; axis < 3; ++axis)
            for (const double side : {-1.0, 1.0}) {
                std::vector<glm::dvec3> face;
                for (const auto& [u, v] : {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)}) {
                    glm::dvec3 p = half;
                    p[axis] *= side;
                    p[(axis + 1) % 3] *= u;
                    p[(axis + 2) % 3] *= v;
                    face.push_back(toWorld(p));
                }
                found.push_back(face);
            }
        return found;
    }
    // The part of a convex polygon within the box.
    std::vector<glm::dvec3> clipped(std::vector<glm::dvec3> polygon) const {
        for (int axis = 0; axis < 3; ++axis)
            for (const double side : {-1.0, 1.0}) {
                std::vector<glm::dvec3> next;
                for (std::size_t i = 0; i < polygon.size(); ++i) {
                    const glm::dvec3 &p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
                    const double atP = side * toLocal(p)[axis] - half[axis], atQ = side * toLocal(q)[axis] - half[axis];
                    if (atP <= 0) next.push_back(p);
                    if (atP * atQ < 0) next.push_back(p + atP / (atP - atQ) * (q - p));
                }
                polygon = next;
            }
        return polygon;
    }
    bool holds(const glm::dvec3& p) const {
        const glm::dvec3 q = glm::abs(toLocal(p)) - half;
        return q.x < 0 && q.y < 0 && q.z < 0;
    }
};

}  // namespace bilayer::test
