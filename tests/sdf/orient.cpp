// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/orient.h"

#include <catch2/catch.hpp>
#include <random>

#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/sign/sign_choice.h"
#include "tests/support/support.h"

namespace bilayer::orient_test {
using namespace bilayer::detail;

namespace {

Mesh shuffled(Mesh mesh, unsigned seed) {
    std::mt19937 random(seed);
    for (auto& t : mesh.triangles)
        if (random() % 2) std::swap(t.x, t.y);
    return mesh;
}

void checkUntouched(const Mesh& mesh) {
    const Orientation orientation = orient(mesh);
    CHECK(orientation.flippedTriangles == 0);
    CHECK(orientation.flippedComponents == 0);
    CHECK(orientation.orientable());
    CHECK(orientation.mesh.triangles == mesh.triangles);
    CHECK(orientation.mesh.points == mesh.points);
}

// The winding number of a point after orient().
double windingAfter(const Mesh& mesh, const glm::dvec3& point) {
    return test::windingNumber(orient(mesh).mesh, point);
}

}  // namespace

TEST_CASE("a mesh that is fine keeps its triangles") {
    const Mesh big = shapes::sphere(2, 3), small = shapes::sphere(1, 3), tiny = shapes::sphere(0.5f, 3);
    checkUntouched(big);
    checkUntouched(shapes::torusKnot(2, 3, 1, 0.1f));
    checkUntouched(shapes::join({big, shapes::flipped(small)}));        // a cavity
    checkUntouched(shapes::join({big, shapes::flipped(small), tiny}));  // a solid in a cavity
    checkUntouched(shapes::join({big, small}));                         // a union
    checkUntouched(shapes::join({big, shapes::moved(big, {1, 0, 0})}));
    checkUntouched(
        shapes::join({shapes::box({1, 1, 1}), shapes::moved(shapes::box({1, 1, 1}), {2, 2, 0})}));  // share an edge
}

TEST_CASE("Flipped triangles and shells are flipped back") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    for (const Mesh& mesh : {shapes::box({1, 2, 3}), shapes::sphere(1, 3), shapes::bowl(1, 0.1f, 64)}) {
        CHECK(orient(shapes::flipped(mesh)).flippedTriangles == mesh.triangles.size());
        CHECK(orient(shapes::flipped(mesh)).flippedComponents == 1);
        const Orientation repaired = orient(shuffled(mesh, seed));
        CHECK(repaired.mixedComponents == 1);
        CHECK(balanced(repaired.mesh));
        CHECK(inspect(repaired.mesh).volume == Approx(inspect(mesh).volume));
    }
}

TEST_CASE("A shell that touches another along an edge is flipped alone") {
    const Mesh box = shapes::box({1, 1, 1});
    const Orientation repaired = orient(shapes::join({box, shapes::moved(shapes::flipped(box), {2, 2, 0})}));
    CHECK(repaired.flippedTriangles == box.triangles.size());
    CHECK(inspect(repaired.mesh).volume == Approx(16));
}

TEST_CASE("cavities are kept, and found where the file is not to be trusted") {
    const Mesh big = shapes::sphere(2, 3), small = shapes::sphere(1, 3);
    const glm::dvec3 inCavity(0.1, 0.2, 0.3), inWall(1.5, 0.1, 0.2);
    const unsigned seed = test::seed();
    CAPTURE(seed);
    for (const Mesh& mesh :
         {shapes::join({big, shapes::flipped(small)}), shapes::join({shapes::flipped(big), small}),
          shapes::join({shapes::flipped(big), shapes::flipped(small)}),
          shapes::join({shuffled(big, seed), shuffled(small, seed)}), shapes::join({shapes::flipped(small), big})}) {
        CHECK(windingAfter(mesh, inCavity) == Approx(0).margin(1e-6));
        CHECK(windingAfter(mesh, inWall) == Approx(1));
    }
    CHECK(windingAfter(shapes::join({big, small}), inCavity) == Approx(2));
    // outside of everything a negative winding number is wrong, regardless of neighbours
    const Mesh apart = shapes::join({big, shapes::moved(shapes::flipped(small), {5, 0, 0})});
    CHECK(windingAfter(apart, glm::dvec3(5, 0.1, 0.2)) == Approx(1));
    CHECK(orient(apart).flippedTriangles == small.triangles.size());
}

TEST_CASE("open surfaces are oriented by what they would bound") {
    Mesh open = shapes::flipped(shapes::sphere(1, 3));
    open.triangles.resize(open.triangles.size() - 40);
    CHECK(orient(open).flippedTriangles == open.triangles.size());
    CHECK(orient(shapes::flipped(open)).flippedTriangles == 0);
    // an open flat surface has no inside: the orientation of its majority is kept
    Mesh sheet = shapes::box({1, 1, 1}, 4);
    std::erase_if(sheet.triangles, [&](const glm::uvec3& t) {
        return sheet.points[t.x].z < 1 || sheet.points[t.y].z < 1 || sheet.points[t.z].z < 1;
    });
    REQUIRE(sheet.triangles.size() == 32);
    CHECK(orient(sheet).flippedTriangles == 0);
    CHECK(orient(shapes::flipped(sheet)).flippedTriangles == 0);
    std::swap(sheet.triangles[7].x, sheet.triangles[7].y);
    CHECK(orient(sheet).flippedTriangles == 1);
}

TEST_CASE("a one-sided surface is unchanged and reported") {
    Mesh strip;
    const unsigned segments = 30;
    for (unsigned i = 0; i < segments; ++i) {
        const float angle = 6.2831853f * float(i) / float(segments), half = 0.5f * angle;
        for (const float side : {-0.3f, 0.3f})
            strip.points.push_back({(1 + side * std::cos(half)) * std::cos(angle),
                                    (1 + side * std::cos(half)) * std::sin(angle), side * std::sin(half)});
    }
    for (unsigned i = 0; i < segments; ++i) {
        const bool last = i + 1 == segments;
        const unsigned a = 2 * i, b = a + 1, c = last ? 1 : a + 2, d = last ? 0 : a + 3;
        strip.triangles.push_back({a, b, c});
        strip.triangles.push_back({b, d, c});
    }
    const Orientation orientation = orient(strip);
    CHECK_FALSE(orientation.orientable());
    CHECK(orientation.oneSidedTriangles == strip.triangles.size());
    CHECK(orientation.flippedTriangles == 0);
}

TEST_CASE("degenerate and repeated triangles do not hide a flip") {
    const Mesh box = shapes::box({1, 1, 1}, 3);
    Mesh mesh = shapes::flipped(box);
    mesh.triangles.push_back({0, 0, 1});
    mesh.triangles.push_back({2, 2, 2});
    mesh.triangles.push_back(mesh.triangles[5]);
    std::swap(mesh.triangles[20].x, mesh.triangles[20].y);
    Mesh repaired = orient(mesh).mesh;
    REQUIRE(repaired.triangles.size() == mesh.triangles.size());
    repaired.triangles.pop_back();
    CHECK(balanced(repaired));
    CHECK(inspect(repaired).volume == Approx(8));
}

TEST_CASE("vertices that only coordinates identify are one") {
    const Mesh box = shapes::box({1, 1, 1}, 2);
    Mesh soup;
    for (const auto& t : shapes::flipped(box).triangles) {
        const unsigned first = unsigned(soup.points.size());
        for (int k = 0; k < 3; ++k) {
            glm::vec3 point = box.points[t[k]];
            // zeros of both signs
            if (first % 2)
                for (int axis = 0; axis < 3; ++axis)
                    if (point[axis] == 0) point[axis] = -0.f;
            soup.points.push_back(point);
        }
        soup.triangles.push_back({first, first + 1, first + 2});
    }
    CHECK(orient(soup).flippedTriangles == soup.triangles.size());
    CHECK(orient(soup).flippedComponents == 1);
}

TEST_CASE("orient() twice is orient() once, on all of the public corpus that is not clean") {
    for (const char* name :
         {"bunny_res2_nasty.ply", "dragon_vrip_res2_nasty.ply", "dragon_vrip_res4_nasty.ply", "truck.obj", "Wuson.ply",
          "cgal-b9_mesh.off", "kiva_pod_lowres.stl", "mp_bathtub.obj", "mp_chair.off", "office_chair.obj", "beetle.obj",
          "factory_nut_m16_loose_subdiv_3x.obj", "mesh2sdf_plane.obj", "leoTest1.obj", "moebius.obj", "soup.stl"}) {
        const auto path = test::corpusMesh(name);
        if (!path) return;
        const Mesh mesh = readMesh(*path);
        CAPTURE(name);
        const Orientation once = orient(mesh);
        CHECK(once.mesh.triangles.size() == mesh.triangles.size());
        CHECK(orient(once.mesh).flippedTriangles == 0);
        // one half of a double-sided solid with holes is flipped, which unbalances the rims of its holes
        if (balanced(mesh) && !hasFacesBackToBack(mesh)) CHECK(balanced(once.mesh));
    }
}
}  // namespace bilayer::orient_test
