// SPDX-License-Identifier: Apache-2.0
#include "sdf/base/line_side.h"

#include "sdf/base/exact_sum.h"

namespace bilayer::detail {

int exactLineSide(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& p) {
    if (a == b || b == p || p == a) return 0;
    ExactSum<12> sum;
    const auto add = [&](double x, double y) {
        const double product = x * y;
        sum.add(product);
        sum.add(std::fma(x, y, -product));
    };
    add(a.x, b.y);
    add(-a.y, b.x);
    add(b.x, p.y);
    add(-b.y, p.x);
    add(p.x, a.y);
    add(-p.y, a.x);
    return sum.sign();
}

}  // namespace bilayer::detail
