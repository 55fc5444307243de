// SPDX-License-Identifier: Apache-2.0
// Passes the blocks that a device has filled to the host's sink.
// Tested by tests/cl/filler.cpp through openclFiller().
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>

#include "cl/detail/batch_memory.h"
#include "cl/detail/staging.h"
#include "cl/detail/timing.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

class HostTransfer {
  public:
    /// Keeps references to the arguments.
    HostTransfer(DeviceImpl& device, const MeshJob& job, Timing& timing)
        : device_(device), job_(job), timing_(timing) {}

    /// Passes blocks on that lie in the host's memory.
    /// @param results  of a batch, in this layout
    void pass(const std::byte* results, const ResultLayout& layout, std::size_t blocks) const;

    /// Downloads the blocks of a batch through staging memory, and passes them on as they arrive.
    void download(const cl::CommandQueue& queue, const BatchBuffers& from, std::size_t blocks);

  private:
    /// Blocks on their way to a half of the staging memory.
    struct Download {
        const std::byte* results = nullptr;
        std::size_t blocks = 0;
        cl::Event done{};
    };
    Download enqueueDownload(const cl::CommandQueue& queue, const BatchBuffers& from, std::size_t first,
                             std::size_t blocks);
    std::size_t blocksPerDownload() const;

    DeviceImpl& device_;
    const MeshJob& job_;
    Timing& timing_;
    std::optional<Staging> staging_;  ///< from the first download on
    std::size_t nextHalf_ = 0;
};

}  // namespace bilayer::detail
