// Solids by formula: distances in double precision, and level sets of them that owe nothing to the double layer method.
#pragma once

#include <openvdb/openvdb.h>
#include <openvdb/tools/Prune.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <memory>
#include <random>

#include "sdf/build.h"
#include "sdf/grids.h"

namespace bilayer::test {

/// A solid: its signed distance [m] and the half size of a box around it, about `centre`.
struct Solid {
    std::function<double(const glm::dvec3&)> distance;
    glm::dvec3 halfSize;
    glm::dvec3 centre{0};
};

inline Solid sphereSolid(double radius, const glm::dvec3& centre = glm::dvec3(0)) {
    return {[=](const glm::dvec3& p) { return glm::distance(p, centre) - radius; }, glm::dvec3(radius), centre};
}

inline Solid boxSolid(const glm::dvec3& half) {
    return {[=](const glm::dvec3& p) {
                const glm::dvec3 q = glm::abs(p) - half;
                return glm::length(glm::max(q, glm::dvec3(0))) + std::min(0.0, std::max({q.x, q.y, q.z}));
            },
            half};
}

inline Solid torusSolid(double major, double minor) {
    return {
        [=](const glm::dvec3& p) { return glm::length(glm::dvec2(glm::length(glm::dvec2(p)) - major, p.z)) - minor; },
        {major + minor, major + minor, minor}};
}

/// The level set of a solid; widths in voxels.
inline LevelSet levelSetOf(const Solid& solid, double voxel, float exterior = 3, float interior = 3) {
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

/// The field that the double layer method makes of a mesh.
inline LevelSet built(const Mesh& mesh, float voxel) {
    BuildOptions options;
    options.voxelSize = voxel;
    return build(mesh, options);
}

/// Random points in a cube, directions, ...
class Random {
  public:
    explicit Random(unsigned seed) : engine_(seed) {}
    double operator()(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
    glm::vec3 point(double halfSize) {
        return {float((*this)(-halfSize, halfSize)), float((*this)(-halfSize, halfSize)),
                float((*this)(-halfSize, halfSize))};
    }
    glm::vec3 direction() {
        for (;;) {
            const glm::vec3 p = point(1);
            const float length = glm::length(p);
            if (length > 0.1f && length < 1) return p / length;
        }
    }

  private:
    std::mt19937 engine_;
};

}  // namespace bilayer::test
