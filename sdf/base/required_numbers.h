// SPDX-License-Identifier: Apache-2.0
// Errors for numbers that users give.
// Tested by tests/collider/shapes.cpp through ContactShape.
#pragma once

#include <fmt/core.h>

#include <cmath>
#include <stdexcept>
#include <string_view>

namespace bilayer::detail {

/// Throws std::invalid_argument that names the number unless it is above 0 and finite.
template <class Number>
void requirePositive(Number value, std::string_view name) {
    if (!(value > 0) || !std::isfinite(value))
        throw std::invalid_argument(fmt::format("{} is {}, and must be above 0 and finite", name, value));
}

/// Throws std::invalid_argument that names the number unless it is 0 or above, and finite.
template <class Number>
void requireNotNegative(Number value, std::string_view name) {
    if (!(value >= 0) || !std::isfinite(value))
        throw std::invalid_argument(fmt::format("{} is {}, and must be 0 or above, and finite", name, value));
}

}  // namespace bilayer::detail
