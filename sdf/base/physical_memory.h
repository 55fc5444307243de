// SPDX-License-Identifier: Apache-2.0
// The physical memory of the machine. Requests that cannot fit into it are rejected early.
// Tested by tests/sdf/build.cpp.
#pragma once

#include <unistd.h>

namespace bilayer::detail {

/// Returns the size of the physical memory [bytes].
inline double physicalMemory() {
    return double(::sysconf(_SC_PHYS_PAGES)) * double(::sysconf(_SC_PAGESIZE));
}

}  // namespace bilayer::detail
