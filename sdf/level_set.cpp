#include "sdf/level_set.h"

#include <fmt/format.h>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "sdf/grids.h"

namespace bilayer {
namespace {

template <class Value>
Value meta(const openvdb::GridBase& grid, const char* name, const Value& fallback) {
    const auto entry = grid.getMetadata<openvdb::TypedMetadata<Value>>(name);
    return entry ? entry->value() : fallback;
}

void requireLevelSet(const Grids& grids) {
    if (!grids.distance) throw std::invalid_argument("the field has no distance grid");
    const openvdb::FloatGrid& grid = *grids.distance;
    if (grid.getGridClass() != openvdb::GRID_LEVEL_SET)
        throw std::invalid_argument(fmt::format("grid '{}' is no level set", grid.getName()));
    if (!grid.hasUniformVoxels() || !grid.transform().isLinear())
        throw std::invalid_argument(fmt::format("grid '{}' has voxels that are no cubes", grid.getName()));
    if (!(grid.background() > 0) || !std::isfinite(grid.background()))
        throw std::invalid_argument(fmt::format("grid '{}' has a background that is no distance", grid.getName()));
    if (grid.activeVoxelCount() == 0) throw std::invalid_argument(fmt::format("grid '{}' is empty", grid.getName()));
    // whole voxels along the axes: queries work in index space and must not need a rotation
    const double h = grid.voxelSize()[0];
    const openvdb::Vec3d origin = grid.indexToWorld(openvdb::Vec3d(0)) / h;
    for (int axis = 0; axis < 3; ++axis) {
        openvdb::Vec3d unit(0);
        unit[axis] = 1;
        const openvdb::Vec3d step = grid.indexToWorld(unit) / h - origin;
        if (!step.eq(unit, 1e-5) || std::abs(origin[axis] - std::round(origin[axis])) > 1e-3)
            throw std::invalid_argument(
                fmt::format("grid '{}' is rotated, mirrored or shifted by parts of a voxel", grid.getName()));
    }
}

}  // namespace

LevelSet::LevelSet(std::shared_ptr<const Grids> grids) : grids_(std::move(grids)) {
    requireLevelSet(*grids_);
    const openvdb::FloatGrid& grid = *grids_->distance;
    exteriorWidth_ = grid.background();
    interiorWidth_ = meta<float>(grid, metadata::interiorWidth, exteriorWidth_);
    errorBound_ = meta<float>(grid, metadata::errorBound, std::numeric_limits<float>::quiet_NaN());
    method_ = meta<std::string>(grid, metadata::method, "");
    sign_ = meta<std::string>(grid, metadata::sign, "");
    signReason_ = meta<std::string>(grid, metadata::signReason, "");
    signConflicts_ = std::uint64_t(meta<std::int64_t>(grid, metadata::signConflicts, 0));
    meshHash_ = std::uint64_t(meta<std::int64_t>(grid, metadata::meshHash, 0));
}

float LevelSet::voxelSize() const {
    return float(grids_->distance->voxelSize()[0]);
}
float LevelSet::exteriorWidth() const {
    return exteriorWidth_;
}
float LevelSet::interiorWidth() const {
    return interiorWidth_;
}
std::uint64_t LevelSet::activeVoxels() const {
    return grids_->distance->activeVoxelCount();
}
std::uint64_t LevelSet::leaves() const {
    return grids_->distance->tree().leafCount();
}
std::uint64_t LevelSet::memoryBytes() const {
    std::uint64_t bytes = grids_->distance->memUsage();
    if (grids_->triangle) bytes += grids_->triangle->memUsage();
    if (grids_->points) bytes += grids_->points->memUsage();
    return bytes;
}
const std::string& LevelSet::method() const {
    return method_;
}
const std::string& LevelSet::sign() const {
    return sign_;
}
const std::string& LevelSet::signReason() const {
    return signReason_;
}
std::uint64_t LevelSet::signConflicts() const {
    return signConflicts_;
}
float LevelSet::errorBound() const {
    return errorBound_;
}
std::uint64_t LevelSet::meshHash() const {
    return meshHash_;
}

}  // namespace bilayer
