// SPDX-License-Identifier: Apache-2.0
// A device buffer that the host reads in place.
// Tested by tests/cl/filler.cpp through openclFiller().
#pragma once

#include <cstddef>

#include "cl/detail/timing.h"

namespace bilayer::detail {

/// Maps a buffer for the host, from the end of the queue's commands until destruction.
class MappedBuffer {
  public:
    /// @param mapped  receives the event of the mapping
    MappedBuffer(const cl::CommandQueue& queue, const cl::Buffer& buffer, std::size_t bytes, Timing& timing,
                 cl::Event& mapped)
        : queue_(queue),
          buffer_(buffer),
          data_(queue.enqueueMapBuffer(buffer, CL_FALSE, CL_MAP_READ, 0, bytes, nullptr, &mapped)) {
        timing.keep(Timing::Command::download, mapped);
    }
    MappedBuffer(const MappedBuffer&) = delete;
    MappedBuffer& operator=(const MappedBuffer&) = delete;
    ~MappedBuffer() { ::clEnqueueUnmapMemObject(queue_(), buffer_(), data_, 0, nullptr, nullptr); }
    const std::byte* data() const { return static_cast<const std::byte*>(data_); }

  private:
    const cl::CommandQueue& queue_;
    const cl::Buffer& buffer_;
    void* data_;
};

}  // namespace bilayer::detail
