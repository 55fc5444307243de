// SPDX-License-Identifier: Apache-2.0
// The processes that share the tiles of one field.
// Tested by tests/tools/tiles.cpp through the program.
#pragma once

#include <functional>

namespace bilayer::tools {

/// One process of several, which see the same files.
struct Ranks {
    int rank = 0, count = 1;
    std::function<void()> wait = [] {};  ///< returns when all of them wait

    bool isFirst() const { return rank == 0; }
};

}  // namespace bilayer::tools
