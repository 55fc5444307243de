// SPDX-License-Identifier: Apache-2.0
// Writes grids in OpenVDB's file format, compressed on all threads; internal.
// Tested by tests/sdf/vdb_io.cpp.
#pragma once

#include <string>

#include "sdf/base/openvdb.h"

namespace bilayer::detail {

/// Maximum relative rounding error of 16-bit floats, which have 11 significant bits.
inline constexpr float halfRounding = 1.f / 2048;

/// Returns the contents of a .vdb file with these grids, which must not share a name or a tree. The bytes are the same
/// as OpenVDB's.
std::string archiveOf(const openvdb::GridCPtrVec& grids);

}  // namespace bilayer::detail
