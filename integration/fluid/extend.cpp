// SPDX-License-Identifier: Apache-2.0
// OpenVDB's fast sweeping (H. Zhao, "A fast sweeping method for Eikonal equations", 2004) over the box of a band.
#include <bilayer/integration/fluid/extend.h>

#include <fmt/format.h>
#include <openvdb/tools/ChangeBackground.h>
#include <openvdb/tools/Count.h>
#include <openvdb/tools/FastSweeping.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"
#include "sdf/base/usable_memory.h"

namespace bilayer::fluid {

using namespace detail;
using namespace bilayer::detail;

namespace {

/// Memory of the sweep for a voxel of the box: the field, its mask, the order of its voxels along eight diagonals.
constexpr double bytesPerVoxel = 24;
/// OpenVDB grows the band by whole voxels; one more layer covers the distance everywhere.
constexpr int spareLayers = 1, maxLayers = 1 << 20;

void check(const openvdb::FloatGrid& band, const openvdb::CoordBBox& box) {
    const auto range = openvdb::tools::minMax(band.tree());
    if (!(range.min() < 0 && range.max() > 0))
        throw std::invalid_argument(
            fmt::format("distances grow from where inside meets outside, and this field has no {}",
                        range.min() < 0 ? "outside" : "inside"));
    const openvdb::Vec3d size = box.extents().asVec3d();
    const double bytes = size.x() * size.y() * size.z() * bytesPerVoxel;
    const double memory = usableMemory();
    if (bytes > memory)
        throw std::invalid_argument(
            fmt::format("to sweep all of the field's box, {} x {} x {} voxels, would need about {:.1f} GiB of memory, "
                        "and {:.1f} GiB may be used",
                        size.x(), size.y(), size.z(), bytes / double(1 << 30), memory / double(1 << 30)));
}

/// The field with other distances. The band's guarantees do not hold for swept values.
LevelSet withDistances(const LevelSet& levelSet, const openvdb::FloatGrid::Ptr& extended, float exterior,
                       float interior) {
    openvdb::tools::changeAsymmetricLevelSetBackground(extended->tree(), exterior, -interior);
    extended->removeMeta(metadata::errorBound);
    extended->removeMeta(metadata::interiorWidth);
    if (interior != exterior) extended->insertMeta(metadata::interiorWidth, openvdb::FloatMetadata(interior));
    openvdb::tools::pruneLevelSet(extended->tree());
    auto grids = std::make_shared<Grids>(levelSet.grids());
    grids->distance = extended;
    return LevelSet(std::move(grids));
}

}  // namespace

LevelSet extend(const LevelSet& levelSet) {
    const openvdb::FloatGrid& band = *levelSet.grids().distance;
    const openvdb::CoordBBox bounds = band.evalActiveVoxelBoundingBox();
    check(band, bounds);
    openvdb::MaskGrid box(false);
    box.setTransform(band.transform().copy());
    box.denseFill(bounds, true, true);

    return withDistances(levelSet, openvdb::tools::maskSdf(band, box), levelSet.exteriorWidth(),
                         levelSet.interiorWidth());
}

LevelSet extend(const LevelSet& levelSet, float distance) {
    if (!(distance > 0) || !std::isfinite(distance))
        throw std::invalid_argument(fmt::format("the distance to extend to must be positive, not {:g}", distance));
    const openvdb::FloatGrid& band = *levelSet.grids().distance;
    const float exterior = std::max(distance, levelSet.exteriorWidth()),
                interior = std::max(distance, levelSet.interiorWidth());
    const float narrower = std::min(levelSet.exteriorWidth(), levelSet.interiorWidth());
    const double layers = std::ceil((double(distance) - double(narrower)) / double(levelSet.voxelSize())) + spareLayers;
    openvdb::CoordBBox box = band.evalActiveVoxelBoundingBox();
    if (layers > double(maxLayers))
        throw std::invalid_argument(
            fmt::format("the distance to extend to, {:g}, is too far for voxels of {:g}: at most {} voxels", distance,
                        levelSet.voxelSize(), maxLayers));
    box.expand(std::max(int(layers), 0));
    check(band, box);
    if (layers <= spareLayers) return levelSet;
    const auto extended = openvdb::tools::dilateSdf(band, int(layers), openvdb::tools::NN_FACE_EDGE_VERTEX);
    openvdb::tree::LeafManager<openvdb::FloatTree> leaves(extended->tree());
    leaves.foreach ([&](openvdb::FloatTree::LeafNodeType& leaf, std::size_t) {
        for (auto voxel = leaf.beginValueOn(); voxel; ++voxel)
            if (*voxel >= exterior || *voxel <= -interior) voxel.setValueOff();
    });
    return withDistances(levelSet, extended, exterior, interior);
}

}  // namespace bilayer::fluid
