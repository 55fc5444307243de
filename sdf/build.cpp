// SPDX-License-Identifier: Apache-2.0
// The public functions of a build: options, threads, and whether the whole field is filled.
#include <bilayer/sdf/build.h>

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>
#include <cmath>
#include <stdexcept>

#include "sdf/base/method_names.h"
#include "sdf/base/openvdb.h"
#include "sdf/grid/field_filler.h"
#include "sdf/grid/field_update.h"
#include "sdf/grid/sign_retry.h"
#include "sdf/leaf/blocks.h"
#include "sdf/leaf/build_options.h"

namespace bilayer {

using namespace detail;

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

void refuseForDevices(const BuildOptions& options, const BlockFiller& filler) {
    if (options.method == Method::pseudonormal)
        throw std::invalid_argument(
            fmt::format("the {} back end has no method {}", filler.backend, nameOf(options.method)));
}

template <class Work>
auto withThreads(int threads, const Work& work) {
    if (threads == 0) return work();
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
    return tbb::task_arena(threads).execute(work);
}

}  // namespace

LevelSet build(const Mesh& mesh, const BuildOptions& options, const BlockFiller* filler) {
    checkOptions(options);
    if (filler) refuseForDevices(options, *filler);
    if (!filler) refusePrism(options);
    openvdb::initialize();
    return withThreads(options.threads, [&] {
        FieldFiller field(mesh, options, filler);
        fillWhole(field);
        return field.levelSet();
    });
}

LevelSet rebuild(const LevelSet& old, const Mesh& oldMesh, const Mesh& newMesh, std::span<const std::uint32_t> moved,
                 const BuildOptions& options) {
    checkOptions(options);
    refusePrism(options);
    return withThreads(options.threads, [&] {
        FieldFiller field(newMesh, options, nullptr);
        if (!updateField(field, old, oldMesh, moved)) fillWhole(field);
        return field.levelSet();
    });
}

LevelSet build(const Mesh& mesh, const BuildOptions& options, const BlockFiller& filler) {
    return build(mesh, options, &filler);
}

void detail::fillOnly(const Mesh& mesh, const BuildOptions& options, const BlockFiller& filler) {
    checkOptions(options);
    refuseForDevices(options, filler);
    openvdb::initialize();
    withThreads(options.threads, [&] {
        FieldFiller field(mesh, options, &filler);
        fillWhole(field);
    });
}

float voxelSizeFor(const Mesh& mesh, float resolution) {
    if (!(resolution > 0) || !std::isfinite(resolution))
        throw std::invalid_argument(fmt::format("the resolution must be positive, not {:g}", resolution));
    validate(mesh);
    const float side = bounds(mesh).longestSide();
    if (!(side > 0) || !std::isfinite(side))
        throw std::invalid_argument("the mesh has no extent, or one beyond floats");
    return side / resolution;
}

}  // namespace bilayer
