// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/face_velocity.h"

#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/Morphology.h>
#include <openvdb/tools/VolumeAdvect.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>

#include "sdf/base/openvdb.h"

namespace bilayer::demo {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::Vec3SGrid;
using openvdb::Vec3STree;

// Adds one layer: each new voxel gets the mean of the neighbours that were active before.
void addLayer(FloatTree& tree) {
    const FloatTree before(tree);
    openvdb::tools::dilateActiveValues(tree, 1, openvdb::tools::NN_FACE, openvdb::tools::IGNORE_TILES);
    openvdb::tree::LeafManager<FloatTree> leaves(tree);
    leaves.foreach ([&](FloatTree::LeafNodeType& leaf, std::size_t) {
        const openvdb::tree::ValueAccessor<const FloatTree> known(before);
        FloatTree::LeafNodeType::NodeMaskType added = leaf.getValueMask();
        if (const auto* old = before.probeConstLeaf(leaf.origin())) added -= old->getValueMask();
        for (auto face = added.beginOn(); face; ++face) {
            const Coord at = leaf.offsetToGlobalCoord(face.pos());
            float sum = 0;
            int count = 0;
            for (int axis = 0; axis < 3; ++axis)
                for (const int side : {-1, 1}) {
                    Coord neighbour = at;
                    neighbour[axis] += side;
                    float value;
                    if (!known.probeValue(neighbour, value)) continue;
                    sum += value;
                    ++count;
                }
            if (count > 0) leaf.setValueOnly(face.pos(), sum / float(count));
        }
    });
}

// Returns one vector per cell with a known face, in the cells' own transform.
template <class Part>
Vec3SGrid::Ptr vectors(const FaceVelocity& velocity, const Part& part) {
    const auto& axes = velocity.axes;
    const auto tree = std::make_shared<Vec3STree>(axes[0]->tree(), openvdb::Vec3f(0), openvdb::TopologyCopy());
    tree->topologyUnion(axes[1]->tree());
    tree->topologyUnion(axes[2]->tree());
    openvdb::tree::LeafManager<Vec3STree> leaves(*tree);
    leaves.foreach ([&](Vec3STree::LeafNodeType& leaf, std::size_t) {
        const std::array speeds{axes[0]->getConstAccessor(), axes[1]->getConstAccessor(), axes[2]->getConstAccessor()};
        for (auto cell = leaf.beginValueOn(); cell; ++cell) {
            const Coord at = cell.getCoord();
            cell.setValue({part(speeds[0], at, 0), part(speeds[1], at, 1), part(speeds[2], at, 2)});
        }
    });
    const Vec3SGrid::Ptr grid = Vec3SGrid::create(tree);
    grid->setTransform(velocity.cells->copy());
    return grid;
}

}  // namespace

FaceVelocity::FaceVelocity(const openvdb::math::Transform& transform) : cells(transform.copy()) {
    for (int axis = 0; axis < 3; ++axis) {
        openvdb::Vec3d half(0);
        half[axis] = -0.5;
        axes[std::size_t(axis)] = FloatGrid::create(0.f);
        axes[std::size_t(axis)]->setTransform(cells->copy());
        axes[std::size_t(axis)]->transform().preTranslate(half);
    }
}

Vec3SGrid::Ptr FaceVelocity::together() const {
    const Vec3SGrid::Ptr grid =
        vectors(*this, [](const auto& speed, const Coord& cell, int) { return speed.getValue(cell); });
    grid->setGridClass(openvdb::GRID_STAGGERED);
    return grid;
}

Vec3SGrid::Ptr FaceVelocity::atCentres() const {
    return vectors(*this, [](const auto& speed, const Coord& cell, int axis) {
        Coord upper = cell;
        upper[axis] += 1;
        return 0.5f * (speed.getValue(cell) + speed.getValue(upper));
    });
}

float FaceVelocity::fastest() const {
    float most = 0;
    for (const auto& axis : axes)
        for (auto face = axis->cbeginValueOn(); face; ++face) most = std::max(most, std::abs(*face));
    return most;
}

void extrapolate(FaceVelocity& velocity, int layers) {
    for (const auto& axis : velocity.axes)
        for (int layer = 0; layer < layers; ++layer) addLayer(axis->tree());
}

FaceVelocity advected(const FaceVelocity& velocity, float seconds) {
    const Vec3SGrid::Ptr along = velocity.together();
    openvdb::tools::VolumeAdvection<Vec3SGrid, true> advection(*along);
    advection.setIntegrator(openvdb::tools::Scheme::MAC);
    advection.setLimiter(openvdb::tools::Scheme::CLAMP);
    FaceVelocity result = velocity;
    for (auto& axis : result.axes) {
        const FloatGrid::Ptr before = axis;
        axis = advection.advect<FloatGrid, FloatGrid, openvdb::tools::BoxSampler>(*before, *before, double(seconds));
        axis->topologyUnion(*before);  // the advection treats zero velocity as unknown
    }
    return result;
}

}  // namespace bilayer::demo
