// SPDX-License-Identifier: Apache-2.0
// Finds cells whose samples are off from the mesh, compared with brute-force distances.
#include "collider/contact/body/interpolation_error.h"
#include "collider/contact/body/collider_data.h"
#include "collider/field/samples/field_data.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "tests/support/random.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

namespace bilayer::interpolation_error_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

constexpr float voxel = 0.01f;
const Mesh solids[] = {shapes::box({0.1f, 0.07f, 0.05f}), shapes::torusKnot(2, 3, 0.1f, 0.03f, 200, 16),
                       shapes::cone(0.1f, 0.15f, 24), shapes::bowl(0.12f, 0.03f, 32)};

Field fieldOf(const Mesh& mesh) {
    return Field(build(mesh, {.voxelSize = voxel}), mesh);
}

// Points within a voxel of the surface, by the samples.
std::vector<glm::vec3> placesNear(const Mesh& mesh, const Field& field, Random& random, int count) {
    std::vector<glm::vec3> places;
    while (count > 0) {
        const glm::uvec3 t = mesh.triangles[std::size_t(random(0, double(mesh.triangles.size()) - 1e-6))];
        const float u = float(random(0, 1)), v = float(random(0, 1)) * (1 - u);
        const glm::vec3 place =
            mesh.points[t.x] + u * (mesh.points[t.y] - mesh.points[t.x]) + v * (mesh.points[t.z] - mesh.points[t.x]);
        places.push_back(place + random.point(voxel));
        if (std::abs(field.distance(places.back())) > voxel)
            places.pop_back();
        else
            --count;
    }
    return places;
}

}  // namespace

TEST_CASE(
    "samples outside of the interpolation-error mask are off by little more than a tenth of a voxel; some within are") {
    const unsigned start = seed();
    CAPTURE(start);
    Random random(start);
    for (const Mesh& mesh : solids) {
        const Field field = fieldOf(mesh);
        const InterpolationErrorMask errorMask(field);
        const Truth truth(mesh);
        const FieldLayout& layout = dataOf(field);
        const auto offAt = [&](const glm::vec3& place) {
            return std::abs(double(field.distance(place)) - truth.signedDistance(glm::dvec3(place))) / voxel;
        };
        std::size_t held = 0, left = 0;
        for (const glm::vec3& place : placesNear(mesh, field, random, 2000)) {
            CAPTURE(place.x, place.y, place.z);
            if (!errorMask.isMarked(place)) {
                REQUIRE(offAt(place) < 0.2);
                ++left;
                continue;
            }
            ++held;
            const glm::dvec3 cell = glm::floor((glm::dvec3(place) - layout.origin) * layout.perMetre);
            double most = 0;
            for (int i = 0; i < 27; ++i) {
                const glm::dvec3 inCell = (glm::dvec3(i / 9, i / 3 % 3, i % 3) + 0.5) / 3.0;
                most = std::max(most, offAt(glm::vec3((cell + inCell) * layout.voxel + layout.origin)));
            }
            REQUIRE(most > 0.099);
        }
        CHECK(held > 20);
        CHECK(left > 100);
    }
}

TEST_CASE("the interpolation-error mask does not depend on who asks first, nor on how many ask at once") {
    const unsigned start = seed();
    CAPTURE(start);
    Random random(start);
    const Mesh& mesh = solids[2];
    const Field field = fieldOf(mesh);
    std::vector<glm::vec3> places = placesNear(mesh, field, random, 3000);
    const auto answersOf = [&](const InterpolationErrorMask& errorMask) {
        std::vector<char> answers(places.size());
        tbb::parallel_for(std::size_t(0), places.size(),
                          [&](std::size_t i) { answers[i] = errorMask.isMarked(places[i]); });
        return answers;
    };
    const InterpolationErrorMask first(field), second(field);
    const std::vector<char> answers = answersOf(first);
    for (std::size_t i = places.size(); i-- > 0;) REQUIRE(second.isMarked(places[i]) == bool(answers[i]));
    REQUIRE(answersOf(first) == answers);
    const InterpolationErrorMask copy = first;
    REQUIRE(answersOf(copy) == answers);
    CHECK(std::count(answers.begin(), answers.end(), 1) > 20);
}

TEST_CASE("edges are in the interpolation-error mask, faces and gentle bends are not; without a field nothing is") {
    const Field box = fieldOf(solids[0]);
    const InterpolationErrorMask ofBox(box);
    CHECK(ofBox.isMarked({0.0999f, 0.0699f, 0}));
    CHECK_FALSE(ofBox.isMarked({0.1f, 0, 0}));
    CHECK_FALSE(ofBox.isMarked({0, 0, 0.05f}));
    CHECK_FALSE(ofBox.isMarked({0, 0, 0}));
    const float huge = 1e30f, none = std::numeric_limits<float>::quiet_NaN();
    for (const glm::vec3& place : {glm::vec3(100, 0, 0), glm::vec3(-huge, 0, 0), glm::vec3(0, huge, none)})
        CHECK_FALSE(ofBox.isMarked(place));
    CHECK_FALSE(InterpolationErrorMask().isMarked({0.0999f, 0.0699f, 0}));

    const Mesh ring = shapes::torus(0.3f, 0.1f);
    const Collider smooth(ring, build(ring, {.voxelSize = voxel}));
    CHECK_FALSE(dataOf(smooth).isExactAt({0.4f, 0, 0}));
    CHECK(dataOf(smooth).isExactAt({0.4f, 0, 0}, true));
}
}  // namespace bilayer::interpolation_error_test
