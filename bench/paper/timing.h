// SPDX-License-Identifier: Apache-2.0
// Timing of builders for the paper's tables: on threads, in turns, and on OpenCL devices.
#pragma once

#include <array>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include <bilayer/cl/filler.h>
#include "bench/builders.h"
#include "bench/paper/dense.h"

namespace bilayer::paper {

inline constexpr float halfWidth = 2;  // "about 2 Delta away from the triangle mesh", for all builders [steps]
inline constexpr int threads = 2;      // of builders with more than one thread, except devices

/// A timed alternative; alternatives run in turns.
struct Contender {
    std::string name;
    std::function<void()> work;
    std::vector<double> seconds{};
};

/// Contenders take turns, so that a slow minute affects all of them alike. The first round counts, since a mesh is
/// built only once.
nlohmann::json medians(std::vector<Contender> contenders, int rounds);

Contender builder(const std::string& name, const bench::Scene& scene, const bench::Job& job);
Contender dense(const std::string& name, const bench::Scene& scene, const Lattice& lattice,
                const DenseOptions& options = {});

/// A number of a row; NaN if the row has none.
double value(const nlohmann::json& row, const char* name);

/// An OpenCL device and its builder.
struct Engine {
    Device device;
    DeviceInfo info;
    BlockFiller filler;
};

std::vector<Engine> engines();

/// Times of a device for some builders: a warm-up, which compiles; the turns; and the device's own clock.
nlohmann::json onDevice(const Engine& engine, const bench::Scene& scene, const std::vector<bench::Builder>& builders,
                        int rounds);

/// Seconds of onDevice() for a builder: of the kernels by the device's clock, and of the whole build.
double clocked(const nlohmann::json& row, bench::Builder builder);
double whole(const nlohmann::json& row, bench::Builder builder);

/// Name of a device with its count of compute units.
std::string nameOf(const nlohmann::json& device);

/// Legend for the column names "OpenCL 1" and so on.
std::string legend(const nlohmann::json& devices);

/// Our methods in Tables 4 and 5.
inline constexpr std::array onTbb{std::pair("layers", "`double-layer`"), std::pair("exact", "`exact`")};
inline constexpr std::array onDevices{std::pair(bench::Builder::doubleLayerOpencl, "`double-layer`"),
                                      std::pair(bench::Builder::exactOpencl, "`exact`")};

}  // namespace bilayer::paper
