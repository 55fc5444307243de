// SPDX-License-Identifier: Apache-2.0
// Unions of axis-aligned boxes for tests of their mass.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "tests/support/cells.h"

namespace bilayer::test {

// Union of overlapping boxes: the surface of all cells between their face planes that lie in one of them.
inline Mesh surfaceOfUnion(const std::vector<Bounds>& boxes) {
    Planes cuts;
    for (const Bounds& box : boxes)
        for (int axis = 0; axis < 3; ++axis)
            for (const float cut : {box.lower[axis], box.upper[axis]}) cuts[std::size_t(axis)].push_back(cut);
    for (auto& some : cuts) std::sort(some.begin(), some.end());
    return solidOf(cuts, [&](const glm::ivec3& cell) {
        glm::vec3 middle(0);
        for (int axis = 0; axis < 3; ++axis) {
            const float* const cut = &cuts[std::size_t(axis)][std::size_t(cell[axis])];
            middle[axis] = 0.5f * (cut[0] + cut[1]);
        }
        return std::any_of(boxes.begin(), boxes.end(), [&](const Bounds& box) {
            return glm::all(glm::greaterThan(middle, box.lower)) && glm::all(glm::lessThan(middle, box.upper));
        });
    });
}

// The smallest distance between two parallel faces of boxes.
inline float smallestStep(const std::vector<Bounds>& boxes) {
    float smallest = std::numeric_limits<float>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<float> planes;
        for (const Bounds& box : boxes) planes.insert(planes.end(), {box.lower[axis], box.upper[axis]});
        std::sort(planes.begin(), planes.end());
        for (std::size_t i = 1; i < planes.size(); ++i) smallest = std::min(smallest, planes[i] - planes[i - 1]);
    }
    return smallest;
}

// The length of all edges between triangles with different normals.
inline double sharpEdgeLength(const Mesh& mesh) {
    using Point = std::array<float, 3>;
    std::map<std::pair<Point, Point>, std::vector<glm::vec3>> normals;
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::vec3 p[] = {mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]};
        for (int k = 0; k < 3; ++k) {
            const glm::vec3 &a = p[k], &b = p[(k + 1) % 3];
            normals[std::minmax(Point{a.x, a.y, a.z}, Point{b.x, b.y, b.z})].push_back(
                glm::normalize(glm::cross(p[1] - p[0], p[2] - p[0])));
        }
    }
    double length = 0;
    for (const auto& [edge, around] : normals) {
        const auto& [a, b] = edge;
        const bool isSharp = std::any_of(around.begin(), around.end(), [first = around[0]](const glm::vec3& normal) {
            return glm::dot(normal, first) < 0.5f;
        });
        if (isSharp) length += std::hypot(double(a[0] - b[0]), double(a[1] - b[1]), double(a[2] - b[2]));
    }
    return length;
}

}  // namespace bilayer::test
