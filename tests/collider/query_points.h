// SPDX-License-Identifier: Apache-2.0
// Points around a mesh, and the meshes and results of closest-point queries.
#pragma once

#include <oneapi/tbb/parallel_for.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <vector>

#include "collider/field/triangles/triangle_tests.h"
#include "demos/shared/shapes.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::test {

inline bool same(const ClosestPoint& a, const ClosestPoint& b) {
    return a.found == b.found && a.distance == b.distance && a.position == b.position && a.normal == b.normal &&
           a.triangle == b.triangle && a.feature == b.feature && a.index == b.index;
}

// Random points: in the band and slightly beyond, anywhere in the box, and far away.
inline std::vector<glm::vec3> pointsAround(const Mesh& mesh, double h, int count, unsigned seed) {
    Random random(seed);
    const Bounds box = bounds(mesh);
    const auto inBox = [&](double room) {
        glm::vec3 p;
        for (int k = 0; k < 3; ++k) p[k] = float(random(double(box.lower[k]) - room, double(box.upper[k]) + room));
        return p;
    };
    std::vector<glm::vec3> points;
    for (int i = 0; i < count; ++i) {
        const detail::TriangleCorners c =
            detail::cornersOf(mesh, std::size_t(random(0, double(mesh.triangles.size()) - 0.5)));
        const double u = random(0, 1), v = random(0, 1 - u);
        points.push_back(glm::vec3(c[0] + u * (c[1] - c[0]) + v * (c[2] - c[0]) +
                                   random(-5, 5) * h * glm::dvec3(random.direction())));
        if (i % 4 == 0) points.push_back(inBox(6 * h));
        if (i % 20 == 0) points.push_back(inBox(double(box.longestSide()) * std::pow(10, random(0, 4))));
    }
    return points;
}

// Oblique to the axes, so that nothing is exact by chance.
inline Mesh tilted(const Mesh& mesh) {
    return transformed(mesh, glm::rotate(glm::translate(glm::mat4(1), glm::vec3(0.31f, -0.17f, 0.23f)), 0.7f,
                                         glm::normalize(glm::vec3(1, 2, 3))));
}

}  // namespace bilayer::test
