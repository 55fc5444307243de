// Sampling a field at other voxels would blend distances on either side of medial axes, and stretching it leaves no
// distances at all. So the surface is what is carried over, and distances are found anew: as quick, and exact.
#include "integration/fluid/regrid.h"

#include <openvdb/tools/ChangeBackground.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tree/LeafManager.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <vector>

#include "sdf/build.h"
#include "sdf/grids.h"
#include "sdf/surface.h"

namespace bilayer::fluid {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::math::Transform;
using Leaf = FloatTree::LeafNodeType;

constexpr const char* byNormals = "normals";  // LevelSet::sign() of a closed mesh

constexpr float unitTolerance = 1e-3f;  // by which a rotation's length may differ from 1: a float product's drift
constexpr float minFieldWidth = 1;      // [field voxels] either side: less does not tell where the surface is
constexpr float rounding = 1e-5f;       // of a width that is a whole number of voxels but for its last bits
constexpr double maxIndex = 1 << 29;    // keeps OpenVDB's 32-bit coordinates and sums of two of them in range
constexpr double sameVoxels = 1e-6;     // two voxel sizes are the same but for this part of them
constexpr float mostBetween = 2;  // [voxels] of distance between neighbours on either side; 1 but for small cracks

bool isFinite(const glm::vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// A mesh in voxels, near the origin, where floats are finest; and whole leaves from there to its place.
struct Placed {
    Mesh mesh;
    Coord shift;
};

Placed inVoxels(const Mesh& mesh, const Placement& placement, const Transform& voxels) {
    std::vector<openvdb::Vec3d> points(mesh.points.size());
    tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
        const glm::dvec3 p = placement.toWorld(mesh.points[i]);
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
    Placed placed{{{}, mesh.triangles}, Coord::floor(0.5 * (lower + upper)) & ~int(Leaf::DIM - 1)};
    placed.mesh.points.reserve(points.size());
    const openvdb::Vec3d shift = placed.shift.asVec3d();
    for (const openvdb::Vec3d& p : points)
        placed.mesh.points.emplace_back(float(p.x() - shift.x()), float(p.y() - shift.y()), float(p.z() - shift.z()));
    return placed;
}

// Moves all leaves and multiplies their values; what is not active gets the band's width.
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

// Whether a field lies in these very voxels, and its band reaches as far.
bool fits(const LevelSet& field, const Placement& placement, const Transform& voxels, float width) {
    const Transform& own = field.grids().distance->transform();
    const auto near = [&](const openvdb::Vec3d& index) {
        const openvdb::Vec3d there = own.indexToWorld(index);
        const glm::dvec3 moved = placement.toWorld({float(there.x()), float(there.y()), float(there.z())});
        return (voxels.worldToIndex({moved.x, moved.y, moved.z}) - index).length() <= sameVoxels;
    };
    return placement.scale == glm::vec3(1) && near({0, 0, 0}) && near({1, 0, 0}) && near({0, 1, 0}) &&
           near({0, 0, 1}) && std::min(field.exteriorWidth(), field.interiorWidth()) >= width * (1 - rounding);
}

void requireCubes(const Transform& voxels) {
    if (!voxels.isLinear() || !voxels.hasUniformScale()) throw std::invalid_argument("the voxels are no cubes");
    if (!(voxels.baseMap()->determinant() > 0))
        throw std::invalid_argument("the voxels are mirrored: that would turn the body inside out");
}

// Whether signs change between neighbours that are both far from the surface, as they do across a wide hole.
bool leaks(const FloatGrid& grid) {
    const float farthest = mostBetween * float(grid.voxelSize()[0]);
    openvdb::tree::LeafManager<const FloatTree> leaves(grid.tree());
    std::atomic<bool> found = false;
    leaves.foreach ([&](const Leaf& leaf, std::size_t) {
        const auto values = grid.getConstAccessor();
        for (auto voxel = leaf.cbeginValueAll(); voxel && !found; ++voxel)
            for (int axis = 0; axis < 3; ++axis)
                for (const int side : {-1, 1}) {
                    Coord beside = voxel.getCoord();
                    beside[axis] += side;
                    const float there = values.getValue(beside);
                    if ((*voxel < 0) != (there < 0) && std::abs(*voxel - there) > farthest) found = true;
                }
    });
    return found;
}

}  // namespace

void check(const Placement& placement) {
    const auto& [position, rotation] = placement.pose;
    if (!isFinite(position)) throw std::invalid_argument("the pose's position is not finite");
    const float length = glm::length(rotation);
    if (!std::isfinite(length)) throw std::invalid_argument("the pose's rotation is not finite");
    if (!(std::abs(length - 1) <= unitTolerance))
        throw std::invalid_argument("the pose's rotation is not of unit length");
    if (!isFinite(placement.scale)) throw std::invalid_argument("the scale is not finite");
    if (!(std::min({placement.scale.x, placement.scale.y, placement.scale.z}) > 0))
        throw std::invalid_argument("the scale is not positive: a mirror would turn the body inside out");
}

void requireInside(const FloatGrid& grid) {
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf)
        for (auto voxel = leaf->cbeginValueAll(); voxel; ++voxel)
            if (*voxel < 0) return;
    throw std::invalid_argument("the body has no inside in these voxels");
}

FloatGrid::Ptr regrid(const Mesh& mesh, const Placement& placement, const Transform& voxels, float width) {
    check(placement);
    requireCubes(voxels);
    validate(mesh);
    const double voxel = voxels.voxelSize()[0];
    const float widthInVoxels = float(double(width) / voxel);
    const Placed placed = inVoxels(mesh, placement, voxels);
    const LevelSet field =
        build(placed.mesh, {.voxelSize = 1, .exteriorWidth = widthInVoxels, .interiorWidth = widthInVoxels});
    if (field.sign() != byNormals && leaks(*field.grids().distance))
        throw std::invalid_argument("the mesh is open: a hole is too wide for these voxels");
    const auto grid = moved(*field.grids().distance, placed.shift, float(voxel), width);
    if (field.sign() != byNormals) requireInside(*grid);
    grid->setTransform(voxels.copy());
    return grid;
}

FloatGrid::Ptr regrid(const LevelSet& field, const Placement& placement, const Transform& voxels, float width) {
    check(placement);
    requireCubes(voxels);
    if (std::min(field.exteriorWidth(), field.interiorWidth()) < minFieldWidth * field.voxelSize() * (1 - rounding))
        throw std::invalid_argument("the field's band is narrower than a voxel");
    if (fits(field, placement, voxels, width)) {
        const auto grid = moved(*field.grids().distance, Coord(0), 1, width);
        requireInside(*grid);
        grid->setTransform(voxels.copy());
        return grid;
    }
    const Mesh zeroSet = surface(field);
    if (zeroSet.triangles.empty()) throw std::invalid_argument("the field has no surface: it has no inside");
    return regrid(zeroSet, placement, voxels, width);
}

}  // namespace bilayer::fluid
