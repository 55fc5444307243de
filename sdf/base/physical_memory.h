// How much memory the machine has: what cannot fit into it is refused before it is tried.
#pragma once

#include <unistd.h>

namespace bilayer::detail {

/// [bytes]
inline double physicalMemory() {
    return double(::sysconf(_SC_PHYS_PAGES)) * double(::sysconf(_SC_PAGESIZE));
}

}  // namespace bilayer::detail
