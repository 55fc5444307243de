// SPDX-License-Identifier: Apache-2.0
// Unsigned narrow bands by brute force, and checks of signed ones.
#pragma once

#include <oneapi/tbb/global_control.h>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/openvdb.h"
#include "sdf/leaf/band.h"
#include "tests/support/support.h"

namespace bilayer::test {

/// The distances of all voxels nearer to the mesh than `reach` [voxels], in world units.
inline openvdb::FloatGrid::Ptr unsignedBand(const Mesh& mesh, float voxelSize, float reach) {
    const double h = double(voxelSize), far = double(reach) * h;
    auto grid = openvdb::FloatGrid::create(reach * voxelSize);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(h));
    auto values = grid->getAccessor();
    for (const auto& t : mesh.triangles) {
        const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
        openvdb::CoordBBox box;
        for (int axis = 0; axis < 3; ++axis) {
            box.min()[axis] = int(std::floor((std::min({a[axis], b[axis], c[axis]}) - far) / h));
            box.max()[axis] = int(std::ceil((std::max({a[axis], b[axis], c[axis]}) + far) / h));
        }
        for (auto at = box.begin(); at; ++at) {
            const glm::dvec3 p = glm::dvec3((*at).x(), (*at).y(), (*at).z()) * h;
            const float distance = float(std::sqrt(squaredDistance(p, a, b, c)));
            if (distance < std::min(grid->background(), values.getValue(*at))) values.setValueOn(*at, distance);
        }
    }
    return grid;
}

/// The first fault of a signed grid as a level set of these widths over `distances`, or "".
inline std::string fault(const openvdb::FloatGrid& field, const openvdb::FloatGrid& distances,
                         const detail::BandWidths& widths) {
    const float exterior = widths.exterior * widths.voxelSize, interior = widths.interior * widths.voxelSize;
    const float edge = detail::bandEdge * widths.voxelSize;
    if (field.background() != exterior) return "background";
    const auto values = field.getConstAccessor();
    for (auto d = distances.cbeginValueOn(); d; ++d) {
        const float value = values.getValue(d.getCoord()), width = value < 0 ? interior : exterior;
        const bool isInBand = *d < width - edge;
        if (values.isValueOn(d.getCoord()) != isInBand) return "band";
        if (std::abs(value) != (isInBand ? *d : width)) return "distance";
    }
    const auto known = distances.getConstAccessor();
    for (auto value = field.cbeginValueAll(); value; ++value) {
        if (value.isValueOn() && !(value.isVoxelValue() && known.isValueOn(value.getCoord()))) return "active voxel";
        if (!value.isValueOn() && *value != exterior && *value != -interior) return "inactive value";
    }
    for (auto leaf = field.tree().cbeginLeaf(); leaf; ++leaf) {
        float first;
        bool state;
        if (leaf->isConstant(first, state) && !state) return "leaf of one inactive value";
    }
    return "";
}

inline bool sameBytes(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b) {
    if (!a.tree().hasSameTopology(b.tree()) || a.background() != b.background()) return false;
    auto other = b.tree().cbeginLeaf();
    for (auto leaf = a.tree().cbeginLeaf(); leaf; ++leaf, ++other)
        if (std::memcmp(leaf->buffer().data(), other->buffer().data(), sizeof(float) * detail::blockVoxels) != 0)
            return false;
    auto otherValue = b.cbeginValueAll();
    for (auto value = a.cbeginValueAll(); value; ++value, ++otherValue)
        if (*value != *otherValue || value.getCoord() != otherValue.getCoord()) return false;
    return true;
}

/// Applies `sign` to the grid with one thread and with four; returns false if the results differ.
template <class Signer>
bool sameForAnyThreads(const openvdb::FloatGrid& distances, const Signer& sign) {
    const auto one = distances.deepCopy(), four = distances.deepCopy();
    {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
        sign(*one);
    }
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 4);
    sign(*four);
    return sameBytes(*one, *four);
}

}  // namespace bilayer::test
