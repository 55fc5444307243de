// OpenVDB's fast sweeping (H. Zhao, "A fast sweeping method for Eikonal equations", 2004) over the box of a band.
#include "integration/fluid/fill.h"

#include <fmt/format.h>
#include <openvdb/tools/ChangeBackground.h>
#include <openvdb/tools/Count.h>
#include <openvdb/tools/FastSweeping.h>
#include <unistd.h>

#include <stdexcept>

#include "sdf/grids.h"

namespace bilayer::fluid {

namespace {

/// What the sweep takes for a voxel of the box: the field, its mask, the order of its voxels along eight diagonals.
constexpr double bytesPerVoxel = 24;

void check(const openvdb::FloatGrid& band, const openvdb::CoordBBox& box) {
    const auto range = openvdb::tools::minMax(band.tree());
    if (!(range.min() < 0 && range.max() > 0))
        throw std::invalid_argument("distances grow from where inside meets outside, and this field has no inside");
    const openvdb::Vec3d size = box.extents().asVec3d();
    const double bytes = size.x() * size.y() * size.z() * bytesPerVoxel;
    const double memory = double(::sysconf(_SC_PHYS_PAGES)) * double(::sysconf(_SC_PAGESIZE));
    if (bytes > memory)
        throw std::invalid_argument(
            fmt::format("to sweep all of the field's box, {} x {} x {} voxels, would need about {:.0f} GiB of memory",
                        size.x(), size.y(), size.z(), bytes / double(1 << 30)));
}

}  // namespace

LevelSet fill(const LevelSet& levelSet) {
    const openvdb::FloatGrid& band = *levelSet.grids().distance;
    const openvdb::CoordBBox bounds = band.evalActiveVoxelBoundingBox();
    check(band, bounds);
    openvdb::MaskGrid box(false);
    box.setTransform(band.transform().copy());
    box.denseFill(bounds, true, true);

    const auto filled = openvdb::tools::maskSdf(band, box);
    openvdb::tools::changeAsymmetricLevelSetBackground(filled->tree(), levelSet.exteriorWidth(),
                                                       -levelSet.interiorWidth());
    // what was promised for the band does not hold for what is swept
    filled->removeMeta(metadata::errorBound);
    auto grids = std::make_shared<Grids>(levelSet.grids());
    grids->distance = filled;
    return LevelSet(std::move(grids));
}

}  // namespace bilayer::fluid
