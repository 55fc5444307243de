// SPDX-License-Identifier: Apache-2.0
// Divides the bricks of a grid into batches that fit the device's memory.
// Tested by tests/cl/filler.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "cl/detail/batch_memory.h"
#include "cl/detail/bins.h"

namespace bilayer::detail {

/// Groups for each compute unit that fill bricks one after another, each with its own memory. PoCL gives the first unit
/// more than its share of groups; with one group per unit, other units would be idle.
inline constexpr std::size_t groupsPerUnit = 4;

/// How the kernels of a method fill bricks.
struct BatchMode {
    bool gpuMapping;
    bool fillsBricks;  ///< a group fills whole bricks one after another, else single blocks
    bool triangles;    ///< whether the nearest triangles are requested
};

/// Batches of consecutive bricks.
class BatchPlan {
  public:
    /// The bricks from `first` to `last - 1`.
    struct Range {
        std::size_t first, last;
    };

    /// Plans batches that share the memory that is left. Throws DeviceError if it is too small for batches of one
    /// brick.
    BatchPlan(const DeviceInfo& device, const DeviceBins& bins, const DeviceMemory& memory, const PartBytes& bytes,
              const BatchMode& mode);

    const std::vector<Range>& ranges() const { return ranges_; }
    BatchSize sizeOf(const Range& bricks) const;
    /// Count of the groups that fill the bricks of a batch one after another.
    std::size_t groupsFor(std::uint64_t bricks) const;
    /// The capacity for a batch: that of any batch of the plan if the memory allows, else its own size.
    BatchSize capacityFor(const BatchSize& size) const { return fits(max_) ? max_ : size; }

  private:
    bool fits(const BatchSize& size) const;
    std::size_t lastFitting(std::size_t first, const DeviceMemory& memory) const;

    const DeviceInfo& device_;
    const DeviceBins& bins_;
    const PartBytes bytes_;
    const BatchMode mode_;
    const std::uint64_t share_;  // of the memory, for a batch [bytes]
    std::vector<Range> ranges_;
    BatchSize max_;  // maximum over all batches
};

}  // namespace bilayer::detail
