// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/sign_choice.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>
#include <string>
#include <vector>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/mesh/side_classification.h"
#include "tests/support/support.h"

namespace bilayer::sign_choice_test {
using namespace bilayer::detail;

namespace {

std::optional<Mesh> corpus(const std::string& name) {
    const auto path = test::corpusMesh(name);
    return path ? std::optional(readMesh(*path)) : std::nullopt;
}

// Whether half-edges are balanced, by counting.
bool balancedByCounting(const Mesh& input) {
    const Mesh mesh = weld(input);
    std::vector<std::pair<std::pair<unsigned, unsigned>, int>> runs;
    for (const auto& t : mesh.triangles)
        for (int k = 0; k < 3; ++k) {
            const unsigned a = t[k], b = t[(k + 1) % 3];
            runs.push_back({std::minmax(a, b), a < b ? 1 : -1});
        }
    std::sort(runs.begin(), runs.end());
    int net = 0;
    for (std::size_t i = 0; i < runs.size(); ++i) {
        net += runs[i].second;
        const bool last = i + 1 == runs.size() || runs[i + 1].first != runs[i].first;
        if (last && net != 0) return false;
    }
    return true;
}

}  // namespace

TEST_CASE("balanced() agrees with counting edges, whatever is done to a mesh") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::size_t yes = 0;
    for (int round = 0; round < 2000; ++round) {
        Mesh mesh = round % 2 ? shapes::box({1, 2, 3}, 2) : shapes::torus(2, 0.5f, 6, 5);
        const auto any = [&] { return random() % mesh.triangles.size(); };
        for (unsigned change = random() % 4; change > 0; --change) switch (random() % 6) {
                case 0:
                    std::swap(mesh.triangles[any()].x, mesh.triangles[any()].x);
                    break;
                case 1:
                    mesh.triangles.erase(mesh.triangles.begin() + std::ptrdiff_t(any()));
                    break;
                case 2:
                    mesh.triangles.push_back(mesh.triangles[any()]);
                    break;
                case 3: {
                    glm::uvec3 t = mesh.triangles[any()];
                    mesh.triangles.push_back(t);
                    std::swap(t.y, t.z);
                    mesh.triangles.push_back(t);
                    break;
                }
                case 4:
                    mesh.triangles.push_back({0, 0, 1});
                    break;
                default:  // a separate vertex at the same place
                    glm::uvec3& t = mesh.triangles[any()];
                    mesh.points.push_back(mesh.points[t.x] * 1.f);
                    t.x = unsigned(mesh.points.size() - 1);
            }
        CHECK(balanced(mesh) == balancedByCounting(mesh));
        yes += balanced(mesh);
    }
    CHECK(yes > 200);
    CHECK(yes < 1800);
}

TEST_CASE("balanced() takes zeros of both signs for one") {
    Mesh mesh = shapes::box({1, 1, 1}, 2);
    for (auto& t : mesh.triangles) {
        glm::vec3 point = mesh.points[t.x];
        for (int axis = 0; axis < 3; ++axis)
            if (point[axis] == 0) point[axis] = -point[axis];
        mesh.points.push_back(point);
        t.x = unsigned(mesh.points.size() - 1);
    }
    CHECK(balanced(mesh));
}

TEST_CASE("what a surface bounds is decided by area") {
    CHECK(bounding(shapes::sphere(1, 3)).solid == 1);
    const Bounding both = bounding(shapes::join({shapes::box({2, 2, 2}, 4), shapes::box({1, 1, 1}, 4)}));
    CHECK(both.solid == Approx(0.8).margin(0.02));
    CHECK(both.buried == Approx(0.2).margin(0.02));
    Mesh sheet = shapes::box({1, 1, 1});
    sheet.triangles.resize(2);
    CHECK(bounding(sheet).nothing == 1);
    // doubled faces: the winding number rises by two behind a surface, and returns to zero behind an open surface
    Mesh doubled = shapes::sphere(1, 2);
    doubled.triangles.insert(doubled.triangles.end(), doubled.triangles.begin(), doubled.triangles.end());
    CHECK(bounding(doubled).solid == 1);
    // partly coplanar sides: the wall between two boxes is buried
    for (const float offset : {0.f, 0.1f, 0.25f}) {
        const Mesh box = shapes::box({0.5f, 0.5f, 0.5f}, 3);
        const Bounding stack = bounding(shapes::join({box, shapes::moved(box, {1, offset, 0})}));
        CAPTURE(offset);
        CHECK(stack.nothing == 0);
        CHECK(stack.buried == Approx((1 - offset) / 6).margin(0.02));
    }
}

TEST_CASE("few lines decide what a closed surface bounds as well as many") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> place(-0.6f, 0.6f), size(0.1f, 0.6f);
    for (int i = 0; i < 20; ++i) {
        CAPTURE(i);
        std::vector<Mesh> solids;
        for (int k = 0; k < 6; ++k) {
            const glm::vec3 at(place(random), place(random), place(random));
            const Mesh solid = k % 2 ? shapes::sphere(size(random), 3) : shapes::box(glm::vec3(size(random)), 2);
            solids.push_back(shapes::moved(k == 5 ? shapes::flipped(solid) : solid, at));
        }
        const Mesh mesh = shapes::join(solids);
        const Bounding few = bounding(mesh, nullptr, true), many = bounding(mesh);
        CHECK(few.solid == Approx(many.solid).margin(0.005));
        CHECK(few.buried == Approx(many.buried).margin(0.005));
        CHECK(few.reversed == Approx(many.reversed).margin(0.005));
    }
}

TEST_CASE("closed and oriented public meshes keep their normals") {
    for (const char* name : {"bunny_watertight.obj", "armadillo_100k.ply", "fandisk.obj", "cgal-cheese.off",
                             "thingi_88566.stl", "sliver_tet.ply", "dinner_plate.obj", "cgal-knot2.off",
                             "cube_with_fold.ply", "dragon_vrip_871k.ply", "factory_bolt_m16_loose.obj"}) {
        const auto mesh = corpus(name);
        if (!mesh) return;
        CAPTURE(name);
        const SignChoice choice = chooseSign(*mesh);
        CHECK(choice.sign == Sign::normals);
        CHECK(choice.reason == "closed and oriented");
        CHECK_FALSE(choice.repaired);
    }
}

TEST_CASE("flipped and inside-out public meshes are repaired") {
    struct Case {
        const char* name;
        double volume;
        bool conflict;  // balanced, so only the build detects it
    };
    // the volumes are those of the same surfaces with outward normals; the shuffled files have no reference of their
    // own
    for (const Case& c : {Case{"casting_inverted.off", 0.03391, true}, Case{"cgal-cube-shuffled.off", 8, false},
                          Case{"cgal-blobby-shuffled.off", 0, false}}) {
        const auto mesh = corpus(c.name);
        if (!mesh) return;
        CAPTURE(c.name);
        const SignChoice choice = c.conflict ? chooseSignAfterConflict(*mesh) : chooseSign(*mesh);
        CAPTURE(choice.reason);
        CHECK(choice.sign == Sign::normals);
        REQUIRE(choice.repaired);
        CHECK(balanced(*choice.repaired));
        const MeshReport report = inspect(*choice.repaired);
        CHECK(report.oriented());
        CHECK(report.volume > 0);
        if (c.volume > 0) CHECK(report.volume == Approx(c.volume).epsilon(1e-3));
    }
}

TEST_CASE("open, broken and soup-like public meshes get what suits them") {
    struct Case {
        const char* name;
        Sign sign;
    };
    for (const Case& c :
         {Case{"bunny_zipper.ply", Sign::winding}, Case{"bunny_res2_nasty.ply", Sign::winding},
          Case{"cgal-elephant-with-holes.off", Sign::winding}, Case{"hippo.ply", Sign::winding},
          Case{"factory_nut_m16_loose_subdiv_3x.obj", Sign::winding},
          Case{"cgal-tetra_intersected_by_triangle.off", Sign::winding}, Case{"kiva_pod_lowres.stl", Sign::winding},
          Case{"truck.obj", Sign::winding}, Case{"moebius.obj", Sign::flood}, Case{"soup.stl", Sign::flood},
          Case{"mp_chair.off", Sign::flood}, Case{"leoTest1.obj", Sign::flood},
          Case{"cgal-degtri_sliding.off", Sign::flood}, Case{"formats/multi.ply", Sign::flood}}) {
        const auto mesh = corpus(c.name);
        if (!mesh) return;
        const SignChoice choice = chooseSign(*mesh);
        CAPTURE(c.name, choice.reason);
        CHECK(choice.sign == c.sign);
        CHECK_FALSE(choice.reason.empty());
    }
}

TEST_CASE("a clean solid that holds the tree's large tiles has no conflict wherever it lies") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int round = 0; round < 4; ++round) {
        Mesh mesh = shapes::sphere(200, 5);
        const glm::vec3 shift(random() % 4096, random() % 4096, random() % 4096);
        CAPTURE(round, shift.x, shift.y, shift.z);
        for (glm::vec3& p : mesh.points) p += shift;
        BuildOptions options;
        options.voxelSize = 1;
        const LevelSet field = build(mesh, options);
        CHECK(field.sign() == "normals");
        CHECK(field.signConflicts() == 0);
        // inside out, the same tiles reveal the conflict
        for (glm::uvec3& t : mesh.triangles) std::swap(t.x, t.y);
        CHECK(build(mesh, options).signReason().find("triangles were flipped") != std::string::npos);
    }
}

TEST_CASE("a clean solid has no conflict however narrow its band") {
    for (const float exterior : {0.1f, 0.7f, 1.f})
        for (const float interior : {0.2f, 0.9f, 2.f})
            for (const Mesh& mesh : {shapes::box({1.f, 0.6f, 0.3f}), shapes::torus(1.f, 0.4f)}) {
                CAPTURE(exterior, interior, mesh.triangles.size());
                const LevelSet field = build(mesh, {.voxelSize = voxelSizeFor(mesh, 50),
                                                    .exteriorWidthVoxels = exterior,
                                                    .interiorWidthVoxels = interior});
                CHECK(field.sign() == "normals");
                CHECK(field.signConflicts() == 0);
            }
}

TEST_CASE("after a conflict, surfaces that self-intersect get winding numbers, doubled sheets a flood") {
    struct Case {
        const char* name;
        Sign sign;
        bool repaired = false;  // five closed parts of the plane have every face twice, back to back
    };
    for (const Case& c : {Case{"cgal-bones.off", Sign::winding}, Case{"self_intersectA.obj", Sign::winding},
                          Case{"counter.unitsmm.STL", Sign::winding}, Case{"cow.obj", Sign::winding},
                          Case{"mesh2sdf_plane.obj", Sign::flood, true}, Case{"degenerated.obj", Sign::flood}}) {
        const auto mesh = corpus(c.name);
        if (!mesh) return;
        const SignChoice choice = chooseSignAfterConflict(*mesh);
        CAPTURE(c.name, choice.reason);
        CHECK(choice.sign == c.sign);
        CHECK(choice.repaired.has_value() == c.repaired);
    }
}

TEST_CASE("a double-sided surface is a solid if it is closed but for small holes") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    const auto voxelsInside = [](const LevelSet& field) {
        std::size_t count = 0;
        for (auto value = field.grids().distance->cbeginValueOn(); value; ++value) count += *value < 0;
        return count;
    };
    const std::vector<Mesh> solids{shapes::sphere(1, 3), shapes::torus(1, 0.4f), shapes::box({1, 0.7f, 0.5f}, 6)};
    for (int round = 0; round < 12; ++round) {
        const bool isSolid = round % 2 == 0;
        Mesh half = solids[std::size_t(round / 2) % 3];
        CAPTURE(round, isSolid);
        if (isSolid)
            for (int hole = 1 + round % 3; hole > 0; --hole)
                half.triangles.erase(half.triangles.begin() + std::ptrdiff_t(random() % half.triangles.size()));
        else {  // without a third of its height
            const float top = 0.33f * bounds(half).upper.z;
            std::erase_if(half.triangles, [&](const glm::uvec3& t) {
                return std::max({half.points[t.x].z, half.points[t.y].z, half.points[t.z].z}) > top;
            });
        }
        const bool isInsideOut = random() % 2;
        const Mesh outward = half;
        if (isInsideOut) half = shapes::flipped(half);
        const Mesh mesh = weld(shapes::join({half, shapes::flipped(half)}));
        const float h = voxelSizeFor(mesh, 20 + float(random() % 40));
        for (const Method method : {Method::exact, Method::pseudonormal}) {
            const LevelSet field = build(mesh, {.voxelSize = h, .method = method});
            CAPTURE(isInsideOut, h, method, field.sign(), field.signReason());
            if (!isSolid) {
                CHECK(field.sign() == "normals");
                CHECK(double(voxelsInside(field)) < 1e-3 * double(field.activeVoxels()));
                continue;
            }
            CHECK(field.sign() == "winding");
            CHECK(field.signReason().find("back to back") != std::string::npos);
            // the same surface with one side has the same inside, but near the holes
            const LevelSet once = build(outward, {.voxelSize = h, .method = method});
            CHECK(double(voxelsInside(field)) == Approx(double(voxelsInside(once))).epsilon(2e-2));
        }
    }
}
}  // namespace bilayer::sign_choice_test
