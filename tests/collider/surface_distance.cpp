// SPDX-License-Identifier: Apache-2.0
#include "tests/collider/surface_distance.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <mutex>
#include <vector>

#include "tests/support/support.h"

namespace bilayer::test {

using namespace detail;

namespace {

// The distance of two segments. The closest points are ends, or the feet of the common perpendicular.
double segmentDistance2(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d) {
    double least = std::min({squaredDistance(a, c, d, d), squaredDistance(b, c, d, d), squaredDistance(c, a, b, b),
                             squaredDistance(d, a, b, b)});
    const glm::dvec3 u = b - a, v = d - c, n = glm::cross(u, v), r = c - a;
    const double n2 = glm::dot(n, n);
    if (!(n2 > 0)) return least;
    const double s = glm::dot(glm::cross(r, v), n) / n2, t = glm::dot(glm::cross(r, u), n) / n2;
    if (s >= 0 && s <= 1 && t >= 0 && t <= 1) least = std::min(least, std::pow(glm::dot(r, n), 2) / n2);
    return least;
}

// Whether a segment passes through a triangle: the volumes of the tetrahedra that they span have the same signs.
bool passes(const glm::dvec3& p, const glm::dvec3& q, const TriangleCorners& c) {
    const auto volume = [](const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d) {
        return glm::dot(glm::cross(b - a, c - a), d - a);
    };
    if (!(volume(c[0], c[1], c[2], p) * volume(c[0], c[1], c[2], q) < 0)) return false;
    const double x = volume(p, q, c[0], c[1]), y = volume(p, q, c[1], c[2]), z = volume(p, q, c[2], c[0]);
    return (x > 0 && y > 0 && z > 0) || (x < 0 && y < 0 && z < 0);
}

}  // namespace

double triangleDistance2(const TriangleCorners& a, const TriangleCorners& b) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t next = (i + 1) % 3;
        if (passes(a[i], a[next], b) || passes(b[i], b[next], a)) return 0;
        least = std::min({least, squaredDistance(a[i], b[0], b[1], b[2]), squaredDistance(b[i], a[0], a[1], a[2])});
        for (std::size_t k = 0; k < 3; ++k)
            least = std::min(least, segmentDistance2(a[i], a[next], b[k], b[(k + 1) % 3]));
    }
    return least;
}

glm::dvec3 inWorld(const Placed& body, const glm::dvec3& point) {
    return glm::normalize(glm::dquat(body.pose.rotation)) * (double(body.scale) * point) +
           glm::dvec3(body.pose.position);
}

namespace {

std::vector<TriangleCorners> worldTriangles(const Placed& body) {
    const Mesh& mesh = body.collider.mesh();
    std::vector<TriangleCorners> all;
    for (const glm::uvec3& t : mesh.triangles)
        all.push_back({inWorld(body, glm::dvec3(mesh.points[t.x])), inWorld(body, glm::dvec3(mesh.points[t.y])),
                       inWorld(body, glm::dvec3(mesh.points[t.z]))});
    return all;
}

}  // namespace

// Triangles whose bounding spheres are farther apart than the best pair are skipped.
double surfaceDistance(const Placed& a, const Placed& b) {
    struct Ball {
        glm::dvec3 centre;
        double radius;
    };
    const auto ballOf = [](const TriangleCorners& c) {
        const glm::dvec3 centre = (c[0] + c[1] + c[2]) / 3.0;
        return Ball{centre,
                    std::max({glm::distance(centre, c[0]), glm::distance(centre, c[1]), glm::distance(centre, c[2])})};
    };
    const std::vector<TriangleCorners> as = worldTriangles(a), bs = worldTriangles(b);
    std::vector<Ball> balls;
    for (const TriangleCorners& c : bs) balls.push_back(ballOf(c));
    // centres of triangles are no closer than the surfaces
    double least2 = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < as.size(); i += 16)
        for (std::size_t k = 0; k < balls.size(); k += 16) {
            const glm::dvec3 between = ballOf(as[i]).centre - balls[k].centre;
            least2 = std::min(least2, glm::dot(between, between));
        }
    std::mutex mutex;
    tbb::parallel_for(std::size_t(0), as.size(), [&](std::size_t i) {
        const Ball ball = ballOf(as[i]);
        double mine2 = std::numeric_limits<double>::infinity();
        {
            const std::lock_guard lock(mutex);
            mine2 = least2;
        }
        for (std::size_t k = 0; k < bs.size(); ++k) {
            const double gap = glm::distance(ball.centre, balls[k].centre) - ball.radius - balls[k].radius;
            if (gap > 0 && gap * gap > mine2) continue;
            mine2 = std::min(mine2, triangleDistance2(as[i], bs[k]));
        }
        const std::lock_guard lock(mutex);
        least2 = std::min(least2, mine2);
    });
    return std::sqrt(least2);
}

}  // namespace bilayer::test
