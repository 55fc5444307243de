// Device memory with a budget.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cl/detail/program.h"

namespace bilayer::detail {

/// Hands out buffers and keeps count, so that a build stays within its budget whatever the device would give. Buffers
/// go back to the device, which keeps some of them for the next build: new ones cost a page fault every 4 KiB on a
/// processor, and milliseconds on some GPUs.
class DeviceMemory {
  public:
    /// @param budget  most bytes in use at once
    DeviceMemory(DeviceImpl& device, std::uint64_t budget) : device_(device), budget_(budget) {}
    /// Gives all buffers back: the commands that use them have ended.
    ~DeviceMemory();
    DeviceMemory(const DeviceMemory&) = delete;
    DeviceMemory& operator=(const DeviceMemory&) = delete;

    /// A buffer. Throws DeviceError that says what it is for and how much that needs in all at least, if the budget or
    /// the device's largest buffer are too small.
    /// @param purpose  "the mesh"
    cl::Buffer allocate(std::uint64_t bytes, const std::string& purpose);

    /// A buffer that holds data of the host: in place where host and device share memory, else copied by the device's
    /// queue. The data must stay until the commands that use it have ended.
    /// @param event  if not null, receives the copy's
    cl::Buffer upload(const void* data, std::uint64_t bytes, const std::string& purpose, cl::Event* event);

    /// Gives a buffer back: the commands that use it have ended. Does nothing for null.
    void free(cl::Buffer& buffer);

    /// Throws what allocate() throws for the want of memory.
    [[noreturn]] void refuse(std::uint64_t bytes, const std::string& purpose) const;

    std::uint64_t used() const { return used_; }  ///< bytes
    std::uint64_t left() const { return budget_ - used_; }
    std::uint64_t peak() const { return peak_; }  ///< most bytes that were in use at once

  private:
    void count(std::uint64_t bytes, const std::string& purpose);
    cl::Buffer takeSpare(std::uint64_t bytes);
    void keepSpare(const cl::Buffer& buffer);
    void clearSpares();

    DeviceImpl& device_;
    std::uint64_t budget_, used_ = 0, peak_ = 0;
    std::vector<cl::Buffer> taken_;  // that the device may keep
};

}  // namespace bilayer::detail
