// SPDX-License-Identifier: Apache-2.0
// The public functions of a build. They call those of grid/field_build.h.
#include <bilayer/sdf/build.h>

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <utility>

#include "sdf/base/access.h"
#include "sdf/grid/field_build.h"
#include "sdf/leaf/blocks.h"

namespace bilayer {

BlockFiller::BlockFiller(detail::DeviceFiller filler)
    : data_(std::make_shared<const detail::DeviceFiller>(std::move(filler))) {}

const std::string& BlockFiller::backend() const {
    return data_->backend;
}

const std::string& BlockFiller::device() const {
    return data_->device;
}

LevelSet build(const Mesh& mesh, const BuildOptions& options, const BlockFiller* filler) {
    return detail::buildField(mesh, options, filler ? &detail::dataOf(*filler) : nullptr);
}

LevelSet build(const Mesh& mesh, const BuildOptions& options, const BlockFiller& filler) {
    return build(mesh, options, &filler);
}

LevelSet rebuild(const LevelSet& old, const Mesh& oldMesh, const Mesh& newMesh, std::span<const std::uint32_t> moved,
                 const BuildOptions& options) {
    return detail::rebuildField(old, oldMesh, newMesh, moved, options);
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
