// SPDX-License-Identifier: Apache-2.0
// The distance of two bodies compared with FCL's, at several separations, for unrelated poses and along a motion.
#include <bilayer/collider/distance.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>
#include <string>
#include <vector>

#include "bench/fcl.h"
#include "bench/measure.h"
#include "bench/program.h"
#include "bench/ratios.h"
#include "demos/shared/shapes.h"

using namespace bilayer;
using namespace bilayer::bench;

namespace {

struct Options {
    std::vector<std::string> meshes;
    std::vector<float> separations{0.01f, 0.1f, 1};
    int poses = 50, steps = 50, rounds = 3;
    unsigned seed = 1;
};

struct Body {
    std::string name;
    Mesh mesh;
    Collider collider;
    FclMesh fcl;
};

Body bodyOf(const std::string& name, Mesh mesh) {
    // all bodies get the same size
    const glm::vec3 centre = bounds(mesh).centre();
    const float scale = 1 / bounds(mesh).longestSide();
    for (glm::vec3& point : mesh.points) point = scale * (point - centre);
    const LevelSet levelSet = build(mesh, {.voxelSize = voxelSizeFor(mesh, 64)});
    Collider collider(mesh, levelSet);
    FclMesh fcl(collider.mesh());
    return {name, std::move(mesh), std::move(collider), std::move(fcl)};
}

std::vector<Body> bodies(const Options& options) {
    std::vector<Body> all;
    for (const std::string& path : options.meshes) all.push_back(bodyOf(path, readMesh(path)));
    if (!all.empty()) return all;
    all.push_back(bodyOf("torus", shapes::torus(0.5f, 0.15f, 72, 36)));
    all.push_back(bodyOf("carved box", shapes::carvedBox(20000)));
    all.push_back(bodyOf("trefoil knot", shapes::torusKnot(2, 3, 0.5f, 0.1f, 1100, 32)));
    return all;
}

using Poses = std::vector<std::pair<Pose, Pose>>;

class Poser {
  public:
    explicit Poser(unsigned seed) : engine_(seed) {}

    glm::vec3 vector() { return {normal_(engine_), normal_(engine_), normal_(engine_)}; }
    glm::quat rotation() { return glm::normalize(glm::quat(normal_(engine_), vector())); }

    /// Poses of two bodies that are a separation apart.
    std::pair<Pose, Pose> apart(const Body& a, const Body& b, float separation) {
        Pose first{glm::vec3(0), rotation()}, second{3.f * glm::normalize(vector()), rotation()};
        // moves along the normal of the closest points, some times, since the closest points change
        for (int i = 0; i < 8; ++i) {
            const BodyDistance here = distance({a.collider, first}, {b.collider, second});
            second.position -= (separation - here.distance) * here.normal;
        }
        return {first, second};
    }

  private:
    std::mt19937 engine_;
    std::normal_distribution<float> normal_;
};

// Poses along a motion: a thousandth of the size and of a radian a step, as a body of 0.5 m at 0.5 m/s makes in 1 ms.
Poses motion(std::pair<Pose, Pose> from, int steps, Poser& poser) {
    const glm::vec3 direction = 1e-3f * glm::normalize(poser.vector()), axis = glm::normalize(poser.vector());
    Poses poses;
    for (int i = 0; i < steps; ++i) {
        poses.push_back(from);
        from.second.position += direction;
        from.second.rotation = glm::normalize(glm::angleAxis(1e-3f, axis) * from.second.rotation);
    }
    return poses;
}

// Microseconds per answer.
template <class Ask>
double timeOf(const Poses& poses, std::vector<double>& answers, Ask&& ask) {
    answers.clear();
    const Stopwatch watch;
    for (const auto& [a, b] : poses) answers.push_back(ask(a, b));
    return 1e6 * watch.seconds() / double(poses.size());
}

struct Row {
    std::vector<double> ours, fcl;  // of each round
    double off = 0;                 // the largest difference of the answers
};

Row race(const Body& a, const Body& b, const Poses& poses, bool keepsStart, int rounds) {
    Row row;
    std::vector<double> oursAnswers, fclAnswers;
    for (int round = 0; round < rounds; ++round) {
        DistanceStart start;
        row.ours.push_back(timeOf(poses, oursAnswers, [&](const Pose& p, const Pose& q) {
            return double(distance({a.collider, p}, {b.collider, q}, {}, keepsStart ? &start : nullptr).distance);
        }));
        row.fcl.push_back(
            timeOf(poses, fclAnswers, [&](const Pose& p, const Pose& q) { return a.fcl.distanceTo(b.fcl, p, q); }));
    }
    for (std::size_t i = 0; i < poses.size(); ++i)
        if (oursAnswers[i] > 0) row.off = std::max(row.off, std::abs(oursAnswers[i] - fclAnswers[i]));
    return row;
}

int run(int argc, char** argv) {
    CLI::App app("The distance of two bodies compared with FCL's between the same meshes, on one thread.");
    Options options;
    app.add_option("meshes", options.meshes, "files; default: a torus, a carved box, a trefoil knot");
    app.add_option("--separations", options.separations, "relative to the bodies' size")->capture_default_str();
    app.add_option("--poses", options.poses, "unrelated poses per pair")->capture_default_str();
    app.add_option("--steps", options.steps, "of the motion")->capture_default_str();
    app.add_option("--rounds", options.rounds, "the median counts")->capture_default_str();
    app.add_option("--seed", options.seed)->capture_default_str();
    Ratios ratios("distance");
    ratios.addOption(app);
    CLI11_PARSE(app, argc, argv);
    const std::vector<Body> all = bodies(options);
    fmt::print(
        "Microseconds per distance; `off` is the largest difference of the answers [sizes]\n\n"
        "| bodies | triangles | separation | bilayer | FCL | ratio | in motion | FCL | ratio | off |\n"
        "|---|---|---|---|---|---|---|---|---|---|\n");
    std::vector<double> unrelated, moving;
    Poser poser(options.seed);
    for (std::size_t i = 0; i < all.size(); ++i)
        for (std::size_t k = i; k < all.size(); ++k)
            for (const float separation : options.separations) {
                Poses poses;
                for (int n = 0; n < options.poses; ++n) poses.push_back(poser.apart(all[i], all[k], separation));
                const Row cold = race(all[i], all[k], poses, false, options.rounds);
                const Row warm =
                    race(all[i], all[k], motion(poses.front(), options.steps, poser), true, options.rounds);
                const double coldOurs = median(cold.ours), coldFcl = median(cold.fcl), warmOurs = median(warm.ours),
                             warmFcl = median(warm.fcl);
                unrelated.push_back(coldFcl / coldOurs);
                moving.push_back(warmFcl / warmOurs);
                const std::string what =
                    fmt::format("{} and {}, {:g} % apart", all[i].name, all[k].name, 100 * separation);
                ratios.add(what + " / FCL", cold.fcl, cold.ours);
                ratios.add(what + ", in motion / FCL", warm.fcl, warm.ours);
                fmt::print(
                    "| {}, {} | {}, {} | {:g} % | {:.1f} | {:.1f} | {:.1f} | {:.1f} | {:.1f} | {:.1f} | {:.1g} |\n",
                    all[i].name, all[k].name, all[i].mesh.triangles.size(), all[k].mesh.triangles.size(),
                    100 * separation, coldOurs, coldFcl, unrelated.back(), warmOurs, warmFcl, moving.back(),
                    std::max(cold.off, warm.off));
                std::fflush(stdout);
            }
    fmt::print("\nGeometric mean of the ratios: {:.1f} for unrelated poses, {:.1f} in motion\n",
               geometricMean(unrelated), geometricMean(moving));
    ratios.write();
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return program("distance", run, argc, argv);
}
