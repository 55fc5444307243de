// SPDX-License-Identifier: Apache-2.0
#include "bench/paper/timing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "bench/measure.h"

namespace bilayer::paper {

using bench::Builder;
using bench::Scene;
using bench::Stopwatch;
using nlohmann::json;

namespace {

constexpr double maxSeconds = 25;  // a builder gets no further turns once it has used this time

// By the device's clock, as the paper measured: seconds of the kernels, and the peak of device memory.
json profiled(const Engine& engine, const Scene& scene, Builder builder, int rounds) {
    std::vector<double> kernels;
    std::uint64_t peak = 0;
    for (int round = 0; round < rounds; ++round) {
        const BlockFiller filler = openclFiller(engine.device, {.profile = true});
        const DeviceTimes times = bench::fieldOf(scene, {builder, halfWidth, threads, &filler}).buildTimes().device;
        kernels.push_back(times.kernels);
        peak = std::max(peak, times.peakBytes);
    }
    return {{"kernels", bench::median(kernels)}, {"peak", peak}};
}

}  // namespace

json medians(std::vector<Contender> contenders, int rounds) {
    for (int round = 0; round < rounds; ++round)
        for (Contender& contender : contenders) {
            double spent = 0;
            for (const double s : contender.seconds) spent += s;
            if (spent > maxSeconds) continue;
            const Stopwatch watch;
            contender.work();
            contender.seconds.push_back(watch.seconds());
        }
    json result;
    for (const Contender& contender : contenders) result[contender.name] = bench::median(contender.seconds);
    return result;
}

Contender builder(const std::string& name, const Scene& scene, const bench::Job& job) {
    return {name, [&scene, job] { bench::run(scene, job); }};
}

Contender dense(const std::string& name, const Scene& scene, const Lattice& lattice, const DenseOptions& options) {
    return {name, [&scene, lattice, options] { denseDoubleLayer(scene.mesh, lattice, options); }};
}

double value(const json& row, const char* name) {
    return row.contains(name) && row[name].is_number() ? row[name].get<double>() : std::nan("");
}

std::vector<Engine> engines() {
    std::vector<Engine> all;
    for (const DeviceInfo& info : devices()) {
        const Device device = openDevice(info.name);
        all.push_back({device, device.info(), openclFiller(device)});
    }
    return all;
}

json onDevice(const Engine& engine, const Scene& scene, const std::vector<Builder>& builders, int rounds) {
    std::vector<Contender> contenders;
    for (const Builder which : builders) {
        const bench::Job job{which, halfWidth, threads, &engine.filler};
        bench::run(scene, job);
        contenders.push_back(builder(bench::nameOf(which), scene, job));
    }
    json result{{"device", engine.info.name},
                {"gpu", engine.info.gpu},
                {"units", engine.info.computeUnits},
                {"whole", medians(contenders, rounds)}};
    for (const Builder which : builders) result["clock"][bench::nameOf(which)] = profiled(engine, scene, which, rounds);
    return result;
}

double clocked(const json& row, Builder builder) {
    return row["clock"][bench::nameOf(builder)]["kernels"];
}

double whole(const json& row, Builder builder) {
    return row["whole"][bench::nameOf(builder)];
}

std::string nameOf(const json& device) {
    const int units = device.value("units", 0);
    return device["device"].get<std::string>() + (units ? fmt::format(" ({} compute units)", units) : "");
}

std::string legend(const json& devices) {
    std::string text;
    for (std::size_t i = 0; i < devices.size(); ++i) text += fmt::format(" OpenCL {}: {}.", i + 1, nameOf(devices[i]));
    return text.empty() ? " No OpenCL device." : text;
}

}  // namespace bilayer::paper
