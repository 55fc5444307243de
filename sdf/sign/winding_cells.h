// SPDX-License-Identifier: Apache-2.0
// Signs of the space between leaves by winding numbers.
// Tested by tests/sdf/winding.cpp.
#pragma once

#include <vector>

#include "sdf/base/openvdb.h"
#include "sdf/sign/winding_brick.h"
#include "sdf/sign/winding_query.h"

namespace bilayer::detail {

/// Signs the cells of a brick without leaves, each at once if possible. Adds the cubes that are inside to
/// `insideBoxes`.
void signEmptyCells(const WindingQuery& query, const WindingBrick& brick, std::vector<openvdb::CoordBBox>& insideBoxes);

}  // namespace bilayer::detail
