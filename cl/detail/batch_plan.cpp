// SPDX-License-Identifier: Apache-2.0
#include "cl/detail/batch_plan.h"

#include <algorithm>

#include "cl/detail/kernel_options.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t lanes = 16;  // maximum lanes of a vector: LANES of common.cl
/// Maximum bricks in a batch: on a processor a few megabytes of results stay in its cache; on a GPU they are enough
/// work.
constexpr std::size_t bricksForProcessor = 40, bricksForGpu = 512;
/// Maximum parts in a batch: the limit of a kernel's numbers, and for kernels that pass on a batch, the limit at which
/// the numbers stay in a processor's cache.
constexpr std::uint64_t partsInBatch = 1 << 27, partsForProcessor = 60000;

}  // namespace

BatchPlan::BatchPlan(const DeviceInfo& device, const DeviceBins& bins, const DeviceMemory& memory,
                     const PartBytes& bytes, const BatchMode& mode)
    : device_(device), bins_(bins), bytes_(bytes), mode_(mode), share_(memory.freeBytes() / batchesInFlight) {
    for (std::size_t first = 0, last; first < bins_.bricks(); first = last) {
        last = lastFitting(first, memory);
        ranges_.push_back({first, last});
        const BatchSize size = sizeOf({first, last});
        max_ = {.bricks = std::max(max_.bricks, size.bricks),
                .blocks = std::max(max_.blocks, size.blocks),
                .parts = std::max(max_.parts, size.parts),
                .slots = std::max(max_.slots, size.slots)};
    }
}

BatchSize BatchPlan::sizeOf(const Range& bricks) const {
    const auto slices = std::uint64_t(bins_.grid().blocksPerSide());
    const auto parts = [&](std::size_t first, std::size_t last) {
        return bins_.firstPart(last) - bins_.firstPart(first);
    };
    BatchSize size;
    size.bricks = bricks.last - bricks.first;
    size.blocks = size.bricks * slices * slices * slices;
    size.parts = parts(bricks.first, bricks.last);
    size.slots = size.parts + size.bricks * lanes;
    if (!mode_.fillsBricks) return size;
    for (std::size_t brick = bricks.first; brick < bricks.last; ++brick)
        size.groupSlots = std::max(size.groupSlots, parts(brick, brick + 1) + lanes);
    size.slots = size.groupSlots * groupsFor(size.bricks);
    return size;
}

std::size_t BatchPlan::groupsFor(std::uint64_t bricks) const {
    return std::min<std::size_t>(bricks, std::max(1u, device_.computeUnits) * groupsPerUnit);
}

// Whether a batch of this size fits its share of the memory, the largest buffer, and the kernels' numbers.
bool BatchPlan::fits(const BatchSize& size) const {
    return std::max(size.parts, size.slots) < partsInBatch && totalBytes(size, bytes_, mode_.triangles) <= share_ &&
           largestBuffer(size, bytes_, mode_.triangles) <= device_.maxAllocationBytes;
}

// The end of the range of bricks from `first` on that fits into one batch.
std::size_t BatchPlan::lastFitting(std::size_t first, const DeviceMemory& memory) const {
    if (const BatchSize one = sizeOf({first, first + 1}); !fits(one))
        memory.refuse(batchesInFlight * totalBytes(one, bytes_, mode_.triangles), "a brick of the grid");
    const std::size_t end = std::min(bins_.bricks(), first + (mode_.gpuMapping ? bricksForGpu : bricksForProcessor));
    const std::uint64_t maxParts = mode_.gpuMapping || mode_.fillsBricks ? partsInBatch : partsForProcessor;
    const auto fitsUpTo = [&](std::size_t last) {
        const BatchSize size = sizeOf({first, last});
        return fits(size) && size.parts < maxParts;
    };
    std::size_t last = first + 1;
    while (last < end && fitsUpTo(last + 1)) ++last;
    return last;
}

}  // namespace bilayer::detail
