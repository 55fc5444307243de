// SPDX-License-Identifier: Apache-2.0
// Checks of batch queries.
// Tested by tests/collider/field.cpp.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

namespace bilayer::detail {

/// Throws std::invalid_argument unless a batch has as many answers as points.
inline void requireSameLength(std::size_t points, std::size_t answers, const char* name) {
    if (points != answers)
        throw std::invalid_argument(std::to_string(points) + " points need as many " + name + ", not " +
                                    std::to_string(answers));
}

}  // namespace bilayer::detail
