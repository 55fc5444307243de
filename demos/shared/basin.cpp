// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/basin.h"

#include <openvdb/tools/Composite.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tree/LeafManager.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "demos/shared/shapes.h"
#include "integration/fluid/detail/regrid.h"
#include "sdf/base/openvdb.h"

namespace bilayer::demo {

namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::Vec3d;
using openvdb::Vec3f;
using openvdb::Vec3SGrid;

constexpr int behind = 4;         // layers of voxels and faces behind the box's walls that are mirrored
constexpr double outside = 0.5;   // distance outside the body at which its skin samples the level set [voxels]
constexpr float skin = 3.5f;      // thickness of the body's skin into which the level set is extended [voxels]
constexpr float halfWidth = 3;    // of the box's level set [voxels]
constexpr float minOpen = 0.02f;  // min open fraction of a face: below, pressures cause meaningless speeds
constexpr double flat = 1e-3;     // min slope of a distance that defines a direction

// Returns the open faces of the box alone.
Vec3SGrid::Ptr faceFluidFractionsOf(const CoordBBox& box, const openvdb::math::Transform& cells) {
    const Vec3SGrid::Ptr open = Vec3SGrid::create(Vec3f(0));
    open->setTransform(cells.copy());
    open->setGridClass(openvdb::GRID_STAGGERED);
    auto values = open->getAccessor();
    for (auto cell = box.begin(); cell; ++cell) {
        Vec3f parts(1);
        for (int axis = 0; axis < 3; ++axis)
            if ((*cell)[axis] == box.min()[axis]) parts[axis] = 0;
        values.setValue(*cell, parts);
    }
    return open;
}

FloatGrid::Ptr levelSetOf(const CoordBBox& box, const openvdb::math::Transform& cells) {
    const double voxel = cells.voxelSize()[0];
    const Vec3d half = 0.5 * voxel * box.extents().asVec3d(), centre = cells.indexToWorld(box.getCenter());
    return fluid::detail::regrid(shapes::box({half.x(), half.y(), half.z()}),
                                 Pose{{centre.x(), centre.y(), centre.z()}}, cells, float(halfWidth * voxel));
}

// Returns the cell in the box that is the mirror image of a cell behind the walls.
Coord mirrored(const CoordBBox& box, Coord cell) {
    for (int axis = 0; axis < 3; ++axis) {
        if (cell[axis] < box.min()[axis]) cell[axis] = 2 * box.min()[axis] - 1 - cell[axis];
        if (cell[axis] > box.max()[axis]) cell[axis] = 2 * box.max()[axis] + 1 - cell[axis];
    }
    return cell;
}

// The mirror image of a face. The velocity across a mirrored face changes sign, and at the mirror it is zero.
struct MirroredFace {
    Coord face;
    float sign;
};

MirroredFace mirrored(const CoordBBox& box, const Coord& face, int across) {
    const int low = box.min()[across], high = box.max()[across] + 1, at = face[across];
    Coord seen = mirrored(box, face);
    seen[across] = at < low ? 2 * low - at : at > high ? 2 * high - at : at;
    return {seen, at == low || at == high ? 0.f : at < low || at > high ? -1.f : 1.f};
}

// Returns the box with the mirrored layers behind its walls.
CoordBBox withWalls(CoordBBox box) {
    box.expand(behind);
    return box;
}

// Returns the direction away from the body at a point [index coordinates]; zero if the distance has no direction there.
Vec3d normalAt(const FloatGrid::ConstAccessor& distance, const Vec3d& point, double voxel) {
    Vec3d slope;
    for (int axis = 0; axis < 3; ++axis) {
        Vec3d step(0);
        step[axis] = 0.5;
        slope[axis] = double(openvdb::tools::BoxSampler::sample(distance, point + step) -
                             openvdb::tools::BoxSampler::sample(distance, point - step)) /
                      voxel;
    }
    return slope.length() > flat ? slope.unit() : Vec3d(0);
}

}  // namespace

Basin::Basin(const openvdb::math::Transform& cells, const Coord& size)
    : box_(Coord(0), size.offsetBy(-1)),
      room_(levelSetOf(box_, cells)),
      empty_(faceFluidFractionsOf(box_, cells)),
      open_(empty_),
      solid_{openvdb::createLevelSet<FloatGrid>(cells.voxelSize()[0]), Vec3SGrid::create(Vec3f(0)), nullptr, nullptr} {}

// Returns the body's velocity, but zero for faces in the box's walls, which never move.
Vec3SGrid::Ptr Basin::nextToWalls(const Vec3SGrid& bodyVelocity) const {
    const Vec3SGrid::Ptr result = bodyVelocity.deepCopy();
    for (auto face = result->beginValueOn(); face; ++face) {
        Vec3f speed = *face;
        for (int axis = 0; axis < 3; ++axis)
            if (face.getCoord()[axis] <= box_.min()[axis] || face.getCoord()[axis] > box_.max()[axis]) speed[axis] = 0;
        face.setValue(speed);
    }
    return result;
}

void Basin::place(const fluid::Solid& solid) {
    solid_ = solid;
    solid_.velocity = nextToWalls(*solid.velocity);
    open_ = empty_->deepCopy();
    auto open = open_->getAccessor();
    for (auto faces = solid.faceFluidFraction->cbeginValueOn(); faces; ++faces) {
        CoordBBox reach;
        faces.getBoundingBox(reach);
        reach.intersect(box_);
        Vec3f parts = *faces;
        for (int axis = 0; axis < 3; ++axis)
            if (parts[axis] < minOpen) parts[axis] = 0;
        for (auto cell = reach.begin(); cell; ++cell)
            open.setValue(*cell, openvdb::math::minComponent(open.getValue(*cell), parts));
    }
}

void Basin::extendBehindWalls(FloatGrid& liquid) const {
    const FloatGrid::Ptr before = liquid.deepCopy();
    extendInBody(liquid, *before);
    const auto known = liquid.getConstAccessor();
    auto values = liquid.getAccessor();
    const CoordBBox whole = withWalls(box_);
    for (auto cell = whole.begin(); cell; ++cell) {
        if (box_.isInside(*cell)) continue;
        float value;
        if (known.probeValue(mirrored(box_, *cell), value))
            values.setValue(*cell, value);
        else if (values.isValueOn(*cell) || values.getValue(*cell) != value)
            values.setValueOff(*cell, value);
    }
}

// Extends a level set into the body's skin by its slope along the normal outside, so that it may meet the body at any
// angle.
void Basin::extendInBody(FloatGrid& liquid, const FloatGrid& before) const {
    const double voxel = liquid.voxelSize()[0];
    const float far = liquid.background();
    const auto known = before.getConstAccessor(), distance = solid_.distance->getConstAccessor();
    auto values = liquid.getAccessor();
    for (auto cell = solid_.distance->cbeginValueOn(); cell; ++cell) {
        const double depth = -double(*cell) / voxel;
        if (depth < 0 || depth > skin || !box_.isInside(cell.getCoord())) continue;
        const Vec3d at = cell.getCoord().asVec3d(), normal = normalAt(distance, at, voxel);
        const double reach = depth + outside;
        const float value = 2 * openvdb::tools::BoxSampler::sample(known, at + reach * normal) -
                            openvdb::tools::BoxSampler::sample(known, at + 2 * reach * normal);
        if (std::abs(value) < far)
            values.setValue(cell.getCoord(), value);
        else
            values.setValueOff(cell.getCoord(), std::copysign(far, value));
    }
}

void Basin::extendBehindWalls(FaceVelocity& velocity) const {
    slideAlongBody(velocity);
    const CoordBBox whole = withWalls(box_);
    for (int axis = 0; axis < 3; ++axis) {
        const auto known = velocity.axes[std::size_t(axis)]->getConstAccessor();
        auto values = velocity.axes[std::size_t(axis)]->getAccessor();
        for (auto face = whole.begin(); face; ++face) {
            if (box_.isInside(*face) && (*face)[axis] > box_.min()[axis]) continue;
            const auto [seen, sign] = mirrored(box_, *face, axis);
            float value;
            if (known.probeValue(seen, value)) values.setValue(*face, sign * value);
        }
    }
}

// Gives faces that the body closes the velocity around them, with the body's own normal component.
void Basin::slideAlongBody(FaceVelocity& velocity) const {
    const Vec3SGrid::Ptr around = velocity.together();
    const auto all = around->getConstAccessor(), own = solid_.velocity->getConstAccessor(),
               open = open_->getConstAccessor();
    const auto distance = solid_.distance->getConstAccessor();
    const double voxel = around->voxelSize()[0];
    for (int axis = 0; axis < 3; ++axis) {
        auto values = velocity.axes[std::size_t(axis)]->getAccessor();
        for (auto cell = solid_.distance->cbeginValueOn(); cell; ++cell) {
            const Coord face = cell.getCoord();
            if (*cell > float(voxel) || !box_.isInside(face) || open.getValue(face)[axis] > 0 ||
                !values.isValueOn(face))
                continue;
            Vec3d at = face.asVec3d();
            at[axis] -= 0.5;
            const Vec3d normal = normalAt(distance, at, voxel);
            const Vec3d speed = openvdb::tools::StaggeredBoxSampler::sample(all, at),
                        bodySpeed = openvdb::tools::StaggeredBoxSampler::sample(own, at);
            values.setValue(face, float((speed - normal * normal.dot(speed - bodySpeed))[axis]));
        }
    }
}

FloatGrid::Ptr Basin::inside(const FloatGrid& liquid) const {
    const FloatGrid::Ptr result = liquid.deepCopy();
    openvdb::tools::csgIntersection(*result, *room_->deepCopy());
    if (!solid_.distance->empty()) openvdb::tools::csgDifference(*result, *solid_.distance->deepCopy());
    return result;
}

}  // namespace bilayer::demo
