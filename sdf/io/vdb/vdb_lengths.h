// SPDX-License-Identifier: Apache-2.0
// Checks the lengths stored in a .vdb file. OpenVDB allocates memory for them, and reads into it, before it checks
// them.
// Tested by tests/sdf/vdb_io.cpp through readVdb().
#pragma once

#include <cstdint>
#include <istream>

namespace bilayer::detail {

/// Walks over a stream of grids as openvdb::io::Stream would read it, without allocating memory for the values. It
/// checks every length: of names, metadata, compressed values, and point attributes. The walk ends at trees of values
/// other than numbers, vectors and points; the rest of the stream is not checked.
/// @param size  of the stream, from its current position [bytes]
/// Throws std::runtime_error that states which length is wrong, and std::ios_base::failure if the stream ends too soon
/// and has such exceptions enabled.
void requireLengths(std::istream& stream, std::uint64_t size);

}  // namespace bilayer::detail
