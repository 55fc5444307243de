#include "collider/mass.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <stdexcept>

#include "demos/shared/shapes.h"
#include "tests/support/analytic.h"
#include "tests/support/support.h"

using namespace bilayer;
using namespace bilayer::test;

namespace {

constexpr double pi = glm::pi<double>();

void requireNear(const glm::vec3& a, const glm::vec3& b, double margin) {
    CAPTURE(a.x, a.y, a.z, b.x, b.y, b.z);
    REQUIRE(glm::length(a - b) <= margin);
}

void requireNear(const glm::mat3& a, const glm::mat3& b, double margin) {
    for (int i = 0; i < 3; ++i) requireNear(a[i], b[i], margin);
}

// The axes turn the diagonal of principal moments into the inertia, without a mirror.
void requireDiagonalises(const MassProperties& mass) {
    const glm::mat3 axes = glm::mat3_cast(mass.principalAxes);
    glm::mat3 diagonal(0);
    for (int i = 0; i < 3; ++i) diagonal[i][i] = mass.principalInertia[i];
    requireNear(axes * diagonal * glm::transpose(axes), mass.inertia, 2e-6 * mass.principalInertia.z);
    REQUIRE(glm::length(mass.principalAxes) == Approx(1).epsilon(1e-6));
    REQUIRE(mass.principalInertia.x <= mass.principalInertia.y);
    REQUIRE(mass.principalInertia.y <= mass.principalInertia.z);
}

glm::mat4 randomMotion(Random& random) {
    const glm::quat turn = glm::angleAxis(float(random(0, 6.28)), random.direction());
    return glm::translate(glm::mat4(1), random.point(3)) * glm::mat4_cast(turn);
}

}  // namespace

TEST_CASE("a box has the mass of the formula") {
    const MassProperties mass = massProperties(shapes::box({0.5f, 1, 1.5f}, 3));  // 1 x 2 x 3
    REQUIRE(mass.volume == Approx(6).epsilon(1e-12));
    requireNear(mass.centre, glm::vec3(0), 1e-7);
    requireNear(mass.principalInertia, glm::vec3(2.5f, 5, 6.5f), 1e-6);  // z, y, x
    requireDiagonalises(mass);
    REQUIRE(mass.inertia[0][0] == Approx(6.5));
    REQUIRE(mass.inertia[1][1] == Approx(5));
    REQUIRE(mass.inertia[2][2] == Approx(2.5));
}

TEST_CASE("a sphere and a torus approach the formulas as their meshes get finer") {
    const double r = 0.7, ball = 4. / 3 * pi * r * r * r;
    const MassProperties sphere = massProperties(shapes::sphere(0.7f, 6));
    REQUIRE(sphere.volume == Approx(ball).epsilon(1e-3));
    requireNear(sphere.principalInertia, glm::vec3(0.4 * ball * r * r), 2e-3 * 0.4 * ball * r * r);
    requireDiagonalises(sphere);

    const double major = 1, minor = 0.3, ring = 2 * pi * pi * major * minor * minor;
    const double axial = ring * (major * major + 0.75 * minor * minor);
    const double across = ring * (0.5 * major * major + 0.625 * minor * minor);
    const MassProperties torus = massProperties(shapes::torus(1, 0.3f, 400, 200));
    REQUIRE(torus.volume == Approx(ring).epsilon(1e-3));
    requireNear(torus.principalInertia, glm::vec3(across, across, axial), 2e-3 * axial);
    requireDiagonalises(torus);
}

TEST_CASE("mass moves and turns with the mesh, far from the origin too") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Mesh mesh =
        shapes::join({shapes::box({0.5f, 0.2f, 0.3f}),
                      transformed(shapes::sphere(0.3f, 3), glm::translate(glm::mat4(1), {0.9f, 0.6f, 0.1f}))});
    const MassProperties still = massProperties(mesh);
    for (int i = 0; i < 50; ++i) {
        const glm::mat4 motion = randomMotion(random);
        const glm::mat3 turn(motion);
        const MassProperties moved = massProperties(transformed(mesh, motion));
        REQUIRE(moved.volume == Approx(still.volume).epsilon(1e-5));
        requireNear(moved.centre, glm::vec3(motion * glm::vec4(still.centre, 1)), 2e-6);
        requireNear(moved.inertia, turn * still.inertia * glm::transpose(turn), 2e-5 * still.principalInertia.z);
        requireNear(moved.principalInertia, still.principalInertia, 2e-5 * still.principalInertia.z);
        requireDiagonalises(moved);
    }
    // powers of two: the mesh itself is moved without rounding
    const MassProperties box =
        massProperties(transformed(shapes::box({0.5f, 1, 1.5f}), glm::translate(glm::mat4(1), {8192, -8192, 4096})));
    REQUIRE(box.volume == Approx(6).epsilon(1e-9));
    requireNear(box.centre, {8192, -8192, 4096}, 0);
    requireNear(box.principalInertia, {2.5f, 5, 6.5f}, 1e-5);
}

TEST_CASE("an inside-out mesh has the mass of its reverse") {
    Mesh mesh = shapes::torus(1, 0.3f);
    const MassProperties right = massProperties(mesh);
    for (glm::uvec3& t : mesh.triangles) std::swap(t.y, t.z);
    const MassProperties wrong = massProperties(mesh);
    REQUIRE(wrong.volume == Approx(right.volume));
    requireNear(wrong.centre, right.centre, 1e-6);
    requireNear(wrong.inertia, right.inertia, 1e-6);
}

TEST_CASE("a hollow weighs what its walls weigh") {
    Mesh hole = shapes::box({0.5f, 0.5f, 0.5f});
    for (glm::uvec3& t : hole.triangles) std::swap(t.y, t.z);
    const MassProperties mass = massProperties(shapes::join({shapes::box({1, 1, 1}), hole}));
    REQUIRE(mass.volume == Approx(7));
    REQUIRE(mass.principalInertia.x == Approx(8 * 4 / 6. - 1 * 1 / 6.));
}

TEST_CASE("sizes from microns to kilometres keep their digits") {
    for (const float scale : {1e-6f, 1e-3f, 1e3f}) {
        const MassProperties mass = massProperties(shapes::box(scale * glm::vec3(0.5f, 1, 1.5f)));
        REQUIRE(mass.volume == Approx(6 * std::pow(double(scale), 3)).epsilon(1e-6));
        requireDiagonalises(mass);
    }
}

TEST_CASE("what encloses nothing has no mass") {
    REQUIRE_THROWS_AS(massProperties(Mesh{}), std::invalid_argument);
    const Mesh sheet{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
    REQUIRE_THROWS_AS(massProperties(sheet), std::invalid_argument);
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 20; ++i)
        REQUIRE_THROWS_AS(massProperties(transformed(sheet, randomMotion(random))), std::invalid_argument);
}
