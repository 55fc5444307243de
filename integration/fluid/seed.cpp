// SPDX-License-Identifier: Apache-2.0
// Seeding in three steps. The body's distances are computed at the liquid's voxels, the two level sets are combined by
// OpenVDB's CSG, and the result is repaired until openvdb::tools::checkLevelSet accepts it. All work is done on a copy.
#include <bilayer/integration/fluid/seed.h>

#include <openvdb/tools/Composite.h>
#include <openvdb/tools/Diagnostics.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "integration/fluid/detail/regrid.h"
#include "integration/fluid/detail/repair.h"
#include "sdf/base/openvdb.h"

namespace bilayer::fluid {

using namespace detail;

namespace {

using openvdb::FloatGrid;
using openvdb::FloatTree;

constexpr float rounding = 1e-5f;  // tolerance of a half width that is a whole number of voxels

[[noreturn]] void refuse(const std::string& why) {
    throw std::invalid_argument(why);
}

void requireLiquid(const FloatGrid& liquid) {
    if (liquid.getGridClass() != openvdb::GRID_LEVEL_SET) refuse("the liquid's grid is no level set");
    if (!liquid.transform().isLinear() || !liquid.hasUniformVoxels()) refuse("the liquid's voxels are not cubes");
    if (!(liquid.background() >= minHalfWidthVoxels * liquid.voxelSize()[0] * (1 - rounding)))
        refuse("the liquid's band is narrower than 3 voxels");
    if (!std::isfinite(liquid.background())) refuse("the liquid's background is not finite");
    // all of OpenVDB's checks except those of the gradient, which is repaired, and of the width, whose last bit may
    // differ
    openvdb::tools::CheckLevelSet<FloatGrid> check(liquid);
    std::string fault = check.checkTiles();
    if (fault.empty()) fault = check.checkFinite();
    if (fault.empty()) fault = check.checkRange();
    if (fault.empty()) fault = check.checkInactiveValues();
    if (!fault.empty()) refuse("the liquid's grid is no level set: " + fault.substr(0, fault.find('\n')));
}

FloatGrid::Ptr combined(const FloatGrid& liquid, const FloatGrid::Ptr& body, SeedMode mode) {
    if (liquid.tree().empty() && mode == SeedMode::unite) return body;
    const FloatGrid::Ptr result = liquid.deepCopy();
    switch (mode) {
        case SeedMode::unite:
            openvdb::tools::csgUnion(*result, *body);
            break;
        case SeedMode::intersect:
            openvdb::tools::csgIntersection(*result, *body);
            break;
        case SeedMode::subtract:
            openvdb::tools::csgDifference(*result, *body);
            break;
    }
    return result;
}

// The deepest voxel inside, after requireInside().
openvdb::Coord deepest(const FloatGrid& body) {
    openvdb::Coord found;
    float minimum = 0;
    for (auto leaf = body.tree().cbeginLeaf(); leaf; ++leaf)
        for (auto voxel = leaf->cbeginValueAll(); voxel; ++voxel)
            if (*voxel < minimum) minimum = *voxel, found = voxel.getCoord();
    return found;
}

// Combines the liquid with a body's distances in the same voxels and of the same width.
SeedReport seedWith(FloatGrid& liquid, const FloatGrid::Ptr& band, SeedMode mode) {
    requireInside(*band);
    const openvdb::Coord core = deepest(*band);
    const FloatGrid::Ptr result = combined(liquid, band, mode);
    const Changes changes = repair(*result);
    if (mode == SeedMode::unite && !(result->tree().getValue(core) < 0))
        refuse("the body is too small for these voxels: the result would have no voxel inside it");
    liquid.setTree(result->treePtr());
    const openvdb::Vec3d where = liquid.indexToWorld(changes.where);
    return {changes.largest, {where.x(), where.y(), where.z()}, changes.voxels};
}

}  // namespace

SeedReport seed(FloatGrid& liquid, const Mesh& mesh, const Placement& placement, const SeedOptions& options) {
    requireLiquid(liquid);
    return seedWith(
        liquid, regrid(mesh, placement, liquid.transform(), liquid.background(), options.progress, options.uniteSolids),
        options.mode);
}

SeedReport seed(FloatGrid& liquid, const LevelSet& field, const Placement& placement, const SeedOptions& options) {
    requireLiquid(liquid);
    return seedWith(liquid, regrid(field, placement, liquid.transform(), liquid.background(), options.progress),
                    options.mode);
}

}  // namespace bilayer::fluid
