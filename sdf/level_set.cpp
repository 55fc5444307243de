// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/level_set.h>

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string_view>

#include <bilayer/sdf/grids.h>
#include "sdf/base/exact_error.h"
#include "sdf/base/method_names.h"
#include "sdf/base/openvdb.h"
#include "sdf/base/quoted_text.h"
#include "sdf/base/voxel_limits.h"

namespace bilayer {

using namespace detail;

namespace {

/// Maximum distance of voxel (0, 0, 0) from the origin [voxels]: floats cannot separate voxels farther away.
constexpr double maxOrigin = double(std::uint64_t(1) << 40);
/// Maximum band width [voxels]: a wider band is treated as file damage.
constexpr float maxBandWidthVoxels = 1 << 23;
/// Tolerance of an error bound, which was rounded when it was multiplied by the voxel size.
constexpr float widthRounding = 1e-5f;
/// The empty name is for fields from other programs.
constexpr std::string_view methods[] = {"", nameOf(Method::exact), nameOf(Method::doubleLayer),
                                        nameOf(Method::pseudonormal), nameOf(Method::prism)};
constexpr std::string_view signs[] = {
    "", nameOf(Sign::normals), nameOf(Sign::winding), nameOf(Sign::flood), layerSigns, prismSigns};

template <class Value>
Value meta(const openvdb::GridBase& grid, const char* name, const Value& fallback) {
    const auto entry = grid[name];
    if (!entry) return fallback;
    const auto typed = openvdb::DynamicPtrCast<const openvdb::TypedMetadata<Value>>(entry);
    if (!typed)
        throw std::invalid_argument(fmt::format("grid {}: '{}' is of type {}, not {}", quotedWord(grid.getName()), name,
                                                quotedWord(entry->typeName()), openvdb::typeNameAsString<Value>()));
    return typed->value();
}

void requireEntry(bool holds, const openvdb::GridBase& grid, const char* entry, const auto& value, const char* range) {
    if (!holds)
        throw std::invalid_argument(
            fmt::format("grid {}: {} is {}, and must be {}", quotedWord(grid.getName()), entry, value, range));
}

void requireWidth(const openvdb::GridBase& grid, const char* entry, float width) {
    requireEntry(width > 0 && std::isnormal(width) && double(width) <= double(maxBandWidthVoxels) * grid.voxelSize()[0],
                 grid, entry, width, "above 0 and at most 2^23 voxels");
}

std::string requireName(const openvdb::GridBase& grid, const char* entry, const auto& names) {
    const auto name = meta<std::string>(grid, entry, "");
    if (std::find(std::begin(names), std::end(names), name) == std::end(names))
        throw std::invalid_argument(fmt::format("grid {}: '{}' is none of {}", quotedWord(grid.getName()), entry,
                                                fmt::join(std::begin(names) + 1, std::end(names), ", ")));
    return name;
}

// A field from another program may state any error, or none.
void requireErrorBound(const openvdb::GridBase& grid, const std::string& method, float errorBound, float bandWidth) {
    if (!grid[metadata::errorBound]) return;
    const bool hasBound = method == nameOf(Method::exact) || method == nameOf(Method::pseudonormal);
    const float least = hasBound ? (1 - widthRounding) * exactError : 0, h = float(grid.voxelSize()[0]);
    requireEntry(errorBound >= least * h && (errorBound <= std::max(h, bandWidth) || !hasBound), grid,
                 metadata::errorBound, errorBound,
                 hasBound ? "at least the error of its method, and at most the width of the band" : "0 or above");
}

// Methods with signs of their own have no others.
void requireSignOfMethod(const openvdb::GridBase& grid, const std::string& method, const std::string& sign) {
    const auto agree = [&](const char* itsMethod, const char* itsSigns) {
        return method.empty() || sign.empty() || (method == itsMethod) == (sign == itsSigns);
    };
    if (!agree(nameOf(Method::doubleLayer), layerSigns) || !agree(nameOf(Method::prism), prismSigns))
        throw std::invalid_argument(fmt::format("grid {}: '{}' is {}, which the method {} does not have",
                                                quotedWord(grid.getName()), metadata::sign, sign, method));
}

void requireLevelSet(const Grids& grids) {
    if (!grids.distance) throw std::invalid_argument("the field has no distance grid");
    const openvdb::FloatGrid& grid = *grids.distance;
    if (grid.getGridClass() != openvdb::GRID_LEVEL_SET)
        throw std::invalid_argument(fmt::format("grid {} is no level set", quotedWord(grid.getName())));
    if (!grid.hasUniformVoxels() || !grid.transform().isLinear())
        throw std::invalid_argument(fmt::format("grid {} has voxels that are not cubes", quotedWord(grid.getName())));
    const double h = grid.voxelSize()[0];
    requireEntry(h >= double(minVoxelSize) && h <= maxVoxelSize, grid, "the edge of a voxel", h, "from 2e-5 to 1e15");
    requireWidth(grid, "the background", grid.background());
    if (grid.activeVoxelCount() == 0)
        throw std::invalid_argument(fmt::format("grid {} is empty", quotedWord(grid.getName())));
    // Requires a shift by whole voxels along the axes: queries work in index space and must not need a rotation.
    const openvdb::Vec3d origin = grid.indexToWorld(openvdb::Vec3d(0)) / h;
    for (int axis = 0; axis < 3; ++axis) {
        openvdb::Vec3d unit(0);
        unit[axis] = 1;
        const openvdb::Vec3d world = grid.indexToWorld(unit), step = world / h - origin;
        if (!step.eq(unit, 1e-5) || !grid.worldToIndex(world).eq(unit, 1e-3))
            throw std::invalid_argument(
                fmt::format("grid {} is rotated or mirrored: resample it (openvdb::tools::resampleToMatch())",
                            quotedWord(grid.getName())));
        if (!(std::abs(origin[axis] - std::round(origin[axis])) <= 1e-3))
            throw std::invalid_argument(
                fmt::format("grid {} is shifted by {:g} voxels along {}: voxels must be at whole multiples of their "
                            "size. Shift the transform to these, or bilayer.LevelSet.from_numpy() takes its values "
                            "with a field_origin",
                            quotedWord(grid.getName()), origin[axis], "xyz"[axis]));
        requireEntry(std::abs(origin[axis]) <= maxOrigin, grid, "the shift", origin[axis], "at most 2^40 voxels");
    }
}

}  // namespace

LevelSet::LevelSet(std::shared_ptr<const Grids> grids) : grids_(std::move(grids)) {
    requireLevelSet(*grids_);
    const openvdb::FloatGrid& grid = *grids_->distance;
    exteriorWidth_ = grid.background();
    interiorWidth_ = meta<float>(grid, metadata::interiorWidth, exteriorWidth_);
    requireWidth(grid, metadata::interiorWidth, interiorWidth_);
    meta<std::string>(grid, metadata::version, "");
    method_ = requireName(grid, metadata::method, methods);
    errorBound_ = meta<float>(grid, metadata::errorBound, std::numeric_limits<float>::quiet_NaN());
    requireErrorBound(grid, method_, errorBound_, std::max(exteriorWidth_, interiorWidth_));
    sign_ = requireName(grid, metadata::sign, signs);
    requireSignOfMethod(grid, method_, sign_);
    signReason_ = meta<std::string>(grid, metadata::signReason, "");
    const auto count = [&](const char* name) {
        const auto value = meta<std::int64_t>(grid, name, 0);
        requireEntry(value >= 0, grid, name, value, "0 or above");
        return std::uint64_t(value);
    };
    signConflicts_ = count(metadata::signConflicts);
    signUndecided_ = count(metadata::signUndecided);
    meshHash_ = std::uint64_t(meta<std::int64_t>(grid, metadata::meshHash, 0));
    const auto origin = meta<openvdb::Vec3d>(grid, metadata::origin, openvdb::Vec3d(0));
    origin_ = {origin.x(), origin.y(), origin.z()};
    for (int axis = 0; axis < 3; ++axis)
        requireEntry(std::isfinite(origin_[axis]), grid, metadata::origin, origin_[axis], "finite");
}

float LevelSet::voxelSize() const {
    return float(grids_->distance->voxelSize()[0]);
}
glm::dvec3 LevelSet::origin() const {
    return origin_;
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
std::uint64_t LevelSet::signUndecided() const {
    return signUndecided_;
}
float LevelSet::errorBound() const {
    return errorBound_;
}
const BuildTimes& LevelSet::buildTimes() const {
    return grids_->times;
}
std::uint64_t LevelSet::meshHash() const {
    return meshHash_;
}

}  // namespace bilayer
