// SPDX-License-Identifier: Apache-2.0
#include "sdf/bvh/wide_tree.h"

#include <oneapi/tbb/global_control.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <random>
#include <set>

#include "demos/shared/shapes.h"
#include "sdf/base/perpendicular.h"
#include "sdf/bvh/node_list.h"
#include "tests/support/support.h"

namespace bilayer::wide_tree_test {
using namespace bilayer::detail;

namespace {

struct Box {
    glm::vec3 lower, upper;
};

Box boxOf(const BoxGroup& group, int i) {
    return {{group.lower[0][i], group.lower[1][i], group.lower[2][i]},
            {group.upper[0][i], group.upper[1][i], group.upper[2][i]}};
}

bool holds(const Box& box, const glm::dvec3& p, double room) {
    for (int k = 0; k < 3; ++k)
        if (p[k] < double(box.lower[k]) - room || p[k] > double(box.upper[k]) + room) return false;
    return true;
}

// Counts contents outside their box, from a node downward, and records the visited triangles.
std::size_t outside(const WideTree& tree, std::uint32_t node, const Box& box, std::set<std::uint32_t>& met) {
    std::size_t count = 0;
    if (tree.isLeaf(node)) {
        const WideLeaf& leaf = tree.leaves[node];
        for (int i = 0; i < treeWidth; ++i) {
            met.insert(leaf.triangles[i]);
            const glm::dvec3 a = glm::dvec3(leaf.cell[0][i], leaf.cell[1][i], leaf.cell[2][i]) +
                                 glm::dvec3(leaf.corner[0][i], leaf.corner[1][i], leaf.corner[2][i]);
            const glm::dvec3 along(leaf.along[0][i], leaf.along[1][i], leaf.along[2][i]);
            // rounding: of a fraction of a voxel, and of eight voxels
            count += !holds(box, a, 1e-7) + !holds(box, a + double(leaf.lengthAB[i]) * along, 2e-6);
        }
        return count;
    }
    for (int i = 0; i < treeWidth; ++i) {
        const Box child = boxOf(tree.group(node), i);
        if (child.lower.x > child.upper.x) continue;
        count += !holds(box, child.lower, 0) + !holds(box, child.upper, 0);
        count += outside(tree, tree.group(node).firstChild + std::uint32_t(i), child, met);
    }
    return count;
}

Mesh mixed() {
    return shapes::join({shapes::sphere(3, 3), shapes::box({200, 30, 0.01f}), shapes::torus(20, 4, 40, 20),
                         transformed(shapes::cone(1, 500, 12), glm::mat4(1))});
}

}  // namespace

TEST_CASE("boxes of the tree hold what is below them, and every triangle is somewhere") {
    for (const Mesh& mesh : {mixed(), shapes::box({1, 1, 1}), shapes::sphere(50, 5)}) {
        const WideTree tree = makeWideTree(mesh, 0.7f);
        std::set<std::uint32_t> met;
        const Box all{glm::vec3(0), glm::vec3(tree.size)};
        CHECK(outside(tree, tree.root(), all, met) == 0);
        CHECK(met.size() == mesh.triangles.size());
        for (int k = 0; k < 3; ++k) CHECK(tree.base[k] % 8 == 0);
    }
}

TEST_CASE("large triangles are divided, and leaves stay as small as blocks") {
    const WideTree tree = makeWideTree(shapes::box({100, 100, 100}), 1.f);
    CHECK(tree.leafCount > 100);
    for (std::uint32_t leaf = 0; leaf < tree.leafCount; ++leaf)
        for (int i = 0; i < treeWidth; ++i) {
            CHECK(tree.leaves[leaf].lengthAB[i] <= 8);
            CHECK(tree.leaves[leaf].lengthAC[i] <= 8);
        }
}

TEST_CASE("the tree does not depend on the number of threads") {
    const Mesh mesh = mixed();
    const WideTree tree = makeWideTree(mesh, 0.3f);
    for (const std::size_t threads : {1, 2, 5}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        const WideTree other = makeWideTree(mesh, 0.3f);
        REQUIRE(other.leafCount == tree.leafCount);
        std::size_t different = 0;
        for (std::uint32_t i = 0; i < tree.leafCount; ++i) {
            const WideLeaf &a = tree.leaves[i], &b = other.leaves[i];
            different += std::memcmp(&a, &b, offsetof(WideLeaf, triangles) + sizeof a.triangles) != 0;
        }
        CHECK(different == 0);
    }
}

TEST_CASE("narrowing keeps all nodes near the voxels and opens large ones") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> place(-5, 60);
    const WideTree tree = makeWideTree(shapes::sphere(25, 4), 1.f);
    for (int round = 0; round < 50; ++round) {
        const glm::vec3 lower = glm::floor(glm::vec3(place(random), place(random), place(random)));
        const VoxelBox voxels{lower, lower + 7.f};
        NodeList leaves;
        collectNodes(tree, wholeTree(tree), voxels, 3, 0, leaves);
        std::set<std::uint32_t> found(leaves.nodes.begin(), leaves.nodes.begin() + std::ptrdiff_t(leaves.count));
        CHECK(found.size() == leaves.count);
        std::size_t wrong = 0;
        for (std::uint32_t g = 0; g < tree.groupCount; ++g)
            for (int i = 0; i < treeWidth; ++i) {
                const std::uint32_t node = tree.groups[g].firstChild + std::uint32_t(i);
                const Box box = boxOf(tree.groups[g], i);
                if (!tree.isLeaf(node) || box.lower.x > box.upper.x) continue;
                glm::dvec3 gap(0);
                for (int k = 0; k < 3; ++k)
                    gap[k] = std::max({0.0, double(box.lower[k]) - double(voxels.upper[k]),
                                       double(voxels.lower[k]) - double(box.upper[k])});
                const double distance = std::sqrt(gap.x * gap.x + gap.y * gap.y + gap.z * gap.z);
                if (distance < 3) wrong += found.count(node) == 0;
                if (distance > 3.001) wrong += found.count(node) != 0;
            }
        CHECK(wrong == 0);
    }
}

TEST_CASE("a perpendicular direction has unit length, in single and double precision") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::normal_distribution<double> any;
    for (int i = 0; i < 1000; ++i) {
        // every third one near an axis
        glm::dvec3 unit(any(random), any(random), any(random));
        if (i % 3 == 0) unit[i % 9 / 3] *= 1e9;
        unit = glm::normalize(unit);
        const glm::dvec3 across = perpendicularTo(unit), single(perpendicularTo(glm::vec3(unit)));
        CHECK(std::abs(glm::dot(across, unit)) < 1e-15);
        CHECK(std::abs(glm::length(across) - 1) < 1e-15);
        CHECK(std::abs(glm::dot(single, unit)) < 1e-6);
        CHECK(std::abs(glm::length(single) - 1) < 1e-6);
    }
}

TEST_CASE("a mesh too long for floats is refused") {
    CHECK_THROWS_AS(makeWideTree(shapes::box({1e4f, 1, 1}), 1e-3f), std::invalid_argument);
}
}  // namespace bilayer::wide_tree_test
