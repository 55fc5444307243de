// SPDX-License-Identifier: Apache-2.0
#include "tests/support/analytic.h"

#include <openvdb/tools/Prune.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <memory>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"

namespace bilayer::test {

Solid sphereSolid(double radius, const glm::dvec3& centre) {
    return {[=](const glm::dvec3& p) { return glm::distance(p, centre) - radius; }, glm::dvec3(radius), centre};
}

Solid boxSolid(const glm::dvec3& half) {
    return {[=](const glm::dvec3& p) {
                const glm::dvec3 q = glm::abs(p) - half;
                return glm::length(glm::max(q, glm::dvec3(0))) + std::min(0.0, std::max({q.x, q.y, q.z}));
            },
            half};
}

Solid torusSolid(double major, double minor) {
    return {
        [=](const glm::dvec3& p) { return glm::length(glm::dvec2(glm::length(glm::dvec2(p)) - major, p.z)) - minor; },
        {major + minor, major + minor, minor}};
}

LevelSet levelSetOf(const Solid& solid, double voxel, float exterior, float interior) {
    const float outside = float(exterior * voxel), inside = float(interior * voxel);
    const auto grid = openvdb::FloatGrid::create(outside);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    grid->insertMeta(metadata::interiorWidth, openvdb::FloatMetadata(inside));
    const glm::dvec3 lower = glm::floor((solid.centre - solid.halfSize) / voxel - double(exterior));
    const glm::dvec3 upper = glm::ceil((solid.centre + solid.halfSize) / voxel + double(exterior));
    auto accessor = grid->getAccessor();
    for (int x = int(lower.x); x <= int(upper.x); ++x)
        for (int y = int(lower.y); y <= int(upper.y); ++y)
            for (int z = int(lower.z); z <= int(upper.z); ++z) {
                const auto distance = float(solid.distance(voxel * glm::dvec3(x, y, z)));
                if (distance <= -inside)
                    accessor.setValueOff({x, y, z}, -inside);
                else if (distance < outside)
                    accessor.setValue({x, y, z}, distance);
            }
    openvdb::tools::prune(grid->tree());
    auto grids = std::make_shared<Grids>();
    grids->distance = grid;
    return LevelSet(grids);
}

LevelSet built(const Mesh& mesh, float voxel) {
    BuildOptions options;
    options.voxelSize = voxel;
    return build(mesh, options);
}

}  // namespace bilayer::test
