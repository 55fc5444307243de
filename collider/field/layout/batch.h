// SPDX-License-Identifier: Apache-2.0
// Checks of batch queries.
// Tested by tests/collider/field.cpp through Field::sample().
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

namespace bilayer::detail {

/// Throws std::invalid_argument unless two arguments of a batch have the same length.
/// @param nameA, nameB  what their items are, in errors
inline void requireSameLength(std::size_t countA, const char* nameA, std::size_t countB, const char* nameB) {
    if (countA != countB)
        throw std::invalid_argument(std::to_string(countA) + ' ' + nameA + " need as many " + nameB + ", not " +
                                    std::to_string(countB));
}

}  // namespace bilayer::detail
