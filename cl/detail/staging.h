// SPDX-License-Identifier: Apache-2.0
// Downloads from a device with memory of its own.
// Tested by tests/cl/filler.cpp through openclFiller().
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "cl/detail/program.h"

namespace bilayer::detail {

/// Host memory that a device writes to directly, in two halves: while the host reads one, the device fills the other.
/// The driver pins such memory, which costs a millisecond per MiB, so the device keeps it for the next build.
class Staging {
  public:
    static constexpr std::size_t halfBytes = 8 << 20;

    explicit Staging(DeviceImpl& device);
    /// The commands that write to it must have ended.
    ~Staging();
    Staging(const Staging&) = delete;
    Staging& operator=(const Staging&) = delete;

    std::span<std::byte> half(std::size_t index) const { return {bytes_ + index % 2 * halfBytes, halfBytes}; }

  private:
    DeviceImpl& device_;
    PinnedMemory memory_;
    std::byte* bytes_;
};

}  // namespace bilayer::detail
