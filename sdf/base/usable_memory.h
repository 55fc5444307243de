// SPDX-License-Identifier: Apache-2.0
// The memory that this process may use. Requests that cannot fit into it are rejected early.
// Tested by tests/tools/limits.cpp through the program.
#pragma once

namespace bilayer::detail {

/// Returns the smallest of the physical memory, the process's limit of address space, and the limits of its control
/// groups, as containers set them [bytes]. The limit of address space is read at each call, the others once.
double usableMemory();

/// Returns how much more memory this process may take by its own limits of address space and data (`ulimit -v`, `-d`)
/// [bytes]; infinite without limits.
double remainingMemory();

}  // namespace bilayer::detail
