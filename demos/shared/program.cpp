// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/program.h"

#include <fmt/core.h>
#include <tbb/global_control.h>

#include <cmath>
#include <optional>

#include "demos/shared/stage.h"

namespace bilayer::demo {
CLI::Validator aNumber() {
    const auto refuseNaN = [](const std::string& text) -> std::string {
        double value = 0;
        return CLI::detail::lexical_cast(text, value) && std::isnan(value) ? "NaN is no number" : "";
    };
    return {refuseNaN, ""};
}

Program::Program(std::string name, const std::string& description) : name_(std::move(name)), app_(description, name_) {
    option("--threads", threads_, "maximum count of threads; 0: all")->check(CLI::Range(0, 1024));
    option("--out", out_, "output folder");
    flag("--compare", compare_, "repeat the scene on 1, 2 and 8 threads and require the same bits");
}

void Program::seconds(float& duration, double min, double max, const std::string& help) {
    option("--seconds", duration, help)->check(CLI::Range(min, max));
}

void Program::steps(float& perSecond, double min, double max) {
    option("--steps", perSecond, "steps per second")->check(CLI::Range(min, max));
}

void Program::iterations(int& count) {
    option("--iterations", count, "iterations of Bullet's solver")->check(CLI::Range(1, 10000));
}

void Program::voxel(float& edge, double min, double max) {
    option("--voxel", edge, "edge of a voxel [m]")->check(CLI::Range(min, max));
}

void Program::factory(std::filesystem::path& folder, const std::string& parts, const std::string& use,
                      bool (*hasParts)(const std::filesystem::path&)) {
    option("--factory", folder, "folder with " + parts + " of the Factory data set, " + use);
    checkFactory_ = [this, &folder, parts, hasParts] {
        if (folder.empty() || hasParts(folder)) return;
        fmt::print(stderr, "{}: cannot find {} of the Factory data set in {}: parts by formula are used\n", name_,
                   parts, folder.string());
        folder.clear();
    };
}

int Program::run(int argc, char** argv, const std::function<Outcome()>& scene) {
    try {
        app_.parse(argc, argv);
        checkFactory_();
        return play(scene).met() ? 0 : 3;
    } catch (const CLI::ParseError& error) {
        return app_.exit(error) == 0 ? 0 : 2;
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}: {}\n", name_, error.what());
        return 1;
    }
}

Outcome Program::play(const std::function<Outcome()>& scene) const {
    std::optional<tbb::global_control> limit;
    if (threads_ > 0) limit.emplace(tbb::global_control::max_allowed_parallelism, std::size_t(threads_));
    Outcome outcome = scene();
    if (compare_) outcome.criteria.push_back(sameBits(outcome, scene));
    write(outcome, name_, out_);
    print(outcome);
    return outcome;
}

}  // namespace bilayer::demo
