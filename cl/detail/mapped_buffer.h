// SPDX-License-Identifier: Apache-2.0
// A device buffer that the host reads in place.
// Tested by tests/cl/filler.cpp.
#pragma once

#include <cstddef>

#include "cl/detail/timing.h"

namespace bilayer::detail {

/// Maps a buffer for the host, from the end of the queue's commands until destruction.
template <class Item>
class MappedBuffer {
  public:
    /// @param mapped  if not null, receives the event of the mapping
    MappedBuffer(const cl::CommandQueue& queue, const cl::Buffer& buffer, std::size_t count, Timing& timing,
                 cl::Event* mapped = nullptr)
        : queue_(queue), buffer_(buffer) {
        if (count == 0) return;
        cl::Event event;
        data_ = queue.enqueueMapBuffer(buffer, CL_FALSE, CL_MAP_READ, 0, count * sizeof(Item), nullptr, &event);
        timing.keep(Timing::Command::download, event);
        if (mapped) *mapped = event;
    }
    MappedBuffer(const MappedBuffer&) = delete;
    MappedBuffer& operator=(const MappedBuffer&) = delete;
    ~MappedBuffer() {
        if (data_) ::clEnqueueUnmapMemObject(queue_(), buffer_(), data_, 0, nullptr, nullptr);
    }
    const Item* data() const { return static_cast<const Item*>(data_); }

  private:
    const cl::CommandQueue& queue_;
    const cl::Buffer& buffer_;
    void* data_ = nullptr;
};

}  // namespace bilayer::detail
