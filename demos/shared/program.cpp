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
    option("--threads", threads_, "most threads to use; 0: all")->check(CLI::Range(0, 1024));
    option("--out", out_, "folder for the files");
    flag("--compare", compare_, "play it again on 1, 2 and 8 threads: every bit must be the same");
}

int Program::run(int argc, char** argv, const std::function<Outcome()>& scene) {
    try {
        app_.parse(argc, argv);
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
