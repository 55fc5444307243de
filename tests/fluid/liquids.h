// SPDX-License-Identifier: Apache-2.0
// Liquids and bodies for tests, and checks of liquids.
#pragma once

#include <openvdb/tools/Diagnostics.h>
#include <openvdb/tools/LevelSetMeasure.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <string>

#include <bilayer/collider/pose.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/level_set.h>
#include "sdf/base/openvdb.h"
#include "tests/support/support.h"

namespace bilayer::test {

inline LevelSet fieldOf(const Mesh& mesh, float voxelSize, float width = 3) {
    return build(mesh, {.voxelSize = voxelSize, .exteriorWidthVoxels = width, .interiorWidthVoxels = width});
}

inline openvdb::FloatGrid::Ptr emptyLiquid(float voxelSize, float halfWidth = 3) {
    return openvdb::createLevelSet<openvdb::FloatGrid>(voxelSize, halfWidth);
}

inline Pose poseOf(float angle, const glm::vec3& position = {0.11f, -0.07f, 0.23f}) {
    return {position, glm::angleAxis(angle, glm::normalize(glm::vec3(1, -2, 0.5f)))};
}

// All faults that OpenVDB finds, except a background below three voxels by its last bit, which comes from the caller.
inline std::string faultOf(const openvdb::FloatGrid& liquid) {
    openvdb::tools::CheckLevelSet<openvdb::FloatGrid> check(liquid);
    std::string fault = check.checkTiles();
    if (fault.empty()) fault = check.checkFinite();
    if (fault.empty()) fault = check.checkRange();
    if (fault.empty()) fault = check.checkInactiveValues();
    if (fault.empty()) fault = check.checkEikonal();
    return fault;
}

inline void requireLevelSet(const openvdb::FloatGrid& liquid) {
    const bool threeVoxels = double(liquid.background()) >= 3 * liquid.voxelSize()[0];
    REQUIRE((threeVoxels ? openvdb::tools::checkLevelSet(liquid) : faultOf(liquid)) == "");
    CHECK(liquid.tree().isValueOff(openvdb::Coord(100000)));
}

// The maximum difference between the active values and a formula [voxels].
template <class Formula>
double error(const openvdb::FloatGrid& liquid, Formula distance) {
    double largest = 0;
    for (auto voxel = liquid.cbeginValueOn(); voxel; ++voxel) {
        const openvdb::Vec3d p = liquid.indexToWorld(voxel.getCoord());
        largest = std::max(largest, std::abs(*voxel - distance(glm::dvec3(p.x(), p.y(), p.z()))));
    }
    return largest / liquid.voxelSize()[0];
}

inline double volume(const openvdb::FloatGrid& liquid) {
    return openvdb::tools::levelSetVolume(liquid);
}

}  // namespace bilayer::test
