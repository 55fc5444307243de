// SPDX-License-Identifier: Apache-2.0
// Device memory within a budget.
// Tested by tests/cl/field.cpp through DeviceField.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cl/detail/program.h"

namespace bilayer::detail {

inline constexpr std::uint64_t mebibyte = 1 << 20;

/// Allocates buffers and counts their bytes, so that a build stays within its budget. Freed buffers go back to the
/// device, which keeps some of them for the next build: new ones cost a page fault every 4 KiB on a processor, and
/// milliseconds on some GPUs.
class DeviceMemory {
  public:
    /// @param budget  maximum bytes in use at once
    DeviceMemory(DeviceImpl& device, std::uint64_t budget) : device_(device), budget_(budget) {}
    /// Frees all buffers. The commands that use them must have ended.
    ~DeviceMemory();
    DeviceMemory(const DeviceMemory&) = delete;
    DeviceMemory& operator=(const DeviceMemory&) = delete;

    /// Allocates a buffer. Throws DeviceError if the budget or the device's largest buffer is too small; the text
    /// states the purpose and the minimum total memory.
    /// @param purpose  for the error text, "the mesh"
    cl::Buffer allocate(std::uint64_t bytes, const std::string& purpose);

    /// A buffer that holds data of the host: in place where host and device share memory, else copied by the device's
    /// queue. The data must stay valid until the commands that use it have ended.
    /// @param event  if not null, receives the event of the copy
    cl::Buffer upload(const void* data, std::uint64_t bytes, const std::string& purpose, cl::Event* event);

    /// Frees a buffer. The commands that use it must have ended. Does nothing for null.
    void free(cl::Buffer& buffer);

    /// Throws what allocate() throws if the memory is too small.
    [[noreturn]] void refuse(std::uint64_t bytes, const std::string& purpose) const;

    std::uint64_t used() const { return used_; }  ///< bytes
    std::uint64_t freeBytes() const { return budget_ - used_; }
    std::uint64_t peak() const { return peak_; }  ///< maximum bytes in use at once

  private:
    void count(std::uint64_t bytes, const std::string& purpose);
    cl::Buffer takeSpare(std::uint64_t bytes);
    void keepSpare(const cl::Buffer& buffer);
    void clearSpares();

    DeviceImpl& device_;
    std::uint64_t budget_, used_ = 0, peak_ = 0;
    std::vector<cl::Buffer> taken_;  // buffers that the device may keep
};

}  // namespace bilayer::detail
