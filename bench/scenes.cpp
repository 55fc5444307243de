// SPDX-License-Identifier: Apache-2.0
// The rigid-body scenes of the demos, in sizes that run for minutes: step times on one thread and on all, and whether
// their criteria are still met.
#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench/measure.h"
#include "bench/program.h"
#include "demos/scenes/bowl.h"
#include "demos/scenes/chain.h"
#include "demos/scenes/gears.h"
#include "demos/scenes/incline.h"
#include "demos/scenes/nuts.h"
#include "demos/scenes/pairs.h"
#include "demos/scenes/pegs.h"
#include "demos/scenes/plates.h"
#include "demos/scenes/rings.h"
#include "demos/scenes/spin.h"
#include "demos/scenes/terrain.h"
#include "demos/shared/outcome.h"

using namespace bilayer;
using namespace bilayer::bench;

namespace {

struct NamedScene {
    std::string name;
    std::function<demo::Outcome()> play;
};

std::vector<NamedScene> scenes() {
    return {{"pairs", [] { return demo::pairs({}); }},
            {"incline", [] { return demo::incline({}); }},
            {"terrain", [] { return demo::terrain({}); }},
            {"nuts", [] { return demo::nuts({.turns = 1}); }},
            {"rings", [] { return demo::rings({.rows = 2}); }},
            {"chain", [] { return demo::chain({.seconds = 3}); }},
            {"gears", [] { return demo::gears({.turns = 1}); }},
            {"bowl", [] { return demo::bowl({.kinds = {demo::bunny()}}); }},
            {"plates", [] { return demo::plates({}); }},
            {"pegs", [] { return demo::pegs({}); }},
            {"spin", [] { return demo::spin({.seconds = 10}); }}};
}

demo::Outcome play(const NamedScene& scene, int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
    return scene.play();
}

// Throws std::runtime_error if another count of threads gives another result.
void compare(const NamedScene& scene, int threads, int repetitions) {
    std::vector<double> one, all, slow;
    std::optional<demo::Outcome> outcome;
    for (int i = 0; i < repetitions; ++i) {
        const demo::Outcome alone = play(scene, 1);
        outcome.emplace(play(scene, threads));
        if (alone.fingerprint != outcome->fingerprint)
            throw std::runtime_error(scene.name + ": other bits on one thread than on several");
        one.push_back(alone.medianStep());
        all.push_back(outcome->medianStep());
        slow.push_back(outcome->slowStep());
    }
    const auto missed = std::count_if(outcome->criteria.begin(), outcome->criteria.end(),
                                      [](const demo::Criterion& criterion) { return !criterion.met(); });
    fmt::print("| {} | {} | {:.0f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.3f} | {} |\n", scene.name, outcome->bodies,
               double(outcome->contactsKept) / double(outcome->stepMs.size()), median(one), median(all), median(slow),
               median(one) / median(all), outcome->usuallyBelow() / outcome->voxelSize, missed);
    std::fflush(stdout);
}

void printFingerprint(const NamedScene& scene) {
    fmt::print("{} {:016x}\n", scene.name, scene.play().fingerprint);
    std::fflush(stdout);
}

int run(int argc, char** argv) {
    CLI::App app(
        "Plays the scenes of rigid bodies of ./run demo, smaller: time of a step on one thread and on several.");
    std::vector<std::string> names, chosen;
    for (const NamedScene& scene : scenes()) names.push_back(scene.name);
    int threads = tbb::info::default_concurrency(), repetitions = 1;
    app.add_option("--scenes", chosen, "names of the scenes; by default all")->check(CLI::IsMember(names));
    app.add_option("--threads", threads, "count of threads, compared with one")
        ->capture_default_str()
        ->check(CLI::Range(1, 1024));
    app.add_option("--repetitions", repetitions, "repetitions; medians are printed")
        ->capture_default_str()
        ->check(CLI::Range(1, 100));
    bool fingerprints = false;
    app.add_flag("--fingerprints", fingerprints, "only print a hash of all poses of each scene");
    CLI11_PARSE(app, argc, argv);
    const auto isChosen = [&](const NamedScene& scene) {
        return chosen.empty() || std::find(chosen.begin(), chosen.end(), scene.name) != chosen.end();
    };
    if (fingerprints) {
        for (const NamedScene& scene : scenes())
            if (isChosen(scene)) printFingerprint(scene);
        return 0;
    }
    fmt::print(
        "| scene | bodies | contacts a step | a step [ms], 1 thread | {} threads | 99 % of steps | times as fast | "
        "99 % of penetrations [voxels] | criteria missed |\n|---|---|---|---|---|---|---|---|---|\n",
        threads);
    for (const NamedScene& scene : scenes())
        if (isChosen(scene)) compare(scene, threads, repetitions);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("scenes", run, argc, argv);
}
