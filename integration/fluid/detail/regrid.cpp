// SPDX-License-Identifier: Apache-2.0
// Resampling a field at other voxels would blend distances across the medial axis, and after non-uniform scaling its
// values are no distances. So the surface is transferred, and distances are computed again: as fast, and exact.
#include "integration/fluid/detail/regrid.h"

#include <fmt/format.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tree/LeafManager.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/surface.h>
#include "integration/fluid/detail/lattice_cover.h"
#include "integration/fluid/detail/placement.h"
#include "sdf/base/method_names.h"
#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/sign/hole_width.h"
#include "sdf/sign/sign_choice.h"

namespace bilayer::fluid::detail {

using namespace bilayer::detail;
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::math::Transform;
using Leaf = FloatTree::LeafNodeType;

constexpr float minFieldWidthVoxels = 1;  // [field voxels] on either side; a narrower band does not define the surface
constexpr float widthTolerance = 1e-5f;   // tolerance of a width that is a whole number of voxels
constexpr double sameVoxels = 1e-6;       // relative tolerance of equal voxel sizes
constexpr double maxHoleWidthVoxels = 2;  // [voxels]; wider holes are not closed
constexpr double spareWidth = 1e-3;       // relative: what other voxels may change in a width by rounding

// A mesh in voxels near the origin, where floats are most precise, and its translation by whole leaves.
struct Placed {
    Mesh mesh;
    Coord shift;
};

Placed inVoxels(const Mesh& mesh, const Placement& placement, const Transform& voxels) {
    std::vector<openvdb::Vec3d> points(mesh.points.size());
    tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
        const glm::dvec3 p = placement.toWorld(mesh.origin + glm::dvec3(mesh.points[i]));
        points[i] = voxels.worldToIndex({p.x, p.y, p.z});
    });
    openvdb::Vec3d lower(std::numeric_limits<double>::max()), upper(-lower);
    for (const openvdb::Vec3d& p : points) {
        lower = openvdb::math::minComponent(lower, p);
        upper = openvdb::math::maxComponent(upper, p);
    }
    for (int axis = 0; axis < 3; ++axis)
        if (!(lower[axis] > -maxIndex && upper[axis] < maxIndex))
            throw std::invalid_argument(
                "the body is out of range of these voxels: they are too small or it is too far");
    Placed placed{{{}, mesh.triangles, {}}, Coord::floor(0.5 * (lower + upper)) & ~int(Leaf::DIM - 1)};
    placed.mesh.points.reserve(points.size());
    const openvdb::Vec3d shift = placed.shift.asVec3d();
    for (const openvdb::Vec3d& p : points)
        placed.mesh.points.emplace_back(float(p.x() - shift.x()), float(p.y() - shift.y()), float(p.z() - shift.z()));
    return placed;
}

// Moves all leaves and multiplies their values. Inactive voxels get the band's width.
FloatGrid::Ptr moved(const FloatGrid& source, const Coord& shift, float factor, float width) {
    const auto result = FloatGrid::create(width);
    const FloatGrid::Ptr copy = source.deepCopy();
    std::vector<Leaf*> leaves;
    copy->tree().stealNodes(leaves, copy->background(), false);
    tbb::parallel_for(std::size_t(0), leaves.size(), [&](std::size_t i) {
        Leaf& leaf = *leaves[i];
        leaf.setOrigin(leaf.origin() + shift);
        for (auto voxel = leaf.beginValueAll(); voxel; ++voxel) {
            const float value = *voxel * factor;
            const bool inBand = voxel.isValueOn() && std::abs(value) < width;
            voxel.setValue(inBand ? value : std::copysign(width, value));
            if (!inBand) voxel.setValueOff();
        }
    });
    for (Leaf* leaf : leaves) result->tree().addLeaf(leaf);
    openvdb::tools::signedFloodFill(result->tree());
    openvdb::tools::pruneLevelSet(result->tree());
    result->setGridClass(openvdb::GRID_LEVEL_SET);
    return result;
}

// Whether a field is in these very voxels, and its band is as wide.
bool fits(const LevelSet& field, const Placement& placement, const Transform& voxels, float width) {
    const Transform& own = field.grids().distance->transform();
    const auto coincides = [&](const openvdb::Vec3d& index) {
        const openvdb::Vec3d there = own.indexToWorld(index);
        const glm::dvec3 moved = placement.toWorld(field.origin() + glm::dvec3(there.x(), there.y(), there.z()));
        return (voxels.worldToIndex({moved.x, moved.y, moved.z}) - index).length() <= sameVoxels;
    };
    return placement.scale == glm::vec3(1) && coincides({0, 0, 0}) && coincides({1, 0, 0}) && coincides({0, 1, 0}) &&
           coincides({0, 0, 1}) &&
           std::min(field.exteriorWidth(), field.interiorWidth()) >= width * (1 - widthTolerance);
}

void requireCubes(const Transform& voxels) {
    if (!voxels.isLinear() || !voxels.hasUniformScale()) throw std::invalid_argument("the voxels are not cubes");
    if (!(voxels.baseMap()->determinant() > 0))
        throw std::invalid_argument("the voxels are mirrored: the body would be inside out");
}

std::string text(const openvdb::Vec3d& v) {
    return fmt::format("({:g}, {:g}, {:g})", v.x(), v.y(), v.z());
}

// The unit of the last of three digits.
double lastDigit(double value) {
    return std::pow(10, std::floor(std::log10(value)) - 2);
}

// The next number of three digits.
double roundedUp(double value) {
    return std::ceil(value / lastDigit(value)) * lastDigit(value);
}
double roundedDown(double value) {
    return std::floor(value / lastDigit(value)) * lastDigit(value);
}

// A point of a placed mesh in world coordinates [m].
openvdb::Vec3d inWorld(const glm::dvec3& point, const Placed& body, const Transform& voxels) {
    return voxels.indexToWorld(openvdb::Vec3d(point.x, point.y, point.z) + body.shift.asVec3d());
}

[[noreturn]] void refuseWithoutInside(const std::string& why) {
    throw std::invalid_argument("the mesh has no inside: " + why);
}

// Refuses a mesh that bounds no volume, or has a hole too wide for the voxels. Depends on the mesh alone, not on the
// positions of the voxels.
void requireSolid(const Placed& body, const Transform& voxels, Progress& progress) {
    const SignChoice choice = chooseSignOfSolid(body.mesh, &progress);
    if (choice.sign == Sign::flood) refuseWithoutInside(choice.reason);
    if (choice.sign != Sign::winding) return;
    const Hole hole = widestHole(choice.repaired ? *choice.repaired : body.mesh, maxHoleWidthVoxels, &progress);
    if (hole.width == 0) return;
    const double voxel = voxels.voxelSize()[0];
    throw std::invalid_argument(fmt::format(
        "the mesh is open: its widest hole, around {}, is {:.3g} wide; {:g} voxels of {:g} are closed: close it in the "
        "mesh, or take voxels of {:.3g} or more",
        text(inWorld(hole.centre, body, voxels)), hole.width * voxel, maxHoleWidthVoxels, voxel,
        roundedUp((1 + spareWidth) * hole.width * voxel / maxHoleWidthVoxels)));
}

bool reachesDepth(const FloatGrid& grid, float depth) {
    for (auto value = grid.tree().cbeginValueAll(); value; ++value)
        if (*value <= -depth) return true;
    return false;
}

// Refuses a body that is so thin everywhere that it may lie between voxels. Depends on the body alone, not on the
// positions of the voxels: where one of them is that deep, the cover is complete.
void requireWide(const LevelSet& field, const Placed& body, const Transform& voxels, Progress& progress) {
    if (reachesDepth(*field.grids().distance, float(coveringWidthVoxels / 2))) return;
    const Mesh outward = outwardMesh(field, body.mesh);
    const LatticeCover cover(outward, &progress);
    if (cover.isComplete()) return;
    const WidePlace widest = cover.widestPlace();
    if (!(widest.widthVoxels > 0)) refuseWithoutInside("no ball fits into it");
    const double voxel = voxels.voxelSize()[0], size = widest.widthVoxels * voxel;
    throw std::invalid_argument(fmt::format(
        "the body is too thin for these voxels and may lie between them: its widest place, around {}, is {:.3g} wide, "
        "and voxels are {:.3g}: make it thicker, or take voxels of {:.3g} or less",
        text(inWorld(widest.centre, body, voxels)), size, voxel,
        roundedDown((1 - spareWidth) * size / coveringWidthVoxels)));
}

}  // namespace

void requireInside(const FloatGrid& grid) {
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf)
        for (auto voxel = leaf->cbeginValueAll(); voxel; ++voxel)
            if (*voxel < 0) return;
    throw std::invalid_argument("the body has no inside in these voxels");
}

FloatGrid::Ptr regrid(const Mesh& mesh, const Placement& placement, const Transform& voxels, float width,
                      const std::function<bool(float)>& progress, bool uniteSolids) {
    checkPlacement(placement);
    requireCubes(voxels);
    validate(mesh);
    const double voxel = voxels.voxelSize()[0];
    const float widthInVoxels = float(double(width) / voxel);
    const Placed placed = inVoxels(mesh, placement, voxels);
    Progress choosing(progress);
    requireSolid(placed, voxels, choosing);
    const LevelSet field = build(placed.mesh, {.voxelSize = 1,
                                               .exteriorWidthVoxels = widthInVoxels,
                                               .interiorWidthVoxels = widthInVoxels,
                                               .unite = uniteSolids,
                                               .progress = progress});
    if (field.sign() == nameOf(Sign::flood)) refuseWithoutInside(field.signReason());
    requireWide(field, placed, voxels, choosing);
    const auto grid = moved(*field.grids().distance, placed.shift, float(voxel), width);
    grid->setTransform(voxels.copy());
    return grid;
}

FloatGrid::Ptr regrid(const LevelSet& field, const Placement& placement, const Transform& voxels, float width,
                      const std::function<bool(float)>& progress) {
    checkPlacement(placement);
    requireCubes(voxels);
    if (std::min(field.exteriorWidth(), field.interiorWidth()) <
        minFieldWidthVoxels * field.voxelSize() * (1 - widthTolerance))
        throw std::invalid_argument("the field's band is narrower than a voxel");
    if (fits(field, placement, voxels, width)) {
        const auto grid = moved(*field.grids().distance, Coord(0), 1, width);
        requireInside(*grid);
        grid->setTransform(voxels.copy());
        return grid;
    }
    const Mesh zeroSet = surface(field);
    if (zeroSet.triangles.empty()) throw std::invalid_argument("the field has no surface: it has no inside");
    return regrid(zeroSet, placement, voxels, width, progress, false);
}

}  // namespace bilayer::fluid::detail
