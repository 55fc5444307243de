// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/body/stored_points.h"

#include <fmt/format.h>
#include <openvdb/points/PointAttribute.h>
#include <openvdb/points/PointConversion.h>
#include <openvdb/points/PointDataGrid.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>
#include <utility>
#include <vector>

#include <bilayer/sdf/grids.h>
#include "collider/contact/body/stored_body.h"
#include "collider/field/samples/field_data.h"
#include "sdf/base/openvdb_points.h"
#include "sdf/base/quoted_text.h"

namespace bilayer::detail {
namespace {

using openvdb::Vec3s;
using Points = openvdb::points::PointDataGrid;

constexpr double pointCell = 4;  // min edge of a point voxel [voxels of the field]; holds a few points

// P, N and id are usual in other programs.
namespace attribute {
constexpr const char* position = "P";
constexpr const char* normal = "N";
constexpr const char* feature = "id";
constexpr const char* sharp = "sharp";
constexpr const char* inner = "back";  // whether a point is on the inner side of an open surface
}  // namespace attribute

// The edge of a point voxel is a power of two. OpenVDB stores a point's place within its voxel; it is then a float
// without rounding, and so is the restored position.
double pointVoxel(float voxelSize) {
    return std::exp2(std::ceil(std::log2(pointCell * double(voxelSize))));
}

template <class Value, class Of>
void addAttribute(Points& grid, const openvdb::tools::PointIndexGrid& index, const char* name,
                  const std::vector<SurfacePoint>& points, Of of) {
    std::vector<Value> values;
    for (std::size_t i = 0; i < points.size(); ++i) values.push_back(of(i));
    openvdb::points::appendAttribute<Value>(grid.tree(), name);
    const openvdb::points::PointAttributeVector<Value> wrapped(values);
    openvdb::points::populateAttribute(grid.tree(), index.tree(), name, wrapped);
}

// Sorts points by their feature ids.
class Collector {
  public:
    void add(std::int32_t feature, const SurfacePoint& point) {
        if (!isFinite(point.position) || !isUnit(glm::length(point.normal)))
            refuseBody(fmt::format("surface point {} needs a finite position and a normal of unit length", feature));
        points_.emplace_back(feature, point);
    }

    std::vector<SurfacePoint> take() {
        std::stable_sort(points_.begin(), points_.end(),
                         [](const auto& a, const auto& b) { return a.first < b.first; });
        std::vector<SurfacePoint> ordered;
        for (const auto& [feature, point] : points_) {
            if (feature != std::int64_t(ordered.size()))
                refuseBody(
                    fmt::format("the surface points must have the numbers 0, 1, 2, ...; one has {} in place of {}",
                                feature, ordered.size()));
            ordered.push_back(point);
        }
        return ordered;
    }

  private:
    std::vector<std::pair<std::int32_t, SurfacePoint>> points_;
};

template <class Value>
using Handle = openvdb::points::AttributeHandle<Value>;

// OpenVDB asks for no more than the first attribute's size.
void requireValues(const Points::TreeType::LeafNodeType& leaf) {
    leaf.validateOffsets();
    for (const char* name :
         {attribute::position, attribute::normal, attribute::feature, attribute::sharp, attribute::inner})
        if (leaf.constAttributeArray(name).dataSize() < openvdb::Index(leaf.getLastValue()))
            refuseBody(
                fmt::format("surface points have fewer values of the attribute '{}' than there are points", name));
}

SurfacePoints load(const Points& grid) {
    Collector collector;
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) {
        requireValues(*leaf);
        // a uniform array takes no space in a file, whatever count it claims
        if (leaf->pointCount() > 1 && leaf->constAttributeArray(attribute::feature).isUniform())
            refuseBody("surface points have the same number");
        const Handle<Vec3s> position(leaf->constAttributeArray(attribute::position));
        const Handle<Vec3s> normal(leaf->constAttributeArray(attribute::normal));
        const Handle<std::int32_t> feature(leaf->constAttributeArray(attribute::feature));
        const Handle<std::int8_t> sharp(leaf->constAttributeArray(attribute::sharp));
        const Handle<std::int8_t> back(leaf->constAttributeArray(attribute::inner));
        for (auto index = leaf->beginIndexOn(); index; ++index) {
            const openvdb::Vec3d place = index.getCoord().asVec3d() + openvdb::Vec3d(position.get(*index));
            collector.add(feature.get(*index), {toGlm(Vec3s(grid.indexToWorld(place))), toGlm(normal.get(*index)),
                                                sharp.get(*index) != 0, back.get(*index) != 0});
        }
    }
    return SurfacePoints(collector.take());
}

}  // namespace

openvdb::GridBase::ConstPtr storePoints(const SurfacePoints& surface, float voxelSize) {
    const std::vector<SurfacePoint> points(surface.points().begin(), surface.points().end());
    std::vector<Vec3s> positions;
    for (const SurfacePoint& point : points) positions.push_back(toVdb(point.position));
    const auto transform = openvdb::math::Transform::createLinearTransform(pointVoxel(voxelSize));
    const openvdb::points::PointAttributeVector<Vec3s> wrapped(positions);
    const auto index = openvdb::tools::createPointIndexGrid<openvdb::tools::PointIndexGrid>(wrapped, *transform);
    const auto grid =
        openvdb::points::createPointDataGrid<openvdb::points::NullCodec, Points>(*index, wrapped, *transform);
    addAttribute<Vec3s>(*grid, *index, attribute::normal, points,
                        [&](std::size_t i) { return toVdb(points[i].normal); });
    addAttribute<std::int32_t>(*grid, *index, attribute::feature, points,
                               [](std::size_t i) { return std::int32_t(i); });
    addAttribute<std::int8_t>(*grid, *index, attribute::sharp, points,
                              [&](std::size_t i) { return points[i].isSharp; });
    addAttribute<std::int8_t>(*grid, *index, attribute::inner, points,
                              [&](std::size_t i) { return points[i].isInner; });
    grid->setName(contactPoints);
    return grid;
}

SurfacePoints loadPoints(const LevelSet& levelSet) {
    const auto grid = openvdb::gridConstPtrCast<Points>(levelSet.grids().points);
    if (!grid || openvdb::points::pointCount(grid->tree()) == 0)
        refuseBody(fmt::format("it has no surface points (grid '{}')", contactPoints));
    try {
        return load(*grid);
    } catch (const openvdb::Exception& error) {
        refuseBody(fmt::format("grid '{}': {}", contactPoints, oneLine(error.what())));
    }
}

}  // namespace bilayer::detail
