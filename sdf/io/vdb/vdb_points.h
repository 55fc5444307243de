// SPDX-License-Identifier: Apache-2.0
// Checks the lengths stored in the point trees of a .vdb file; internal.
// Tested by tests/sdf/vdb_io.cpp through readVdb().
#pragma once

#include <vector>

#include "sdf/io/vdb/vdb_stream.h"
#include "sdf/io/vdb/vdb_tree.h"

namespace bilayer::detail {

/// Skips the attributes of a tree's points, which are stored in passes over all leaves.
void skipVdbPoints(VdbStream& in, const std::vector<VdbLeafMask>& leaves);

}  // namespace bilayer::detail
