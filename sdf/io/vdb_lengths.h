// Whether the lengths that a .vdb file tells can be true. OpenVDB takes memory for them, and reads into it, before it
// looks.
#pragma once

#include <cstdint>
#include <istream>

namespace bilayer::detail {

/// Walks over a stream of grids as openvdb::io::Stream would read it, without memory for the values that it holds.
/// Every length is checked: of names, metadata, compressed values, and the attributes of points. Trees of other values
/// than numbers, vectors and points end the walk: what comes behind them is not looked at.
/// @param size  of the stream, from where it is [bytes]
/// Throws std::runtime_error that says which length is wrong, and std::ios_base::failure where the stream ends too soon
/// and has such exceptions.
void requireLengths(std::istream& stream, std::uint64_t size);

}  // namespace bilayer::detail
