// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/field_build.h"

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/task_arena.h>

#include <cstddef>
#include <map>
#include <optional>
#include <stdexcept>

#include <bilayer/sdf/grids.h>
#include "sdf/base/method_names.h"
#include "sdf/base/openvdb.h"
#include "sdf/grid/field_filler.h"
#include "sdf/grid/field_update.h"
#include "sdf/grid/sign_retry.h"
#include "sdf/leaf/blocks.h"
#include "sdf/leaf/build_options.h"

namespace bilayer::detail {
namespace {

void fillWhole(FieldFiller& field) {
    if (hasOwnSigns(field.options().method))
        field.fillWithOwnSigns();
    else if (field.options().sign == Sign::automatic)
        fillWithAutomaticSign(field);
    else
        fillWithRequestedSign(field);
}

void refusePrism(const BuildOptions& options) {
    if (options.method == Method::prism)
        throw std::invalid_argument("the method prism needs an OpenCL device: give build() its filler");
}

void refuseForDevices(const BuildOptions& options, const DeviceFiller& device) {
    if (options.method == Method::pseudonormal)
        throw std::invalid_argument(
            fmt::format("the {} back end has no method {}", device.backend, nameOf(options.method)));
}

// Returns the calling thread's arena of this many threads. Arenas are kept: each new one costs some kilobytes that TBB
// 2021.8 does not give back.
tbb::task_arena& arenaOf(int threads) {
    thread_local std::map<int, tbb::task_arena> arenas;
    return arenas.try_emplace(threads, threads).first->second;
}

// TBB starts no more threads than there are cores unless it is asked to. A lower limit would hold for the whole
// process.
template <class Work>
auto withThreads(int threads, const Work& work) {
    if (threads == 0) return work();
    std::optional<tbb::global_control> moreThanCores;
    if (threads > tbb::info::default_concurrency())
        moreThanCores.emplace(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
    return arenaOf(threads).execute(work);
}

}  // namespace

LevelSet buildField(const Mesh& mesh, const BuildOptions& options, const DeviceFiller* device) {
    checkOptions(options);
    if (device) refuseForDevices(options, *device);
    if (!device) refusePrism(options);
    openvdb::initialize();
    return withThreads(options.threads, [&] {
        FieldFiller field(mesh, options, device);
        fillWhole(field);
        return field.levelSet();
    });
}

FilledPart buildPart(const Mesh& mesh, const BuildOptions& options, const FieldPart& part) {
    checkOptions(options);
    openvdb::initialize();
    return withThreads(options.threads, [&] {
        FieldFiller field(mesh, options, nullptr, &part);
        if (hasOwnSigns(options.method))
            field.fillWithOwnSigns();
        else
            field.fill(mesh, part.signs.method, part.signs.reason, options.method);
        return field.part();
    });
}

LevelSet rebuildField(const LevelSet& old, const Mesh& oldMesh, const Mesh& newMesh,
                      std::span<const std::uint32_t> moved, const BuildOptions& options) {
    checkOptions(options);
    refusePrism(options);
    return withThreads(options.threads, [&] {
        FieldFiller field(newMesh, options, nullptr);
        if (!updateField(field, old, oldMesh, moved)) fillWhole(field);
        return field.levelSet();
    });
}

DeviceTimes fillOnly(const Mesh& mesh, const BuildOptions& options, const DeviceFiller& device) {
    checkOptions(options);
    refuseForDevices(options, device);
    openvdb::initialize();
    return withThreads(options.threads, [&] {
        FieldFiller field(mesh, options, &device);
        fillWhole(field);
        return field.times().device;
    });
}

}  // namespace bilayer::detail
