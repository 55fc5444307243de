// SPDX-License-Identifier: Apache-2.0
// Fluid fractions from the distances at the cells' corners. A cube is cut into six tetrahedra along its diagonal, and
// its faces into the triangles of these, so that neighbours agree on shared faces.
#include <bilayer/integration/fluid/obstacle.h>

#include <fmt/format.h>
#include <openvdb/tree/LeafManager.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <stdexcept>

#include "integration/fluid/detail/regrid.h"
#include "sdf/base/openvdb.h"

namespace bilayer::fluid {

using namespace detail;

namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::Vec3SGrid;
using openvdb::Vec3STree;
using openvdb::math::Transform;

constexpr float maxHalfWidthVoxels = 1000;  // [voxels]
constexpr double axisTolerance = 1e-9;      // tolerance of a cosine of 1
// The number of a corner has bit 4 for the upper x, 2 for y, 1 for z. Each tetrahedron runs from corner 0 to corner 7
// along three edges, in one of the orders of the axes.
constexpr int tetrahedra[6][4] = {{0, 4, 6, 7}, {0, 4, 5, 7}, {0, 2, 6, 7}, {0, 2, 3, 7}, {0, 1, 5, 7}, {0, 1, 3, 7}};
// The triangles of the lower face along each axis.
constexpr int triangles[3][2][3] = {{{0, 2, 3}, {0, 1, 3}}, {{0, 4, 5}, {0, 1, 5}}, {{0, 4, 6}, {0, 2, 6}}};

using Corners = std::array<double, 8>;  // distances

// The fraction of an edge up to the surface, from the end with the first value.
double crossingFraction(double here, double there) {
    return here / (here - there);
}

// The negative fraction of a triangle or tetrahedron whose corner values are sorted.
double negativeFraction(const std::array<double, 3>& v) {
    if (v[2] <= 0) return 1;
    if (v[0] >= 0) return 0;
    if (v[1] >= 0) return crossingFraction(v[0], v[1]) * crossingFraction(v[0], v[2]);
    return 1 - crossingFraction(v[2], v[0]) * crossingFraction(v[2], v[1]);
}

double negativeFraction(const std::array<double, 4>& v) {
    if (v[3] <= 0) return 1;
    if (v[0] >= 0) return 0;
    if (v[1] >= 0) return crossingFraction(v[0], v[1]) * crossingFraction(v[0], v[2]) * crossingFraction(v[0], v[3]);
    if (v[2] <= 0)
        return 1 - crossingFraction(v[3], v[0]) * crossingFraction(v[3], v[1]) * crossingFraction(v[3], v[2]);
    // a prism between two corners on either side, in three tetrahedra
    const double ac = crossingFraction(v[0], v[2]), ad = crossingFraction(v[0], v[3]),
                 bc = crossingFraction(v[1], v[2]), bd = crossingFraction(v[1], v[3]);
    return ac * ad + bd * (1 - ad) * ac + bc * bd * (1 - ac);
}

template <std::size_t n>
double solidFraction(const Corners& corners, const int (&simplex)[n]) {
    std::array<double, n> values;
    for (std::size_t i = 0; i < n; ++i) values[i] = corners[std::size_t(simplex[i])];
    std::sort(values.begin(), values.end());
    return negativeFraction(values);
}

float cellFluidFractionOf(const Corners& corners) {
    double solid = 0;
    for (const auto& tetrahedron : tetrahedra) solid += solidFraction(corners, tetrahedron);
    return float(1 - solid / 6);
}

openvdb::Vec3f faceFluidFractionsOf(const Corners& corners) {
    openvdb::Vec3f open;
    for (int axis = 0; axis < 3; ++axis)
        open[axis] =
            float(1 - 0.5 * (solidFraction(corners, triangles[axis][0]) + solidFraction(corners, triangles[axis][1])));
    return open;
}

Corners cornersOf(const FloatGrid::ConstAccessor& distances, const Coord& cell) {
    Corners corners;
    for (int i = 0; i < 8; ++i) corners[std::size_t(i)] = distances.getValue(cell.offsetBy(i >> 2, i >> 1 & 1, i & 1));
    return corners;
}

// A grid whose voxels are the cells' lower corners.
Transform::Ptr cornersOf(const Transform& cells) {
    const Transform::Ptr corners = cells.copy();
    corners->preTranslate(openvdb::Vec3d(-0.5));
    return corners;
}

template <class Grid>
typename Grid::Ptr named(const char* name, typename Grid::TreeType::Ptr tree, const Transform& cells) {
    const auto grid = Grid::create(tree);
    grid->setName(name);
    grid->setTransform(cells.copy());
    return grid;
}

// Computes the fluid fractions. Cells that the surface cuts have all corners in the band, so the leaves of the corners
// hold them. Solid cells beyond these leaves become tiles.
void addFluidFractions(Solid& solid, const FloatGrid& corners, const Transform& cells) {
    const auto volume = std::make_shared<FloatTree>(corners.tree(), 1.f, openvdb::TopologyCopy());
    const auto faces = std::make_shared<Vec3STree>(corners.tree(), openvdb::Vec3f(1), openvdb::TopologyCopy());
    openvdb::tree::LeafManager<FloatTree> leaves(*volume);
    openvdb::tree::LeafManager<Vec3STree> faceLeaves(*faces);
    tbb::parallel_for(std::size_t(0), leaves.leafCount(), [&](std::size_t l) {
        const auto distances = corners.getConstAccessor();
        auto& leaf = leaves.leaf(l);
        auto& faceLeaf = faceLeaves.leaf(l);
        for (openvdb::Index i = 0; i < FloatTree::LeafNodeType::SIZE; ++i) {
            const Corners around = cornersOf(distances, leaf.offsetToGlobalCoord(i));
            const float open = cellFluidFractionOf(around);
            const openvdb::Vec3f faceFluidFraction = faceFluidFractionsOf(around);
            leaf.setValueOnly(i, open);
            leaf.setActiveState(i, open < 1);
            faceLeaf.setValueOnly(i, faceFluidFraction);
            faceLeaf.setActiveState(i, faceFluidFraction != openvdb::Vec3f(1));
        }
    });
    auto tile = corners.tree().cbeginValueAll();
    tile.setMaxDepth(FloatTree::DEPTH - 2);
    for (; tile; ++tile) {
        if (!(*tile < 0)) continue;
        volume->addTile(FloatTree::DEPTH - 1 - tile.getDepth(), tile.getCoord(), 0.f, true);
        faces->addTile(FloatTree::DEPTH - 1 - tile.getDepth(), tile.getCoord(), openvdb::Vec3f(0), true);
    }
    solid.cellFluidFraction = named<FloatGrid>("cell_fluid_fraction", volume, cells);
    solid.faceFluidFraction = named<Vec3SGrid>("face_fluid_fraction", faces, cells);
    solid.faceFluidFraction->setGridClass(openvdb::GRID_STAGGERED);
}

openvdb::Vec3d toVdb(const glm::vec3& v) {
    return {v.x, v.y, v.z};
}

// Computes the body's velocity across the lower faces of the band's cells.
void addVelocity(Solid& solid, const Velocity& velocity, const glm::vec3& centre) {
    const auto tree = std::make_shared<Vec3STree>(solid.distance->tree(), openvdb::Vec3f(0), openvdb::TopologyCopy());
    const Transform& cells = solid.distance->transform();
    openvdb::tree::LeafManager<Vec3STree> leaves(*tree);
    leaves.foreach ([&](Vec3STree::LeafNodeType& leaf, std::size_t) {
        for (auto voxel = leaf.beginValueOn(); voxel; ++voxel) {
            openvdb::Vec3f across;
            for (int axis = 0; axis < 3; ++axis) {
                openvdb::Vec3d face = voxel.getCoord().asVec3d();
                face[axis] -= 0.5;
                const openvdb::Vec3d arm = cells.indexToWorld(face) - toVdb(centre);
                const openvdb::Vec3d at = toVdb(velocity.linear) + toVdb(velocity.angular).cross(arm);
                across[axis] = float(at[axis]);
            }
            voxel.setValue(across);
        }
    });
    solid.velocity = named<Vec3SGrid>("solid_velocity", tree, cells);
    solid.velocity->setGridClass(openvdb::GRID_STAGGERED);
    solid.velocity->setVectorType(openvdb::VEC_CONTRAVARIANT_RELATIVE);
}

void checkCells(const SolidOptions& options, const Transform& cells) {
    if (!cells.isLinear() || !cells.hasUniformScale()) throw std::invalid_argument("the cells must be cubes");
    const double voxel = cells.voxelSize()[0];
    for (int axis = 0; axis < 3; ++axis) {
        openvdb::Vec3d unit(0);
        unit[axis] = 1;
        const openvdb::Vec3d edge = cells.indexToWorld(unit) - cells.indexToWorld(openvdb::Vec3d(0));
        if (!(edge[axis] > (1 - axisTolerance) * voxel))
            throw std::invalid_argument("the cells' axes are not those of the world");
    }
    const glm::vec3 &linear = options.velocity.linear, &angular = options.velocity.angular;
    if (!std::isfinite(glm::length(linear) + glm::length(angular)))
        throw std::invalid_argument(fmt::format("the velocity is not finite: ({}, {}, {}) m/s, ({}, {}, {}) rad/s",
                                                linear.x, linear.y, linear.z, angular.x, angular.y, angular.z));
    if (!(options.halfWidthVoxels >= minHalfWidthVoxels && options.halfWidthVoxels <= maxHalfWidthVoxels))
        throw std::invalid_argument(
            fmt::format("halfWidthVoxels must be in 3..1000, not {:g}", options.halfWidthVoxels));
}

// The progress of one of the two equal halves of the work; none if there is no callback.
std::function<bool(float)> halfOf(const std::function<bool(float)>& progress, float begin) {
    if (!progress) return {};
    return [&progress, begin](float fraction) { return progress(begin + fraction / 2); };
}

template <class Body>
Solid solidOf(const Body& body, const Placement& placement, const Transform& cells, const SolidOptions& options) {
    checkCells(options, cells);
    const float voxel = float(cells.voxelSize()[0]);
    Solid solid;
    solid.distance = regrid(body, placement, cells, options.halfWidthVoxels * voxel, halfOf(options.progress, 0));
    solid.distance->setName("solid");
    const auto corners =
        regrid(body, placement, *cornersOf(cells), minHalfWidthVoxels * voxel, halfOf(options.progress, 0.5f));
    addFluidFractions(solid, *corners, cells);
    addVelocity(solid, options.velocity, placement.pose.position);
    return solid;
}

}  // namespace

Solid solid(const Mesh& mesh, const Placement& placement, const Transform& cells, const SolidOptions& options) {
    return solidOf(mesh, placement, cells, options);
}

Solid solid(const LevelSet& field, const Placement& placement, const Transform& cells, const SolidOptions& options) {
    return solidOf(field, placement, cells, options);
}

}  // namespace bilayer::fluid
