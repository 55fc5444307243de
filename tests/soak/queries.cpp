// SPDX-License-Identifier: Apache-2.0
// Eight threads query fields that are created and dropped all the time.
#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <thread>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/collider/distance.h>
#include <bilayer/collider/field.h>
#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "tests/soak/soak.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::queries_test {
using namespace bilayer::test;

namespace {

constexpr unsigned threads = 8;
constexpr int queries = 60;  // of a thread in a round

/// A body around which many threads gather. The last thread that lets it go drops it.
std::shared_ptr<const Collider> anyCollider(Random& random) {
    const Mesh mesh = random(0, 1) < 0.5 ? shapes::sphere(float(random(0.4, 0.6)), 2)
                                         : shapes::box({0.5f, float(random(0.2, 0.5)), 0.4f});
    return std::make_shared<const Collider>(mesh, build(mesh, {.voxelSize = 0.1f}));
}

/// Returns the count of wrong answers.
int query(const Collider& collider, unsigned seed) {
    Random random(seed);
    int wrong = 0;
    std::vector<Contact> contacts;
    for (int i = 0; i < queries; ++i) {
        const glm::vec3 point = random.point(1.5);
        // made by whichever thread asks first
        const Field& field = i % 3 ? collider.field() : collider.exactField();
        const ClosestPoint closest = field.closest(point);
        wrong += !closest.found || !std::isfinite(closest.distance);
        wrong += field.inside(point) && closest.distance > 0.2f;
        const auto hit = field.raycast({point * 3.f, -point});
        wrong += hit && !std::isfinite(hit->distance);
        contacts.clear();
        collide(collider, {}, collider, {point, {1, 0, 0, 0}}, {.margin = 0.05f}, contacts);
        const Placed here{collider, {}}, there{collider, {point, {1, 0, 0, 0}}};
        wrong += i % 16 == 0 && !distance(here, there).found;
        wrong += !(collider.mass().volume > 0);
    }
    return wrong;
}

}  // namespace

TEST_CASE("many threads query fields that are made and dropped meanwhile") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    soak(6, [&](unsigned round) {
        std::vector<std::shared_ptr<const Collider>> shared;
        for (int i = 0; i < 3; ++i) shared.push_back(anyCollider(random));
        std::atomic<int> wrong{0};
        std::vector<std::thread> all;
        for (unsigned i = 0; i < threads; ++i)
            all.emplace_back([collider = shared[i % 3], &wrong, i, round] {
                // every fourth thread makes its own, while the others query theirs
                Random own(round * threads + i);
                wrong += query(i % 4 == 3 ? *anyCollider(own) : *collider, round * threads + i);
            });
        shared.clear();
        for (std::thread& thread : all) thread.join();
        REQUIRE(wrong == 0);
    });
}
}  // namespace bilayer::queries_test
