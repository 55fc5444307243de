// SPDX-License-Identifier: Apache-2.0
#include "sdf/base/progress.h"

#include <oneapi/tbb/global_control.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <random>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/inspect.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/bvh/triangle_tree.h"
#include "sdf/bvh/wide_tree.h"
#include "sdf/bvh/winding_number.h"
#include "sdf/mesh/orient.h"
#include "sdf/mesh/self_intersection.h"
#include "sdf/mesh/side_classification.h"
#include "sdf/mesh/topology.h"
#include "sdf/mesh/wall_thickness.h"
#include "sdf/sign/flood.h"
#include "sdf/sign/sign_choice.h"
#include "sdf/sign/winding.h"
#include "tests/sdf/unsigned_band.h"
#include "tests/support/support.h"

namespace bilayer::progress_test {
using namespace bilayer::detail;

namespace {

// Cancels at the n-th call, and at all later ones.
struct Listener {
    unsigned patience;
    unsigned asked = 0;
    std::function<bool(float)> function() {
        return [this](float) { return ++asked < patience; };
    }
};

constexpr unsigned always = ~0u;

template <class Work>
bool isCancelled(Listener& listener, const Work& work) {
    const auto function = listener.function();
    // each poll calls the function, regardless of the time
    Progress progress(function, {});
    try {
        work(&progress);
    } catch (const Cancelled&) {
        return true;
    }
    return false;
}

// Checks that the callback is called at least `least` times, and that cancelling at any call stops the work.
template <class Work>
void checkCancelling(const std::string& what, unsigned minPolls, const Work& work) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    const unsigned seed = test::seed();
    CAPTURE(what, seed);
    std::mt19937 random(seed);
    Listener content{always};
    CHECK_FALSE(isCancelled(content, work));
    CHECK(content.asked >= minPolls);
    for (int i = 0; i < 12; ++i) {
        Listener listener{i == 0 ? 1 : 1 + unsigned(random() % content.asked)};
        CAPTURE(content.asked, listener.patience);
        const bool cancelled = isCancelled(listener, work);
        // sorts poll by their count of comparisons over calls, so the last poll may be missing
        CHECK(cancelled == (listener.asked >= listener.patience));
        CHECK(listener.asked <= listener.patience);
        CHECK((cancelled || listener.patience + 8 > content.asked));
    }
}

Mesh knot() {
    return shapes::torusKnot(2, 3, 1, 0.2f, 300, 16);
}

Mesh openKnot() {
    Mesh mesh = knot();
    mesh.triangles.resize(mesh.triangles.size() - 40);
    return mesh;
}

// Random separate triangles: winding numbers fail for them.
Mesh soup(unsigned triangles) {
    std::mt19937 random(1);
    std::uniform_real_distribution<float> uniform(-1, 1);
    const auto point = [&] { return glm::vec3(uniform(random), uniform(random), uniform(random)); };
    Mesh mesh;
    for (unsigned i = 0; i < triangles; ++i) {
        const glm::vec3 centre = point();
        for (int k = 0; k < 3; ++k) mesh.points.push_back(centre + 0.1f * point());
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return mesh;
}

}  // namespace

TEST_CASE("a listener is asked no more often than the interval, and never again after a no") {
    int asked = 0;
    const std::function<bool(float)> listener = [&](float) { return ++asked < 2; };
    Progress patient(listener, std::chrono::hours(1));
    for (int i = 0; i < 100; ++i) patient.poll();
    CHECK(asked == 1);
    asked = 0;
    Progress eager(listener, {});
    eager.poll();
    for (int i = 0; i < 100; ++i) CHECK_THROWS_AS(eager.poll(), Cancelled);
    CHECK(asked == 2);
    poll(nullptr);
}

TEST_CASE("polled loops, vectors and sorts do what others do") {
    std::vector<std::size_t> numbers;
    for (const std::size_t i : Polled(5000, nullptr)) numbers.push_back(i);
    REQUIRE(numbers.size() == 5000);
    for (std::size_t i = 0; i < numbers.size(); ++i) CHECK(numbers[i] == i);
    for (const std::size_t i : Polled(0, nullptr)) FAIL(i);
    CHECK(vectorOf<int>(0, nullptr).empty());
    CHECK(vectorOf<double>(3'000'000, nullptr) == std::vector<double>(3'000'000));
    std::sort(numbers.begin(), numbers.end(), polled(std::greater<>(), nullptr));
    CHECK(std::is_sorted(numbers.rbegin(), numbers.rend()));
}

TEST_CASE("everything that the choice of signs goes through can be cancelled") {
    const Mesh closed = knot(), open = openKnot(), loose = soup(4000);
    checkCancelling("balanced", 2, [&](Progress* p) { balanced(closed, p); });
    checkCancelling("topology", 20, [&](Progress* p) { Topology(closed, p).forEachEdge([](auto) {}); });
    checkCancelling("tree", 5, [&](Progress* p) { TriangleTree(closed, p); });
    checkCancelling("sides", 100, [&](Progress* p) { bounding(open, p); });
    for (const Mesh* mesh : {&closed, &open, &loose}) {
        checkCancelling("orient", 50, [&](Progress* p) { orient(*mesh, p); });
        checkCancelling("after a conflict", 100, [&](Progress* p) { chooseSignAfterConflict(*mesh, p); });
        checkCancelling("choice", mesh == &closed ? 2 : 100, [&](Progress* p) { chooseSign(*mesh, p); });
    }
}

TEST_CASE("an inspection can be cancelled in each of its searches") {
    const Mesh closed = knot(), loose = soup(4000);
    for (const Mesh* mesh : {&closed, &loose}) {
        const Topology topology = Topology::ofWelded(*mesh);
        const TriangleTree tree(*mesh);
        checkCancelling("intersections", 5, [&](Progress* p) { countIntersectingPairs(*mesh, topology, tree, p); });
        checkCancelling("walls", 5, [&](Progress* p) { wallThickness(tree, {}, p); });
        std::vector<float> told;
        inspect(*mesh, 0, [&](float fraction) { return told.push_back(fraction), true; });
        CHECK(std::is_sorted(told.begin(), told.end()));
        CHECK(told.back() == 1);
        CHECK_THROWS_AS(inspect(*mesh, 0, [](float) { return false; }), Cancelled);
    }
}

TEST_CASE("hierarchies, winding numbers and floods can be cancelled") {
    const float h = 0.05f;
    const BandWidths widths{3, 3, h};
    const Mesh closed = knot(), open = openKnot(), loose = soup(200);
    checkCancelling("boxes", 10, [&](Progress* p) { makeWideTree(closed, h, p); });
    checkCancelling("hierarchy", 20, [&](Progress* p) { WindingNumber(closed, p); });
    for (const Mesh* mesh : {&closed, &open, &loose}) {
        const auto band = test::unsignedBand(*mesh, h, 3);
        for (const bool everywhereOpen : {false, true})
            checkCancelling("winding", 50, [&](Progress* p) {
                const auto grid = band->deepCopy();
                signByWinding(*grid, *mesh, widths, !everywhereOpen, p);
            });
        checkCancelling("flood", 50, [&](Progress* p) {
            const auto grid = band->deepCopy();
            signByFlood(*grid, *mesh, 2, widths, p);
        });
    }
}

TEST_CASE("a build of any mesh can be cancelled wherever it asks") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    const Mesh loose = soup(3000);
    const struct {
        const char* sign;
        Mesh mesh;
    } cases[] = {{"normals", knot()}, {"winding", openKnot()}, {"flood", loose}};
    for (const auto& [sign, mesh] : cases) {
        BuildOptions options{.voxelSize = voxelSizeFor(mesh, 100)};
        Listener content{always};
        options.progress = content.function();
        CHECK(build(mesh, options).sign() == sign);
        CHECK(content.asked > 1);
        for (int i = 0; i < 8; ++i) {
            Listener listener{1 + unsigned(random() % content.asked)};
            options.progress = listener.function();
            bool cancelled = false;
            try {
                build(mesh, options);
            } catch (const Cancelled&) {
                cancelled = true;
            }
            // the callback is called by time, so a quick run may end before that
            CAPTURE(sign, content.asked, listener.patience);
            CHECK(cancelled == (listener.asked >= listener.patience));
        }
    }
}
}  // namespace bilayer::progress_test
