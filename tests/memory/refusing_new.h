// SPDX-License-Identifier: Apache-2.0
// The operator new of this program, which refuses a chosen allocation.
#pragma once

#include <cstddef>

namespace bilayer::test {

/// Counts the allocations of all threads from here on. The given one, counted from 1, throws std::bad_alloc; 0: none.
void refuseAllocation(std::size_t number);

/// Ends the counting and returns the count of allocations, refused ones included.
std::size_t endRefusal();

}  // namespace bilayer::test
