// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/inspect.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>

#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::inspect_test {
namespace {

// A box of 12 triangles whose upper corners are permuted relative to the lower ones. Bit i of `diagonals` selects the
// diagonal of face i.
Mesh twistedBox(const std::array<int, 4>& upper, unsigned diagonals) {
    const glm::vec3 corners[] = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
    Mesh mesh;
    for (const glm::vec3& corner : corners) mesh.points.push_back(corner - glm::vec3(0, 0, 1));
    for (const int i : upper) mesh.points.push_back(corners[i] + glm::vec3(0, 0, 1));
    const auto add = [&](unsigned a, unsigned b, unsigned c, unsigned d) {
        if (diagonals & 1)
            mesh.triangles.insert(mesh.triangles.end(), {{a, b, c}, {a, c, d}});
        else
            mesh.triangles.insert(mesh.triangles.end(), {{a, b, d}, {b, c, d}});
        diagonals >>= 1;
    };
    add(0, 3, 2, 1);
    add(4, 5, 6, 7);
    for (unsigned i = 0; i < 4; ++i) add(i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i);
    return mesh;
}

// Whether a part of space has a winding number above one, or of either sign: then the surface self-intersects.
bool overlapsItself(const Mesh& mesh, test::Random& random) {
    long lowest = 0, highest = 0;
    for (int i = 0; i < 300; ++i) {
        const long winding = std::lround(test::windingNumber(mesh, glm::dvec3(random.point(1))));
        lowest = std::min(lowest, winding);
        highest = std::max(highest, winding);
    }
    return highest - lowest > 1;
}

}  // namespace

TEST_CASE("shapes by formula are closed and oriented, and have the volume of the formula") {
    const double pi = glm::pi<double>();
    const std::vector<std::pair<Mesh, double>> all = {
        {shapes::box({1, 2, 3}), 48},
        {shapes::box({1, 2, 3}, 7), 48},
        {shapes::sphere(1, 5), 4 * pi / 3},
        {shapes::torus(2, 0.5, 200, 100), 2 * pi * pi * 2 * 0.25},
        {shapes::cylinder(1, 2, 200), 2 * pi},
        {shapes::cone(1, 3, 200), pi},
        {shapes::bowl(1, 0.1f, 256), 2 * pi / 3 * (1 - 0.729) + pi * 0.0025 / 2 * 2 * pi * 0.95},
        {shapes::torusKnot(2, 3, 1, 0.1f), 0}};
    for (const auto& [mesh, volume] : all) {
        const MeshReport report = inspect(mesh);
        CAPTURE(report.triangles, report.points, report.volume, volume);
        CHECK(report.closed());
        CHECK(report.oriented());
        CHECK(report.components == 1);
        CHECK(report.degenerateTriangles == 0);
        CHECK(report.duplicateTriangles == 0);
        CHECK(report.volume > 0);
        if (volume > 0) CHECK(report.volume == Approx(volume).epsilon(0.003));
    }
}

TEST_CASE("holes, folds and flips are counted") {
    Mesh mesh = shapes::box({1, 1, 1});
    mesh.triangles.pop_back();
    CHECK(inspect(mesh).boundaryEdges == 3);
    CHECK_FALSE(inspect(mesh).closed());
    mesh = shapes::box({1, 1, 1});
    std::swap(mesh.triangles[5].x, mesh.triangles[5].y);
    CHECK(inspect(mesh).misorientedEdges == 3);
    CHECK_FALSE(inspect(mesh).oriented());
    mesh = shapes::box({1, 1, 1});
    mesh.triangles.push_back(mesh.triangles[2]);
    CHECK(inspect(mesh).duplicateTriangles == 1);
    CHECK(inspect(mesh).nonManifoldEdges == 3);
    CHECK(inspect(mesh).misorientedEdges == 3);
    mesh.triangles.push_back({0, 0, 1});
    CHECK(inspect(mesh).degenerateTriangles == 1);
}

TEST_CASE("inside-out components are distinguished from cavities") {
    const Mesh big = shapes::sphere(2, 3), small = shapes::sphere(1, 3), tiny = shapes::sphere(0.5f, 3);
    CHECK(inspect(shapes::flipped(big)).insideOutComponents == 1);
    CHECK(inspect(shapes::join({big, shapes::flipped(small)})).insideOutComponents == 0);
    CHECK(inspect(shapes::join({big, small})).insideOutComponents == 1);
    CHECK(inspect(shapes::join({big, shapes::flipped(small), tiny})).insideOutComponents == 0);
    CHECK(inspect(shapes::join({big, shapes::moved(small, {5, 0, 0})})).insideOutComponents == 0);
    CHECK(inspect(shapes::join({big, shapes::moved(shapes::flipped(small), {5, 0, 0})})).insideOutComponents == 1);
}

TEST_CASE("a hundredth of the area does not count as a common wall") {
    // a cube of area 24 and a small plate whose area is below, or above, 1 % of that
    for (const float side : {0.2f, 0.5f}) {
        Mesh plate = shapes::box({side / 2, side / 2, 0.005f});
        for (glm::vec3& point : plate.points) point.x += 3;
        const MeshReport report = inspect(shapes::join({shapes::box({1, 1, 1}), plate}));
        CHECK(report.thinnestWall == Approx(0.01));
        CHECK(report.commonWall == Approx(side < 0.3f ? 2 : 0.01));
    }
    Mesh sheet;
    sheet.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    sheet.triangles = {{0, 1, 2}};
    CHECK(inspect(sheet).commonWall == 0);
}

TEST_CASE("the thinnest wall is measured through the solid") {
    const MeshReport plate = inspect(shapes::box({1, 1, 0.05f}, 8), 0.2f);
    CHECK(plate.thinnestWall == Approx(0.1));
    CHECK(plate.commonWall == Approx(0.1));
    CHECK(plate.thinWalls == 2 * 2 * 8 * 8);
    CHECK(inspect(shapes::box({1, 1, 0.05f}, 8), 0.05f).thinWalls == 0);
    CHECK(inspect(shapes::bowl(1, 0.1f, 256)).thinnestWall == Approx(0.1).epsilon(0.05));
    // the gap between two bodies does not count as a wall
    const Mesh pair = shapes::join({shapes::box({1, 1, 1}), shapes::moved(shapes::box({1, 1, 1}), {2.01f, 0, 0})});
    CHECK(inspect(pair).thinnestWall == Approx(2));
    CHECK(inspect(pair).commonWall == Approx(2));
}

TEST_CASE("the public corpus is reported as it is known to be") {
    struct Case {
        const char* name;
        std::size_t boundary, nonManifold, misoriented, duplicates, components;
    };
    for (const Case& c : {Case{"bunny_zipper.ply", 223, 0, 0, 0, 1}, Case{"bunny_res2_nasty.ply", 123, 150, 2, 87, 1},
                          Case{"dragon_vrip_res2_nasty.ply", 0, 2534, 0, 1489, 7},
                          Case{"cgal-elephant-with-holes.off", 1353, 0, 0, 0, 1},
                          Case{"cgal-bones.off", 0, 0, 0, 0, 26}, Case{"armadillo_100k.ply", 0, 0, 0, 0, 1},
                          Case{"cgal-blobby-shuffled.off", 0, 0, 3069, 0, 1}, Case{"moebius.obj", 112, 0, 4, 0, 1}}) {
        const auto path = test::corpusMesh(c.name);
        if (!path) return;
        const MeshReport report = inspect(readMesh(*path));
        CAPTURE(c.name);
        CHECK(report.boundaryEdges == c.boundary);
        CHECK(report.nonManifoldEdges == c.nonManifold);
        CHECK(report.misorientedEdges == c.misoriented);
        CHECK(report.duplicateTriangles == c.duplicates);
        CHECK(report.components == c.components);
    }
    CHECK(inspect(readMesh(*test::corpusMesh("casting_inverted.off"))).insideOutComponents == 1);
    CHECK(inspect(readMesh(*test::corpusMesh("cgal-cube-shuffled.off"))).misorientedEdges == 9);
}

TEST_CASE("pairs of triangles that run through each other are counted") {
    const Mesh box = shapes::box({1, 1, 1});
    CHECK(inspect(box).selfIntersections == 0);
    // contact in a plane, along an edge or at a corner is no self-intersection
    CHECK(inspect(shapes::join({box, shapes::moved(box, {2, 0.5f, 0.25f})})).selfIntersections == 0);
    CHECK(inspect(shapes::join({box, shapes::moved(box, {2, 2, 2})})).selfIntersections == 0);
    Mesh needle = box;
    needle.points.insert(needle.points.end(), {{0.25f, 0.5f, -3}, {0.25f, 0.5f, 3}, {9, 0.5f, 3}});
    needle.triangles.push_back({8, 9, 10});
    CHECK(inspect(needle).selfIntersections > 2);
    CHECK(inspect(needle).boundaryLoops == 1);
}

TEST_CASE("surfaces that run through each other where edges cross or touch are noticed") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    test::Random random(seed);
    std::array<int, 4> upper{0, 1, 2, 3};
    int overlapping = 0;
    do
        for (unsigned diagonals = 0; diagonals < 64; ++diagonals) {
            const Mesh mesh = twistedBox(upper, diagonals);
            const bool overlaps = overlapsItself(mesh, random);
            CAPTURE(upper[0], upper[1], upper[2], upper[3], diagonals);
            if (overlaps) CHECK(inspect(mesh).selfIntersections > 0);
            overlapping += overlaps;
        }
    while (std::next_permutation(upper.begin(), upper.end()));
    CHECK(overlapping > 500);
    CHECK(inspect(twistedBox({0, 1, 2, 3}, 0)).selfIntersections == 0);
    // a rotation by a quarter turn: for some diagonals four edges meet in the middle, without another intersection
    CHECK(inspect(twistedBox({1, 2, 3, 0}, 0b111100)).selfIntersections == 0);
}

TEST_CASE("a surface that runs through another's face along its own edges is noticed") {
    const Mesh box = shapes::box({1, 1, 1});
    // a bar whose edges on both sides lie in the plane of the box's upper face
    for (const float height : {0.5f, 1.f, 1.5f}) {
        Mesh bar{{},
                 {{0, 1, 5},
                  {0, 5, 4},
                  {1, 2, 6},
                  {1, 6, 5},
                  {2, 3, 7},
                  {2, 7, 6},
                  {3, 0, 4},
                  {3, 4, 7},
                  {0, 2, 1},
                  {0, 3, 2},
                  {4, 5, 6},
                  {4, 6, 7}}};
        for (const float y : {-0.5f, 0.5f})
            for (const glm::vec3& p :
                 {glm::vec3(-0.5f, y, height), {0, y, height - 0.25f}, {0.5f, y, height}, {0, y, height + 0.25f}})
                bar.points.push_back(p);
        CAPTURE(height);
        CHECK(verdict(inspect(bar)).find("intersecting") == std::string::npos);
        const std::size_t found = inspect(shapes::join({box, bar})).selfIntersections;
        if (height == 1)
            CHECK(found >= 8);
        else
            CHECK(found == 0);
    }
}

TEST_CASE("piercings, loops and fans of the public corpus are those of an independent count") {
    struct Case {
        const char* name;
        std::size_t piercings, loops, vertices;
        std::size_t byEdges = 0;  // pairs of which no edge intersects the other triangle, in integer arithmetic
    };
    for (const Case& c :
         {Case{"dragon_vrip_871k.ply", 206, 0, 0}, Case{"brain.ply", 2182, 9, 2}, Case{"hippo.ply", 274, 1, 3, 14},
          Case{"kiva_pod_lowres.stl", 6815, 4, 44, 115}, Case{"diff_ring.stl", 706, 0, 0},
          Case{"counter.unitsmm.STL", 2272, 0, 0}, Case{"soup.stl", 1248, 100, 0}, Case{"suzanne.obj", 90, 4, 2},
          Case{"cgal-elephant-with-holes.off", 0, 106, 65}, Case{"bunny_watertight.obj", 0, 0, 0}}) {
        const auto path = test::corpusMesh(c.name);
        if (!path) return;
        const MeshReport report = inspect(readMesh(*path));
        CAPTURE(c.name);
        CHECK(report.selfIntersections == c.piercings + c.byEdges);
        CHECK(report.boundaryLoops == c.loops);
        CHECK(report.nonManifoldVertices == c.vertices);
    }
}

TEST_CASE("the verdict says what is wrong") {
    Mesh mesh = shapes::box({1, 1, 1});
    CHECK(verdict(inspect(mesh)) == "closed and oriented");
    CHECK(verdict(inspect(shapes::flipped(mesh))) ==
          "closed, but not oriented: 1 component inside out, 12 triangles to be flipped");
    mesh.triangles.pop_back();
    CHECK(verdict(inspect(mesh)) == "open: 3 boundary edges in 1 loop");
    CHECK(verdict(inspect(Mesh{{{0, 0, 0}, {1, 0, 0}}, {{0, 0, 1}}})) == "no triangle has an area");
}
}  // namespace bilayer::inspect_test
