// SPDX-License-Identifier: Apache-2.0
// Why there are two kinds of hierarchies: the nearest triangle of a mesh, found by boxes of eight at a time and by a
// binary tree of boxes, with the same leaves of eight triangles.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <random>

#include "bench/builders.h"
#include "bench/measure.h"
#include "bench/program.h"
#include "collider/field/triangles/mesh_tree.h"
#include "sdf/bvh/median_tree.h"
#include "sdf/sign/closest_side.h"

using namespace bilayer;
using namespace bilayer::bench;
using namespace bilayer::detail;

namespace {

constexpr std::size_t leafTriangles = 8;

struct Options {
    std::vector<std::string> meshes{"bunny", "dragon"};
    std::size_t points = 20000;
    int rounds = 5;
    float resolution = 128;
    unsigned seed = 1;
};

/// A binary tree over the triangles of a mesh, each node with its box.
class BinaryTree {
  public:
    explicit BinaryTree(const Mesh& mesh) : mesh_(mesh) {
        for (const glm::uvec3& t : mesh.triangles)
            items_.push_back({(mesh.points[t.x] + mesh.points[t.y] + mesh.points[t.z]) / 3.f, items_.size()});
        const auto split = [&](std::size_t begin, std::size_t middle, std::size_t end) {
            splitAtMedian(std::span(items_).subspan(begin, end - begin), middle - begin, nullptr);
        };
        const auto boxOf = [&](std::uint32_t node) {
            Bounds box;
            for (std::uint32_t i = tree_[node].begin; i < tree_[node].end; ++i)
                for (const glm::vec3& corner : cornersOf(i)) box.add(corner);
            return box;
        };
        tree_.build(items_.size(), leafTriangles, split, boxOf);
    }

    /// The squared distance of the nearest triangle, if it is below `limit2`.
    double nearest2(const glm::dvec3& point, double limit2, std::uint32_t node = 0) const {
        if (tree_.isLeaf(node)) {
            for (std::uint32_t i = tree_[node].begin; i < tree_[node].end; ++i) {
                const auto [a, b, c] = cornersOf(i);
                const double distance = distanceTo({glm::dvec3(a), glm::dvec3(b), glm::dvec3(c)}, point);
                limit2 = std::min(limit2, distance * distance);
            }
            return limit2;
        }
        std::array children{tree_.first(node), tree_.second(node)};
        std::array away2{boxAway2(children[0], point), boxAway2(children[1], point)};
        if (away2[1] < away2[0]) {
            std::swap(children[0], children[1]);
            std::swap(away2[0], away2[1]);
        }
        for (std::size_t i = 0; i < 2; ++i)
            if (away2[i] < limit2) limit2 = nearest2(point, limit2, children[i]);
        return limit2;
    }

  private:
    struct Item {
        glm::vec3 at;
        std::size_t index;
    };

    std::array<glm::vec3, 3> cornersOf(std::uint32_t item) const {
        const glm::uvec3 t = mesh_.triangles[items_[item].index];
        return {mesh_.points[t.x], mesh_.points[t.y], mesh_.points[t.z]};
    }

    double boxAway2(std::uint32_t node, const glm::dvec3& point) const {
        const Bounds& box = tree_[node];
        const glm::dvec3 away = point - glm::clamp(point, glm::dvec3(box.lower), glm::dvec3(box.upper));
        return glm::dot(away, away);
    }

    const Mesh& mesh_;
    std::vector<Item> items_;
    MedianTree<Bounds> tree_;
};

std::vector<glm::dvec3> pointsAround(const Mesh& mesh, const Options& options) {
    const Bounds box = bounds(mesh);
    const glm::vec3 margin(0.1f * box.longestSide());
    std::mt19937 random(options.seed);
    std::vector<glm::dvec3> points(options.points);
    for (glm::dvec3& point : points)
        for (int k = 0; k < 3; ++k)
            point[k] =
                std::uniform_real_distribution<double>(box.lower[k] - margin[k], box.upper[k] + margin[k])(random);
    return points;
}

template <class Distance>
double secondsOf(const std::vector<glm::dvec3>& points, std::vector<double>& distances, const Distance& distance) {
    const Stopwatch watch;
    for (std::size_t i = 0; i < points.size(); ++i) distances[i] = distance(points[i]);
    return watch.seconds();
}

void compare(const std::string& name, const Options& options) {
    const Scene scene = bench::scene(findSource(name), options.resolution);
    const MeshTree wide(scene.mesh, scene.voxelSize);
    const BinaryTree binary(scene.mesh);
    const auto points = pointsAround(scene.mesh, options);
    constexpr double infinity = std::numeric_limits<double>::infinity();
    std::vector<double> byWide(points.size()), byBinary(points.size()), wideSeconds, binarySeconds;
    for (int round = 0; round < options.rounds; ++round) {
        wideSeconds.push_back(secondsOf(points, byWide, [&](const glm::dvec3& point) {
            return glm::length(wide.featureOf(wide.nearest(point, float(infinity)), point).offset);
        }));
        binarySeconds.push_back(secondsOf(
            points, byBinary, [&](const glm::dvec3& point) { return std::sqrt(binary.nearest2(point, infinity)); }));
    }
    double worst = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
        worst = std::max(worst, std::abs(byWide[i] - byBinary[i]) / double(scene.voxelSize));
    const double perPoint = 1e9 / double(points.size());
    fmt::print("{:<12}{:>10}{:>14.0f}{:>14.0f}{:>8.1f}{:>22.1e}\n", name, scene.mesh.triangles.size(),
               perPoint * median(wideSeconds), perPoint * median(binarySeconds),
               median(binarySeconds) / median(wideSeconds), worst);
}

int run(int argc, char** argv) {
    CLI::App app("Finds the nearest triangle by boxes of eight at a time and by a binary tree: nanoseconds a point.");
    Options options;
    app.add_option("--mesh", options.meshes, "names or files")->capture_default_str();
    app.add_option("--points", options.points, "random points in and around the box of the mesh")
        ->capture_default_str()
        ->check(CLI::PositiveNumber);
    app.add_option("--rounds", options.rounds, "the median counts")->capture_default_str()->check(CLI::PositiveNumber);
    app.add_option("--seed", options.seed)->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    fmt::print("{:<12}{:>10}{:>14}{:>14}{:>8}{:>22}\n", "mesh", "triangles", "eight, ns", "binary, ns", "ratio",
               "difference [voxels]");
    for (const std::string& mesh : options.meshes) compare(mesh, options);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("trees", run, argc, argv);
}
