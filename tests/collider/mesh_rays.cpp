// SPDX-License-Identifier: Apache-2.0
// Ray and box searches among triangles against brute force in double precision, by other formulas.
#include "collider/field/triangles/mesh_rays.h"

#include <oneapi/tbb/parallel_for.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <string>
#include <vector>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include "collider/field/queries/sphere_tracing.h"
#include "collider/field/triangles/box_overlaps.h"
#include "collider/field/triangles/triangle_tests.h"
#include "demos/shared/shapes.h"
#include "tests/support/random.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

namespace bilayer::mesh_rays_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

std::vector<Mesh> someMeshes() {
    std::vector<Mesh> meshes{shapes::box(glm::vec3(0.5f), 1), shapes::torus(0.4f, 0.15f, 48, 24),
                             shapes::bowl(0.5f, 0.003f, 48)};
    // closed ones, one with slivers, one of loose triangles, a character of open surfaces
    for (const char* name : {"screwdriver_7k.off", "fandisk.obj", "soup.stl", "Wuson.ply"})
        if (const auto path = corpusMesh(name)) meshes.push_back(readMesh(*path));
    return meshes;
}

// The intersection of a line with a triangle's plane, and its depth within the triangle; negative outside.
struct Crossing {
    double along, margin;
};

Crossing crossing(const Path& path, const TriangleCorners& c) {
    const glm::dvec3 n = glm::cross(c[1] - c[0], c[2] - c[0]);
    const double steep = glm::dot(n, path.direction);
    if (steep == 0) return {infinity, -infinity};
    const double along = glm::dot(c[0] - path.origin, n) / steep;
    double margin = infinity;
    for (std::size_t k = 0; k < 3; ++k) {
        // the signed distance between the ray's line and the edge's
        const glm::dvec3 edge = c[(k + 1) % 3] - c[k];
        const glm::dvec3 across = glm::cross(path.direction, edge);
        const double side = glm::dot(across, c[k] - path.origin) / glm::length(across);
        margin = std::min(margin, steep > 0 ? -side : side);
    }
    return {along, margin};
}

Path randomPath(Random& random, const Bounds& box) {
    const double scale = box.longestSide();
    const glm::dvec3 target = glm::dvec3(box.centre()) + glm::dvec3(random.point(0.5 * scale));
    const glm::dvec3 from = target + random(0, 3) * scale * glm::dvec3(random.direction());
    return {from, glm::normalize(target - from), random(0, 1) < 0.5 ? infinity : random(0, 3) * scale};
}

// The disagreement between a search and brute force about a path.
std::string faultOf(const MeshTree& tree, const Path& path) {
    const double voxel = tree.voxelSize(), near = 2e-5 * voxel, exact = 1e-6 * voxel;
    const auto hit = firstHit(tree, path);
    double surely = infinity, maybe = infinity;  // first triangle that is hit well inside, or near its border
    for (std::uint32_t i = 0; i < tree.mesh().triangles.size(); ++i) {
        const auto [along, margin] = crossing(path, cornersOf(tree.mesh(), i));
        if (along < -near || along > path.length + near) continue;
        if (margin > -near) maybe = std::min(maybe, along);
        if (margin > exact && along > near && along < path.length - near) surely = std::min(surely, along);
    }
    if (!hit) return surely < infinity ? "missed" : "";
    if (maybe == infinity) return "met nothing";
    if (hit->along > surely + exact) return "not the first";
    if (hit->along > path.length) return "beyond the end";
    const TriangleCorners c = cornersOf(tree.mesh(), hit->triangle);
    if (std::sqrt(squaredDistance(hit->position, c[0], c[1], c[2])) > exact) return "not on the triangle";
    if (glm::distance(path.at(hit->along), hit->position) > near) return "not on the path";
    return "";
}

}  // namespace

TEST_CASE("rays meet the first of all triangles") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Mesh& mesh : someMeshes()) {
        const MeshTree tree(mesh, voxelSizeFor(mesh, 64));
        std::vector<Path> paths(1500);
        for (std::size_t i = 0; i < paths.size(); ++i) {
            paths[i] = randomPath(random, bounds(mesh));
            if (i % 4 == 0) {
                glm::dvec3 axis(0);
                axis[int(i / 4 % 3)] = i % 8 ? 1 : -1;
                paths[i].direction = axis;
            }
        }
        std::vector<std::string> faults(paths.size());
        tbb::parallel_for(std::size_t(0), paths.size(), [&](std::size_t i) { faults[i] = faultOf(tree, paths[i]); });
        for (std::size_t i = 0; i < paths.size(); ++i) {
            CAPTURE(mesh.triangles.size(), i);
            REQUIRE(faults[i] == "");
        }
    }
}

TEST_CASE("no ray leaves a closed mesh through an edge or a vertex") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    std::vector<Mesh> closed{shapes::box(glm::vec3(0.5f), 8), shapes::sphere(0.5f, 3), shapes::cone(0.4f, 0.8f, 33)};
    for (const Mesh& mesh : closed) {
        const MeshTree tree(mesh, voxelSizeFor(mesh, 100));
        std::vector<glm::dvec3> targets(mesh.points.begin(), mesh.points.end());
        for (const glm::uvec3& t : mesh.triangles)
            for (int k = 0; k < 3; ++k) {
                const glm::dvec3 a(mesh.points[t[k]]), b(mesh.points[t[(k + 1) % 3]]);
                targets.push_back(0.5 * (a + b));
                targets.push_back(glm::mix(a, b, random(0, 1)));
            }
        // exactly towards them from the middle, and nearly from elsewhere inside
        for (const glm::dvec3& from : {glm::dvec3(0), glm::dvec3(random.point(0.05))})
            for (const glm::dvec3& target : targets) {
                const auto hit = firstHit(tree, {from, glm::normalize(target - from), infinity});
                CAPTURE(mesh.triangles.size(), from.x, target.x, target.y, target.z);
                REQUIRE(hit);
                REQUIRE(std::abs(hit->along - glm::distance(from, target)) < 1e-4 * double(tree.voxelSize()));
            }
    }
}

TEST_CASE("a ray meets what it passes by a hair, seen edge-on too, and nothing next to it") {
    constexpr double tolerance = 1e-7;
    const unsigned start = seed();
    CAPTURE(start);
    Random random(start);
    int met = 0, passed = 0;
    for (int i = 0; i < 100000; ++i) {
        // slivers along x, about as thin as the tolerance; the ray is the z axis, before both are rotated
        const double width = std::pow(10, random(-10, -6));
        TriangleCorners corners, flat;
        for (std::size_t k = 0; k < 3; ++k) {
            corners[k] = {random(-1, 1), width * random(-1, 1), random(1, 2)};
            flat[k] = {corners[k].x, corners[k].y, 0};
        }
        const double offset = std::sqrt(squaredDistance(glm::dvec3(0), flat[0], flat[1], flat[2]));
        // the rotated corners are rounded; a triangle seen edge-on shifts along itself
        const double twiceArea = std::abs(glm::cross(flat[1] - flat[0], flat[2] - flat[0]).z);
        const double rounding = 1e-14 / twiceArea;
        if (rounding > tolerance) continue;
        const glm::dquat turn = glm::normalize(glm::dquat(random(-1, 1), random.point(1)));
        for (glm::dvec3& corner : corners) corner = turn * corner;
        const glm::dvec3 direction = turn * glm::dvec3(0, 0, 1);
        double along = 10;
        glm::dvec3 position;
        const bool meets = TriangleRay(glm::dvec3(0), direction, tolerance).meets(corners, along, position);
        CAPTURE(i, width, offset);
        // the tolerance is perpendicular to the longest axis of the direction
        if (offset < 0.5 * tolerance) REQUIRE(meets);
        if (offset > 1.001 * tolerance) REQUIRE_FALSE(meets);
        (meets ? met : passed) += 1;
        if (!meets) continue;
        REQUIRE(glm::length(glm::cross(position, direction)) < 1.001 * tolerance + rounding);
        REQUIRE(squaredDistance(position, corners[0], corners[1], corners[2]) < 1e-18);
        REQUIRE(along == Approx(glm::dot(position, direction)).margin(1e-6));
    }
    REQUIRE(met > 1000);
    REQUIRE(passed > 1000);
}

TEST_CASE("rays that start on a triangle meet it on the way in only") {
    const Mesh box = shapes::box(glm::vec3(0.5f), 2);
    const MeshTree tree(box, 0.02f);
    for (const double offset : {0.0, 1e-12, -1e-12}) {
        const glm::dvec3 from(0.5 + offset, 0.1, 0.2);
        const auto in = firstHit(tree, {from, {-1, 0, 0}, infinity});
        REQUIRE(in);
        REQUIRE(in->along < 1e-9);
        if (offset >= 0) REQUIRE(bool(firstHit(tree, {from, {1, 0, 0}, infinity})) == (offset == 0));
    }
}

TEST_CASE("a sphere first touches the triangle that all triangles say") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Mesh& mesh : someMeshes()) {
        const MeshTree tree(mesh, voxelSizeFor(mesh, 64));
        const Truth truth(mesh);
        const double voxel = tree.voxelSize(), tolerance = 1e-5 * voxel;
        int touched = 0;
        for (int i = 0; i < 300; ++i) {
            Path path = randomPath(random, bounds(mesh));
            const double radius = voxel * std::pow(10, random(-2, 2)), length = random(0.5, 10) * voxel;
            // from where it may come near
            const double start = truth.distance(path.origin);
            path.origin += std::max(0.0, start - radius - random(0, 1) * length) * path.direction;
            path.length = length;
            if (truth.distance(path.origin) < radius + tolerance) continue;
            const auto hit = castSphere(tree, path, radius);
            const double end = hit ? hit->along : path.length;
            CAPTURE(mesh.triangles.size(), i, radius / voxel, length / voxel);
            for (int k = 0; k <= 100; ++k) REQUIRE(truth.distance(path.at(0.01 * k * end)) > radius - tolerance);
            if (!hit) continue;
            ++touched;
            REQUIRE(truth.distance(path.at(end)) < radius + tolerance);
            REQUIRE(glm::distance(path.at(end), hit->position) < radius + tolerance);
            REQUIRE(truth.distance(hit->position) < tolerance);
        }
        REQUIRE(touched > 10);
    }
}

namespace {

// Whether a part of a triangle remains after clipping by the box's planes (I. Sutherland, G. Hodgman, "Reentrant
// polygon clipping", 1974).
bool leftInBox(const RotatedBox& box, const TriangleCorners& corners, double room) {
    std::vector<glm::dvec3> polygon(corners.begin(), corners.end());
    for (int axis = 0; axis < 3; ++axis)
        for (const double side : {-1.0, 1.0}) {
            std::vector<glm::dvec3> cut;
            const auto depth = [&](const glm::dvec3& p) {
                return box.halfSize[axis] + room - side * glm::dot(box.axes[axis], p - box.centre);
            };
            for (std::size_t i = 0; i < polygon.size(); ++i) {
                const glm::dvec3 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
                const double da = depth(a), db = depth(b);
                if (da >= 0) cut.push_back(a);
                if ((da >= 0) != (db >= 0)) cut.push_back(glm::mix(a, b, da / (da - db)));
            }
            polygon = cut;
        }
    return !polygon.empty();
}

}  // namespace

TEST_CASE("a box meets a triangle where something is left of it in the box") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Mesh& mesh : someMeshes()) {
        const MeshTree tree(mesh, voxelSizeFor(mesh, 64));
        const double scale = bounds(mesh).longestSide(), room = 1e-6 * double(tree.voxelSize());
        std::vector<RotatedBox> boxes(400);
        for (std::size_t i = 0; i < boxes.size(); ++i) {
            const glm::vec3 axis = random.direction();
            const double angle = i % 5 ? random(0, 3) : 0;
            boxes[i].axes = glm::mat3_cast(glm::angleAxis(angle, glm::normalize(glm::dvec3(axis))));
            // a quarter of them around a vertex of the mesh, so that enough of them overlap it
            const std::size_t corner = std::size_t(random(0, double(mesh.points.size()) - 1));
            boxes[i].centre = i % 4 ? glm::dvec3(bounds(mesh).centre()) + glm::dvec3(random.point(0.6 * scale))
                                    : glm::dvec3(mesh.points[corner]);
            for (int k = 0; k < 3; ++k) boxes[i].halfSize[k] = scale * std::pow(10, random(-3.5, -0.3));
        }
        std::vector<int> met(boxes.size());
        tbb::parallel_for(std::size_t(0), boxes.size(), [&](std::size_t i) {
            bool surely = false, maybe = false;
            for (std::uint32_t t = 0; t < mesh.triangles.size() && !surely; ++t) {
                surely = surely || leftInBox(boxes[i], cornersOf(mesh, t), -room);
                maybe = maybe || leftInBox(boxes[i], cornersOf(mesh, t), room);
            }
            const bool answer = meetsTriangle(tree, boxes[i]);
            met[i] = (surely && !answer) || (!maybe && answer) ? -1 : answer;
        });
        for (std::size_t i = 0; i < boxes.size(); ++i) {
            CAPTURE(mesh.triangles.size(), i);
            REQUIRE(met[i] >= 0);
        }
        REQUIRE(std::count(met.begin(), met.end(), 1) > 20);
        REQUIRE(std::count(met.begin(), met.end(), 0) > 20);
    }
}
}  // namespace bilayer::mesh_rays_test
