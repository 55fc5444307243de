// SPDX-License-Identifier: Apache-2.0
// Writes grids in OpenVDB's file format, compressed on all threads; internal.
// Tested by tests/sdf/vdb_io.cpp through readVdb().
#pragma once

#include <iosfwd>

#include "sdf/base/openvdb.h"

namespace bilayer::detail {

/// Maximum relative rounding error of 16-bit floats, which have 11 significant bits.
inline constexpr float halfRounding = 1.f / 2048;

/// Writes the contents of a .vdb file with these grids, which must not share a name or a tree. The bytes are the same
/// as OpenVDB's. Needs memory for their compressed form.
void writeArchive(std::ostream& out, const openvdb::GridCPtrVec& grids);

}  // namespace bilayer::detail
