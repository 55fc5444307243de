// OpenVDB's fast sweeping (H. Zhao, "A fast sweeping method for Eikonal equations", 2004) over the box of a band.
#include "integration/fluid/fill.h"

#include <openvdb/tools/ChangeBackground.h>
#include <openvdb/tools/FastSweeping.h>

#include "sdf/grids.h"

namespace bilayer::fluid {

LevelSet fill(const LevelSet& levelSet) {
    const openvdb::FloatGrid& band = *levelSet.grids().distance;
    openvdb::MaskGrid box(false);
    box.setTransform(band.transform().copy());
    box.denseFill(band.evalActiveVoxelBoundingBox(), true, true);

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
