// SPDX-License-Identifier: Apache-2.0
// Floating-point sums without rounding error; internal.
// Tested by tests/sdf/inspect.cpp.
#pragma once

#include <array>
#include <cstddef>

namespace bilayer::detail {

/// The exact sum of at most `Capacity` doubles, computed for its sign. It grows a floating-point expansion by one term
/// at a time, after J. R. Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates"
/// (1997). The sum is exact as long as nothing overflows.
template <std::size_t Capacity>
class ExactSum {
  public:
    void add(double value) {
        std::size_t kept = 0;
        for (std::size_t i = 0; i < count_; ++i) {
            const double sum = value + parts_[i], other = sum - value;
            const double rest = (value - (sum - other)) + (parts_[i] - other);
            if (rest != 0) parts_[kept++] = rest;
            value = sum;
        }
        if (value != 0) parts_[kept++] = value;
        count_ = kept;
    }

    // The last component is the largest and exceeds the sum of all others in magnitude.
    int sign() const { return count_ == 0 ? 0 : parts_[count_ - 1] > 0 ? 1 : -1; }

  private:
    std::array<double, Capacity> parts_{};
    std::size_t count_ = 0;
};

}  // namespace bilayer::detail
