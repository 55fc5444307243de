// SPDX-License-Identifier: Apache-2.0
#include "bench/ratios.h"

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <thread>

namespace bilayer::bench {
namespace {

std::string processorName() {
    std::ifstream file("/proc/cpuinfo");
    for (std::string line; std::getline(file, line);)
        if (line.starts_with("model name")) return line.substr(std::min(line.size(), line.find(':') + 2));
    return "unknown";
}

}  // namespace

void Ratios::addOption(CLI::App& app) {
    app.add_option("--ratios", file_, "also write the ratios of each round to this file, for bench compare");
}

void Ratios::add(const std::string& name, const std::vector<double>& rival, const std::vector<double>& ours) {
    std::vector<double>& all = ratios_[name];
    for (std::size_t i = 0; i < std::min(rival.size(), ours.size()); ++i) all.push_back(rival[i] / ours[i]);
}

void Ratios::write() const {
    if (file_.empty()) return;
    const nlohmann::json all{{"benchmark", benchmark_},
                             {"processor", processorName()},
                             {"cores", std::thread::hardware_concurrency()},
                             {"ratios", ratios_}};
    std::ofstream file(file_);
    file << all.dump(1) << "\n";
    if (!file.flush()) throw std::runtime_error("cannot write " + file_);
}

}  // namespace bilayer::bench
