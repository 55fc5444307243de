// SPDX-License-Identifier: Apache-2.0
// OpenCL devices: list them, open one, and report their errors.
#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace bilayer {

namespace detail {
struct Access;
struct DeviceImpl;
}  // namespace detail

/// Error of a device. The text names the call, the code and the device, and holds the build log if a kernel failed to
/// build.
struct DeviceError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// What a device is and can do.
struct DeviceInfo {
    std::string platform;                  ///< "Portable Computing Language"
    std::string name;                      ///< "pthread-AMD EPYC"
    std::string version;                   ///< "OpenCL 3.0 PoCL HSTR: ..."
    std::string platformVersion;           ///< "OpenCL 3.0 PoCL 3.1 ..."
    std::string driver;                    ///< "3.1"
    bool gpu = false;                      ///< false: a processor or an accelerator
    bool unifiedMemory = false;            ///< host and device share one memory
    bool exactSquareRoots = false;         ///< rounds square roots correctly
    bool doubles = false;                  ///< supports double precision
    unsigned computeUnits = 0;             ///< count
    std::uint64_t memoryBytes = 0;         ///< global memory [bytes]
    std::uint64_t maxAllocationBytes = 0;  ///< largest single buffer [bytes]
};

/// An OpenCL device with its context, queue and compiled programs, and up to 128 MiB of buffers kept from earlier
/// builds. Copies share them. Several threads may use it at once; each build takes device memory of its own.
class Device {
  public:
    const DeviceInfo& info() const;  ///< What it is and can do. Valid as long as a copy of the device lives.

  private:
    friend struct detail::Access;
    explicit Device(std::shared_ptr<detail::DeviceImpl> data) : data_(std::move(data)) {}

    std::shared_ptr<detail::DeviceImpl> data_;
};

/// All devices of all platforms that can compile kernels, GPUs first. Empty if there is no such device, or no platform.
/// Throws DeviceError when a platform fails to answer.
std::vector<DeviceInfo> devices();

/// Opens the first device whose platform or device name contains `text`, ignoring case. An empty text stands for the
/// environment variable BILAYER_DEVICE, or without it for the first device. If none matches, throws DeviceError that
/// lists the available devices.
Device openDevice(const std::string& text = {});

}  // namespace bilayer
