// SPDX-License-Identifier: Apache-2.0
// The prism method against three references: brute force over all triangles and voxels in double precision; true
// distances where the method guarantees them; and itself, with other mappings and batch sizes.
#include "cl/detail/prism.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <vector>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/support/support.h"

namespace bilayer::prism_test {
using namespace bilayer::detail;
using Catch::Matchers::Contains;

namespace {

constexpr double exactness = 1e-4;  // tolerance of the distance to a triangle [voxels]
constexpr double unsure = 2e-3;     // this close to a side of a prism, a voxel may be inside or outside of it [voxels]

BuildOptions optionsFor(const Mesh& mesh, float resolution, float halfWidth = 2) {
    BuildOptions options;
    options.method = Method::prism;
    options.voxelSize = voxelSizeFor(mesh, resolution);
    options.exteriorWidthVoxels = options.interiorWidthVoxels = halfWidth;
    return options;
}

LevelSet built(const Mesh& mesh, const BuildOptions& options, const OpenclOptions& opencl = {}) {
    return build(mesh, options, openclFiller(openDevice(), opencl));
}

// The method's expected result for a voxel.
struct Expected {
    double distance = std::numeric_limits<double>::infinity();  // unsigned
    bool inside = false, outside = false;  // by the nearest triangles; both are set where these disagree
};

// The method as specified, for welded meshes with one or two triangles at each edge.
class Reference {
  public:
    Reference(const Mesh& mesh, float voxelSize, double reach) : reach_(reach) {
        std::map<std::pair<unsigned, unsigned>, unsigned> apexes;  // by directed edge
        for (const glm::uvec3& t : mesh.triangles)
            for (int k = 0; k < 3; ++k) apexes[{t[k], t[(k + 1) % 3]}] = t[(k + 2) % 3];
        const auto at = [&](unsigned vertex) { return glm::dvec3(mesh.points[vertex]) / double(voxelSize); };
        for (const glm::uvec3& t : mesh.triangles) {
            Prism prism{{at(t.x), at(t.y), at(t.z)}, {}, {}};
            const auto& [a, b, c] = prism.corners;
            prism.normal = glm::normalize(glm::cross(b - a, c - a));
            for (int k = 0; k < 3; ++k) {
                const unsigned from = t[k], to = t[(k + 1) % 3];
                const auto neighbour = apexes.find({to, from});
                const auto into = [&](unsigned apex) {
                    const glm::dvec3 along = glm::normalize(at(to) - at(from)), offset = at(apex) - at(from);
                    return glm::normalize(offset - glm::dot(offset, along) * along);
                };
                prism.sides[std::size_t(k)] = neighbour == apexes.end()
                                                  ? glm::dvec3(0)
                                                  : glm::normalize(into(t[(k + 2) % 3]) - into(neighbour->second));
            }
            prisms_.push_back(prism);
        }
    }

    // With all prisms wider or narrower by a margin [voxels].
    Expected at(const glm::dvec3& voxel, double wider) const {
        Expected found;
        for (const Prism& prism : prisms_) {
            if (!prism.holds(voxel, reach_, wider)) continue;
            const double distance = prism.distance(voxel);
            if (distance > found.distance + exactness) continue;
            if (distance < found.distance - exactness) found = {};
            found.distance = std::min(distance, found.distance);
            (glm::dot(prism.normal, voxel - prism.corners[0]) < 0 ? found.inside : found.outside) = true;
        }
        return found;
    }

    double distanceTo(std::size_t triangle, const glm::dvec3& voxel) const { return prisms_[triangle].distance(voxel); }

  private:
    struct Prism {
        std::array<glm::dvec3, 3> corners;
        glm::dvec3 normal;
        std::array<glm::dvec3, 3> sides;  // normals of the planes through the edges

        bool holds(const glm::dvec3& voxel, double reach, double wider) const {
            if (std::abs(glm::dot(normal, voxel - corners[0])) > reach) return false;
            for (std::size_t k = 0; k < 3; ++k)
                if (glm::dot(sides[k], voxel - corners[k]) < -wider) return false;
            return true;
        }
        double distance(const glm::dvec3& voxel) const {
            return std::sqrt(test::squaredDistance(voxel, corners[0], corners[1], corners[2]));
        }
    };
    double reach_;
    std::vector<Prism> prisms_;
};

glm::dvec3 pointOf(const openvdb::Coord& voxel) {
    return {voxel.x(), voxel.y(), voxel.z()};
}

// Visits all voxels of the leaves that meet the band.
template <class Visit>
void forEachVoxel(const openvdb::FloatGrid& grid, Visit visit) {
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf)
        for (auto voxel = leaf->cbeginValueAll(); voxel; ++voxel)
            visit(voxel.getCoord(), *voxel, leaf->isValueOn(voxel.pos()));
}

struct Count {
    std::size_t compared = 0, wrong = 0, wrongSide = 0, missing = 0, extra = 0;
};

Count compare(const Reference& reference, const LevelSet& field, double width) {
    Count count;
    forEachVoxel(*field.grids().distance, [&](const openvdb::Coord& at, float value, bool active) {
        const Expected wide = reference.at(pointOf(at), unsure), narrow = reference.at(pointOf(at), -unsure);
        if (wide.distance != narrow.distance || wide.inside != narrow.inside || wide.outside != narrow.outside) return;
        const double found = std::abs(double(value)) / double(field.voxelSize());
        ++count.compared;
        if (active) {
            count.extra += !(wide.distance < width + exactness);
            count.wrong += std::abs(found - wide.distance) > exactness;
            if (wide.distance > exactness && wide.inside != wide.outside)
                count.wrongSide += std::signbit(value) != wide.inside;
        } else {
            count.missing += wide.distance < width - exactness;
        }
    });
    return count;
}

void checkSame(const LevelSet& a, const LevelSet& b) {
    const openvdb::FloatGrid &expected = *a.grids().distance, &found = *b.grids().distance;
    REQUIRE(found.tree().hasSameTopology(expected.tree()));
    std::size_t differing = 0;
    auto f = found.cbeginValueAll();
    for (auto e = expected.cbeginValueAll(); e; ++e, ++f) differing += *e != *f || std::signbit(*e) != std::signbit(*f);
    CHECK(differing == 0);
    if (!a.grids().triangle) return;
    const openvdb::Int32Grid &expectedOwners = *a.grids().triangle, &foundOwners = *b.grids().triangle;
    REQUIRE(foundOwners.tree().hasSameTopology(expectedOwners.tree()));
    auto g = foundOwners.cbeginValueOn();
    for (auto e = expectedOwners.cbeginValueOn(); e; ++e, ++g) differing += *e != *g;
    CHECK(differing == 0);
}

// Rotates the mesh off the lattice directions.
Mesh tilted(const Mesh& mesh) {
    return transformed(mesh, glm::rotate(glm::mat4(1), 0.7f, glm::vec3(0.3f, 0.5f, -0.8f)));
}

struct Shape {
    const char* name;
    Mesh mesh;
    float resolution;
};

std::vector<Shape> shapesOf() {
    return {{"box of 12 triangles", shapes::box({1.f, 0.6f, 0.3f}), 24},
            {"tilted box of 12 triangles", tilted(shapes::box({1.f, 0.6f, 0.3f})), 24},
            {"sphere", shapes::sphere(1.f, 2), 20},
            {"coarse torus", shapes::torus(1.f, 0.4f, 24, 12), 30},
            {"fine torus", shapes::torus(1.f, 0.4f, 60, 24), 16}};
}

}  // namespace

TEST_CASE("prisms give what asking all of them at every voxel gives") {
    const KernelMapping mapping = GENERATE(KernelMapping::blockPerItem, KernelMapping::groupPerBlock);
    const float width = GENERATE(1.25f, 2.f, 4.5f);
    for (const Shape& shape : shapesOf()) {
        CAPTURE(shape.name, width);
        const BuildOptions options = optionsFor(shape.mesh, shape.resolution, width);
        const LevelSet field = built(shape.mesh, options, {.mapping = mapping});
        // as build() requests: slightly more than the band
        const Reference reference(shape.mesh, options.voxelSize, double(width) + 1e-3);
        const Count count = compare(reference, field, double(width));
        CHECK(count.compared > 1000);
        CHECK(count.wrong == 0);
        CHECK(count.wrongSide == 0);
        CHECK(count.missing == 0);
        CHECK(count.extra == 0);
    }
}

TEST_CASE("prisms give what asking all of them gives where they leak") {
    for (const char* name : {"thingi_88566.stl", "marian_chair.obj", "sliver_tet.ply"}) {
        const auto path = test::corpusMesh(name);
        if (!path) continue;
        CAPTURE(name);
        const Mesh mesh = readMesh(*path);
        const BuildOptions options = optionsFor(mesh, 32);
        const LevelSet field = built(mesh, options);
        const Count count = compare(Reference(mesh, options.voxelSize, 2.001), field, 2);
        CHECK(count.compared > 1000);
        CHECK(count.wrong == 0);
        CHECK(count.wrongSide == 0);
        CHECK(count.missing == 0);
        CHECK(count.extra == 0);
    }
}

TEST_CASE("in a convex body every voxel nearest to the inside of a face is right") {
    // of huge triangles, which stress single precision
    const Mesh mesh = tilted(shapes::box({1.f, 0.6f, 0.3f}));
    const BuildOptions options = optionsFor(mesh, 250);
    const LevelSet field = built(mesh, options);
    const Reference reference(mesh, options.voxelSize, 2.001);
    const auto inTheBox = [](const glm::dvec3& world) {
        const glm::dvec3 p =
            glm::dvec3(glm::inverse(glm::rotate(glm::dmat4(1), double(0.7f), glm::dvec3(0.3f, 0.5f, -0.8f))) *
                       glm::dvec4(world, 1));
        return glm::abs(p) - glm::dvec3(1.f, 0.6f, 0.3f);
    };
    std::size_t compared = 0, wrong = 0;
    double worst = 0;
    forEachVoxel(*field.grids().distance, [&](const openvdb::Coord& at, float value, bool active) {
        const glm::dvec3 beyond = inTheBox(pointOf(at) * double(options.voxelSize)) / double(options.voxelSize);
        // beyond at most one of the three pairs of faces
        if ((beyond.x > 0) + (beyond.y > 0) + (beyond.z > 0) > 1) return;
        const double truth = std::max({beyond.x, beyond.y, beyond.z});
        if (std::abs(truth) > 2 - exactness) return;
        ++compared;
        const double error = std::abs(double(value) / double(options.voxelSize) - truth);
        worst = std::max(worst, error);
        wrong += !active || error > exactness;
    });
    CAPTURE(worst);
    CHECK(compared > 100000);
    CHECK(wrong == 0);
}

TEST_CASE("a triangle by itself has no side planes") {
    Mesh mesh;
    mesh.points = {{0.f, 0.f, 0.f}, {1.f, 0.2f, 0.1f}, {0.3f, 0.9f, 0.4f}};
    mesh.triangles = {{0, 1, 2}};
    const BuildOptions options = optionsFor(mesh, 30);
    const LevelSet field = built(mesh, options);
    const Reference reference(mesh, options.voxelSize, 2.001);
    std::size_t active = 0, wrong = 0;
    forEachVoxel(*field.grids().distance, [&](const openvdb::Coord& at, float value, bool isActive) {
        const double truth = reference.distanceTo(0, pointOf(at));
        active += isActive;
        if (std::abs(truth - 2) < exactness) return;
        wrong += isActive != (truth < 2) ||
                 (isActive && std::abs(std::abs(double(value)) / double(options.voxelSize) - truth) > exactness);
    });
    CHECK(active > 1000);
    CHECK(wrong == 0);
}

TEST_CASE("both mappings of prisms give the same") {
    const bool triangles = GENERATE(false, true);
    const Mesh mesh = tilted(shapes::torusKnot(2, 3, 1.f, 0.3f));
    BuildOptions options = optionsFor(mesh, 40);
    options.triangles = triangles;
    checkSame(built(mesh, options, {.mapping = KernelMapping::blockPerItem}),
              built(mesh, options, {.mapping = KernelMapping::groupPerBlock}));
}

TEST_CASE("prisms in a little device memory are many batches and the same field") {
    const Mesh mesh = shapes::sphere(1.f, 4);
    BuildOptions options = optionsFor(mesh, 150);
    options.triangles = GENERATE(false, true);
    const LevelSet expected = built(mesh, options);
    REQUIRE(expected.leaves() * blockVoxels * sizeof(float) > std::size_t(4) << 20);
    checkSame(expected, built(mesh, options, {.memoryMiB = 4}));
}

TEST_CASE("too little device memory for prisms is an error that says how much is needed") {
    const Device device = openDevice();
    const Mesh mesh = shapes::sphere(1.f, 6);
    const BlockFiller filler = openclFiller(device, {.memoryMiB = 1});
    CHECK_THROWS_AS(build(mesh, optionsFor(mesh, 20), filler), DeviceError);
    CHECK_THROWS_WITH(build(mesh, optionsFor(mesh, 20), filler),
                      Contains("prisms") && Contains("MiB") && Contains(device.info().name));
}

TEST_CASE("a build of prisms reports what it took on the device") {
    const Mesh mesh = shapes::sphere(1.f, 4);
    const std::uint64_t memory = 16;
    const BlockFiller filler = openclFiller(openDevice(), {.memoryMiB = memory, .profile = true});
    const DeviceTimes times = build(mesh, optionsFor(mesh, 150), filler).buildTimes().device;
    CHECK(times.kernels > 0);
    CHECK(times.peakBytes > sizeof(float) * blockVoxels);
    CHECK(times.peakBytes <= memory << 20);
}

TEST_CASE("the triangle of a voxel is the one whose distance it has") {
    const Mesh mesh = shapes::torus(1.f, 0.4f);
    BuildOptions options = optionsFor(mesh, 40);
    options.triangles = true;
    const LevelSet field = built(mesh, options);
    const Reference reference(mesh, options.voxelSize, 2.001);
    REQUIRE(field.grids().triangle);
    const auto distances = field.grids().distance->getConstAccessor();
    std::size_t wrong = 0, count = 0;
    for (auto owner = field.grids().triangle->cbeginValueOn(); owner; ++owner) {
        ++count;
        const double found = std::abs(double(distances.getValue(owner.getCoord()))) / double(options.voxelSize);
        wrong += *owner < 0 ||
                 std::abs(reference.distanceTo(std::size_t(*owner), pointOf(owner.getCoord())) - found) > exactness;
    }
    CHECK(count == field.activeVoxels());
    CHECK(count > 10000);
    CHECK(wrong == 0);
}

TEST_CASE("prisms do not ask for welded vertices") {
    const Mesh welded = shapes::torus(1.f, 0.4f);
    Mesh loose;
    for (const glm::uvec3& t : welded.triangles) {
        const auto first = unsigned(loose.points.size());
        for (int k = 0; k < 3; ++k) loose.points.push_back(welded.points[t[k]]);
        loose.triangles.push_back({first, first + 1, first + 2});
    }
    const BuildOptions options = optionsFor(welded, 40);
    checkSame(built(welded, options), built(loose, options));
}

TEST_CASE("triangles without area have no prism") {
    const Mesh sound = shapes::sphere(1.f, 3);
    Mesh mesh = sound;
    const glm::uvec3 t = mesh.triangles.front();
    mesh.triangles.push_back({t.x, t.x, t.y});
    const auto middle = unsigned(mesh.points.size());
    mesh.points.push_back(mesh.points[t.x]);
    mesh.points.push_back(mesh.points[t.x] + glm::vec3(0.25f, 0, 0));
    mesh.points.push_back(mesh.points[t.x] + glm::vec3(0.5f, 0, 0));
    mesh.triangles.push_back({middle, middle + 1, middle + 2});
    const BuildOptions options = optionsFor(sound, 40);
    checkSame(built(sound, options), built(mesh, options));
}

TEST_CASE("a field of prisms says that nothing bounds its error") {
    const Mesh mesh = shapes::sphere(1.f, 3);
    const LevelSet field = built(mesh, optionsFor(mesh, 40));
    CHECK(field.method() == "prism");
    CHECK(field.sign() == "prisms");
    CHECK(std::isinf(field.errorBound()));
}

TEST_CASE("a cancelled build of prisms leaves the device usable") {
    const Mesh mesh = shapes::sphere(1.f, 3);
    BuildOptions options = optionsFor(mesh, 150);
    const BlockFiller filler = openclFiller(openDevice(), {.memoryMiB = 4});
    const LevelSet expected = build(mesh, options, filler);
    options.progress = [](float) { return false; };
    CHECK_THROWS_AS(build(mesh, options, filler), Cancelled);
    options.progress = nullptr;
    checkSame(expected, build(mesh, options, filler));
}

TEST_CASE("without a device there are no prisms") {
    const Mesh mesh = shapes::sphere(1.f, 2);
    const BuildOptions options = optionsFor(mesh, 20);
    CHECK_THROWS_WITH(build(mesh, options), Contains("prism") && Contains("OpenCL"));
    CHECK_THROWS_WITH(rebuild(built(mesh, options), mesh, mesh, {}, options), Contains("prism") && Contains("OpenCL"));
}
}  // namespace bilayer::prism_test
