// SPDX-License-Identifier: Apache-2.0
// The device memory of a batch of bricks: its size, its buffers, and the layout of its results.
// Tested by tests/cl/filler.cpp through openclFiller().
#pragma once

#include <cstdint>
#include <limits>

#include "cl/detail/memory.h"

namespace bilayer::detail {

/// Counts of a batch, in the order of FILLED_BLOCKS, OPEN_BLOCKS and CONFLICTS of exact.cl.
struct BatchCounts {
    cl_uint filledBlocks = 0, openBlocks = 0, conflicts = 0;
};

/// Memory that the kernels of a method need [bytes].
struct PartBytes {
    std::uint64_t piece = 0;       ///< of a part of a triangle: Piece of pieces.cl
    std::uint64_t unsorted = 0;    ///< of a part: Member of groups.cl, a sample of samples.cl
    std::uint64_t sorted = 0;      ///< of a part: Member again
    std::uint64_t cell = 0;        ///< of a part: its cell
    std::uint64_t columns = 0;     ///< of a part: columns of numbers, for a group at most as large or for a sample
    std::uint64_t groupBegin = 0;  ///< of a part: the first member of a group
    std::uint64_t brick = 0;  ///< of a brick: the groups of each slice of blocks, or the first samples of its cells

    std::uint64_t perPart() const { return piece + unsorted + sorted + cell + columns + groupBegin; }
};

/// The size of a batch of bricks, or the capacity of its buffers.
struct BatchSize {
    std::uint64_t bricks = 0, blocks = 0, parts = 0;
    std::uint64_t slots = 0;       ///< for parts: vectors of a brick's last parts may extend beyond them
    std::uint64_t groupSlots = 0;  ///< of them, for each group that fills whole bricks

    bool covers(const BatchSize& other) const { return bricks >= other.bricks && slots >= other.slots; }
};

/// The x of the origin of an empty slot for a block.
inline constexpr int noBlock = std::numeric_limits<int>::min();

/// Offsets of a batch's results in its buffer [bytes], aligned for any device.
struct ResultLayout {
    std::uint64_t counts = 0, origins, open, distances, triangles, end;

    ResultLayout(std::uint64_t blocks, bool withTriangles);
};

/// The buffers of a batch.
struct BatchBuffers {
    BatchSize capacity;
    cl::Buffer parts, unsorted, sorted, cells, columns, begins, ofBricks, results;
    cl::Buffer counts, origins, open, distances, triangles;  ///< parts of the results

    /// Allocates all buffers for a batch of this size. Throws DeviceError if the memory is too small.
    void allocate(DeviceMemory& memory, const BatchSize& size, const PartBytes& bytes, bool withTriangles);
    void freeAll(DeviceMemory& memory);
};

/// Bytes of all buffers of a batch.
std::uint64_t totalBytes(const BatchSize& size, const PartBytes& bytes, bool withTriangles);
/// Bytes of the largest buffer of a batch.
std::uint64_t largestBuffer(const BatchSize& size, const PartBytes& bytes, bool withTriangles);

}  // namespace bilayer::detail
