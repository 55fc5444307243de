// SPDX-License-Identifier: Apache-2.0
// A liquid that starts as a stored level set.
#pragma once

#include <openvdb/openvdb.h>

#include <bilayer/sdf/level_set.h>

namespace bilayer::fluid::detail {

/// A copy of the distances, relative to the level set's origin as they are. Metadata about a mesh and a body do not
/// apply to a liquid and are left out; the origin stays.
openvdb::FloatGrid::Ptr liquidCopy(const LevelSet& levelSet);

}  // namespace bilayer::fluid::detail
