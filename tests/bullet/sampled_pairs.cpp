// SPDX-License-Identifier: Apache-2.0
// Contacts with points sampled by a sampler are bitwise the same as without.
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <numeric>
#include <stdexcept>

#include <bilayer/cl/field.h>
#include <bilayer/collider/contact.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/search/sampled_contacts.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "tests/bullet/world.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::sampled_pairs_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;

namespace {

std::shared_ptr<const Collider> colliderOf(const Mesh& mesh, float voxels,
                                           ContactAccuracy accuracy = ContactAccuracy::exactNearFeatures) {
    const float voxel = voxelSizeFor(mesh, voxels);
    return std::make_shared<Collider>(mesh, build(mesh, {.voxelSize = voxel, .interiorWidthVoxels = 5}),
                                      ColliderOptions{.accuracy = accuracy});
}

std::vector<std::shared_ptr<const Collider>> someColliders() {
    return {colliderOf(shapes::torusKnot(2, 3, 0.1f, 0.03f, 90, 12), 48),
            colliderOf(shapes::torus(0.12f, 0.04f), 40, ContactAccuracy::samples),
            colliderOf(shapes::box({0.1f, 0.06f, 0.03f}), 24, ContactAccuracy::exact),
            colliderOf(shapes::cone(0.08f, 0.15f, 16), 30), colliderOf(shapes::sphere(0.08f, 3), 20)};
}

Pose somePose(Random& random, double size) {
    const glm::vec3 v = random.point(1);
    return {random.point(size), glm::normalize(glm::quat(float(random(-1, 1)), v.x, v.y, v.z))};
}

bool sameBits(const Contact& a, const Contact& b) {
    return a.position == b.position && a.normal == b.normal && a.distance == b.distance && a.feature == b.feature &&
           a.approach == b.approach;
}

// All pairs of some bodies at random poses, some of them grown.
struct Crowd {
    std::vector<std::shared_ptr<const Collider>> colliders = someColliders();
    std::vector<Placed> bodies;

    explicit Crowd(Random& random, int count = 16) {
        for (int i = 0; i < count; ++i)
            bodies.push_back({*colliders[std::size_t(i) % colliders.size()], somePose(random, 0.12),
                              i % 5 ? 1.f : float(random(0.7, 1.5))});
    }
};

// Compares every pair's contacts by the sampler with those of the CPU. Returns their count.
std::size_t check(const PointSampler& sampler, const Crowd& crowd, float margin, DeviceTimes* times = nullptr) {
    const ContactOptions options{
        .margin = margin, .minNormalCosine = 0.3f, .minNormalCosineApart = 0.9f, .keepsObliqueEdges = false};
    std::vector<SampledBody> bodies;
    std::vector<PointQuery> queries;
    for (const Placed& body : crowd.bodies) bodies.push_back(sampledBody(body.collider));
    for (std::uint32_t i = 0; i < crowd.bodies.size(); ++i)
        for (std::uint32_t j = 0; j < crowd.bodies.size(); ++j) {
            if (i == j) continue;
            queries.push_back(*pointQuery(crowd.bodies[i], crowd.bodies[j], margin));
            queries.back().body = i;
            queries.back().other = j;
        }
    FoundPoints found;
    dataOf(sampler).sample(bodies, queries, found);
    REQUIRE(found.begins.size() == queries.size() + 1);
    if (times) *times = found.times;

    std::size_t total = 0, differing = 0;
    const auto queryOf = [&](std::size_t i, std::size_t j) { return i * (crowd.bodies.size() - 1) + j - (j > i); };
    for (std::size_t i = 0; i < crowd.bodies.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) {
            std::vector<Contact> expected, contacts;
            const Placed &a = crowd.bodies[i], &b = crowd.bodies[j];
            const ContactReport report = collide(a, b, options, expected);
            const ContactReport sampled =
                collideFound(a, b, options, found.of(queryOf(i, j)), found.of(queryOf(j, i)), contacts);
            CHECK(sampled.beyondBand == report.beyondBand);
            REQUIRE(contacts.size() == expected.size());
            for (std::size_t k = 0; k < contacts.size(); ++k) differing += !sameBits(contacts[k], expected[k]);
            total += contacts.size();
        }
    CHECK(differing == 0);
    return total;
}

struct Played {
    std::vector<float> poses;    // of all bodies, after every step
    std::vector<int> sampled{};  // count of pairs, in every step
    int pairs = 0;
    int stepsOnDevice = 0;  // that report times of kernels
};

// A pile that falls and comes nearly to rest.
Played play(PointSampler sampler, unsigned seed) {
    Random random(seed);
    const auto colliders = someColliders();
    std::vector<std::unique_ptr<bullet::Shape>> shapes;
    for (const auto& collider : colliders)
        shapes.push_back(std::make_unique<bullet::Shape>(
            collider, bullet::ShapeOptions{.frame = bullet::centreOfMassFrame(*collider)}));
    bullet::Shape floor(colliderOf(shapes::box({0.4f, 0.4f, 0.05f}), 64));
    World world(std::move(sampler));
    world.add(floor, 0, {0, 0, -0.05f});
    std::vector<const btRigidBody*> bodies;
    for (int i = 0; i < 8; ++i) {
        const glm::vec3 place = random.point(0.1), axis = random.point(1);
        bodies.push_back(world.add(*shapes[std::size_t(i) % shapes.size()], 1,
                                   {place.x, place.y, 0.15f + 0.1f * float(i)},
                                   btQuaternion({axis.x, axis.y, axis.z + 2}, float(random(0, 3)))));
    }
    Played played;
    for (int step = 0; step < 120; ++step) {
        world.run(1 / 240.f);
        played.sampled.push_back(world.dispatcher.statistics().sampled);
        played.pairs += world.dispatcher.statistics().pairs;
        played.stepsOnDevice += world.dispatcher.statistics().device.kernels > 0;
        for (const btRigidBody* body : bodies) {
            btScalar matrix[16];
            body->getWorldTransform().getOpenGLMatrix(matrix);
            played.poses.insert(played.poses.end(), matrix, matrix + 16);
        }
    }
    return played;
}

}  // namespace

TEST_CASE("contacts of points sampled on a device are those of the processor, bit by bit") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const OpenclOptions options{.mapping = GENERATE(KernelMapping::blockPerItem, KernelMapping::groupPerBlock)};
    const PointSampler sampler = openclPointSampler(openDevice(), options);
    for (int i = 0; i < 3; ++i) CHECK(check(sampler, Crowd(random), float(random(0, 0.004))) > 1000);
}

TEST_CASE("bodies that do not fit on the device together take turns") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Device device = openDevice();
    const auto touchingCrowd = [&] {
        for (;;)
            if (Crowd crowd(random, 4); check(openclPointSampler(device), crowd, 0.002f) > 20) return crowd;
    };
    const Crowd first = touchingCrowd(), second = touchingCrowd();
    DeviceTimes times;
    check(openclPointSampler(device, {.profile = true}), first, 0.002f, &times);
    CHECK(times.kernels > 0);
    CHECK(times.peakBytes > 1 << 20);
    const std::uint64_t mebibytes = times.peakBytes / (1 << 20) + 2;
    const PointSampler small = openclPointSampler(device, {.memoryMiB = mebibytes});
    for (const Crowd* crowd : {&first, &second, &first}) CHECK(check(small, *crowd, 0.002f) > 20);
    CHECK_THROWS_AS(check(openclPointSampler(device, {.memoryMiB = 1}), first, 0.002f), DeviceError);
}

TEST_CASE("a pile sampled on a device moves as one on the processor, on any count of threads, bit by bit") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const Played expected = play({}, seed);
    CHECK(std::count(expected.sampled.begin(), expected.sampled.end(), 0) == std::ptrdiff_t(expected.sampled.size()));
    for (const int threads : {1, 2, 8}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
        tbb::task_arena arena(threads);
        arena.execute([&] {
            const Played played = play(openclPointSampler(openDevice(), {.profile = true}), seed);
            CHECK(played.poses == expected.poses);
            CHECK(played.stepsOnDevice ==
                  std::count_if(played.sampled.begin(), played.sampled.end(), [](int pairs) { return pairs > 0; }));
            CHECK(played.pairs == expected.pairs);
            CHECK(std::accumulate(played.sampled.begin(), played.sampled.end(), 0) > played.pairs / 4);
        });
    }
}

TEST_CASE("the processor takes over if the sampler fails half-way, with the same result") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const auto works = openclPointSampler(openDevice());
    int left = 5;
    const auto breaks = makeOf<PointSampler>(
        DeviceSampler{"opencl", "a device", [&](const auto& bodies, const auto& queries, FoundPoints& found) {
                          if (left-- == 0) throw std::runtime_error("the device is gone (as this test has it)");
                          dataOf(works).sample(bodies, queries, found);
                      }});
    const Played expected = play({}, seed), played = play(breaks, seed);
    CHECK(left == -1);
    CHECK(std::count_if(played.sampled.begin(), played.sampled.end(), [](int pairs) { return pairs > 0; }) == 5);
    CHECK(played.poses == expected.poses);
}
}  // namespace bilayer::sampled_pairs_test
