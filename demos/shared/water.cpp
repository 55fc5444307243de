// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/water.h"

#include <openvdb/tools/LevelSetAdvect.h>

#include <algorithm>
#include <cmath>

#include <bilayer/collider/mass.h>
#include "demos/shared/surface_of.h"
#include "sdf/base/openvdb.h"

namespace bilayer::demo {
namespace {

using openvdb::FloatGrid;
using openvdb::Vec3SGrid;

constexpr int bandLayers = 5;      // with known velocity around the liquid, in addition to its movement per step
constexpr double maxGrowth = 0.5;  // max rate of volume restoration [1/s]

void addTo(FloatGrid& grid, float value) {
    for (auto voxel = grid.beginValueOn(); voxel; ++voxel) voxel.setValue(*voxel + value);
}

}  // namespace

Water::Water(const FloatGrid& surface, const Basin& basin, const WaterOptions& options)
    : options_(options), surface_(surface.deepCopy()), velocity_(surface.transform()) {
    basin.extendBehindWalls(*surface_);
    measure(basin);
    if (!(options_.volume > 0)) options_.volume = volume_;
    // at rest, as far as the surface may move in the first step
    pressure_.project(velocity_, *surface_, basin);
    extrapolate(velocity_, bandLayers + 1);
    basin.extendBehindWalls(velocity_);
}

void Water::advectSurface(float seconds) {
    using Field = openvdb::tools::DiscreteField<Vec3SGrid>;
    const Vec3SGrid::Ptr velocity = velocity_.atCentres();
    openvdb::tools::LevelSetAdvection<FloatGrid, Field> advection(*surface_, Field(*velocity));
    advection.setSpatialScheme(openvdb::math::HJWENO5_BIAS);
    advection.setTemporalScheme(openvdb::math::TVD_RK3);
    advection.setTrackerSpatialScheme(openvdb::math::HJWENO5_BIAS);
    advection.setTrackerTemporalScheme(openvdb::math::TVD_RK2);
    advection.setNormCount(1);
    advection.advect(0, seconds);
}

double Water::growth() const {
    if (!(options_.restoring > 0) || !(volume_ > 0)) return 0;
    return std::clamp((options_.volume - volume_) / (volume_ * double(options_.restoring)), -maxGrowth, maxGrowth);
}

void Water::measure(const Basin& basin) {
    shape_ = basin.inside(*surface_);
    const Mesh surface = surfaceOf(*shape_);
    volume_ = surface.triangles.empty() ? 0 : massProperties(surface).volume;
}

Projection Water::step(const Basin& basin, float seconds) {
    advectSurface(seconds);
    basin.extendBehindWalls(*surface_);
    measure(basin);

    velocity_ = advected(velocity_, seconds);
    for (int axis = 0; axis < 3; ++axis)
        if (options_.gravity[axis] != 0) addTo(*velocity_.axes[std::size_t(axis)], seconds * options_.gravity[axis]);
    const double growing = growth();
    const Projection projection = pressure_.project(velocity_, *surface_, basin, growing);
    restored_ += growing * seconds * volume_;

    const int moved = int(std::ceil(velocity_.fastest() * seconds / surface_->voxelSize()[0]));
    extrapolate(velocity_, bandLayers + moved);
    basin.extendBehindWalls(velocity_);
    return projection;
}

}  // namespace bilayer::demo
