// SPDX-License-Identifier: Apache-2.0
// The signs of a field in tiles, in its plan and in the records of its tiles.
// Tested by tests/tools/tile_signs.cpp through the program.
#pragma once

#include "sdf/tiles/tile_build.h"
#include "tools/output.h"

namespace bilayer::tools {

/// The signs of all tiles, as a plan keeps them.
struct PlannedSigns {
    detail::PartSigns signs;  ///< without sums
    int round = 0;            ///< how often normals have contradicted each other before

    /// Returns whether tiles need the sums of the tiles below.
    bool needSums() const { return signs.method == Sign::winding || signs.check != detail::NormalsCheck::none; }
    bool areByFlood() const { return signs.method == Sign::flood; }
};

Json toJson(const PlannedSigns& signs);
/// @param json  null: of a method that finds signs itself
PlannedSigns plannedSigns(const Json& json);

Json toJson(const detail::SignCounts& counts);
detail::SignCounts signCounts(const Json& json);

}  // namespace bilayer::tools
