// SPDX-License-Identifier: Apache-2.0
// OpenVDB's points for the sources of this project, as sdf/base/openvdb.h gives its grids.
// Tested by tests/sdf/vdb_io.cpp.
#pragma once

#include <openvdb/points/PointDataGrid.h>
#include <openvdb/tools/PointIndexGrid.h>

#include "sdf/base/openvdb.h"

BILAYER_COMPILED_TREE(openvdb::points::PointDataTree::RootNodeType)
BILAYER_COMPILED_TREE(openvdb::tools::PointIndexTree::RootNodeType)
