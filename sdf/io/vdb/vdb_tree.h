// SPDX-License-Identifier: Apache-2.0
// Checks the lengths stored in the trees of a .vdb file; internal.
// Tested by tests/sdf/vdb_io.cpp through readVdb().
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sdf/io/vdb/vdb_stream.h"

namespace bilayer::detail {

/// How the values of a grid's tree are stored.
struct VdbValueFormat {
    std::uint64_t size;  ///< [bytes]
    bool zip, blosc, activeOnly;
    bool half;               ///< values of leaves and of tiles below the root are stored as halves
    std::uint64_t halfSize;  ///< [bytes]
};

inline constexpr std::uint64_t vdbLeafVoxels = 512;

/// The active voxels of a leaf.
using VdbLeafMask = std::array<std::uint64_t, vdbLeafVoxels / 64>;

/// Skips the nodes of a tree, down to the masks of its leaves, which it returns in the order of the file.
std::vector<VdbLeafMask> skipVdbTopology(VdbStream& in, const VdbValueFormat& format);

/// Skips the values of all leaves.
void skipVdbLeaves(VdbStream& in, const VdbValueFormat& format, const std::vector<VdbLeafMask>& leaves);

/// Reads a leaf's mask again. Masks are stored twice, and OpenVDB uses either. Throws if the two differ.
void requireLeafMask(VdbStream& in, const VdbLeafMask& expected);

}  // namespace bilayer::detail
