// SPDX-License-Identifier: Apache-2.0
#include "sdf/base/plane_side.h"

#include "sdf/base/exact_sum.h"

namespace bilayer::detail {

// The sign of 24 products of three factors, each expanded exactly into a sum of doubles.
int exactPlaneSide(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d) {
    ExactSum<64> sum;
    const auto add = [&](const glm::dvec3& p, const glm::dvec3& q, const glm::dvec3& r, double sign) {
        for (int i = 0; i < 3; ++i) {
            const int k = (i + 1) % 3, l = (i + 2) % 3;
            for (const double two : {sign * q[k] * r[l], -sign * q[l] * r[k]}) {
                const double product = p[i] * two;
                sum.add(std::fma(p[i], two, -product));
                sum.add(product);
            }
        }
    };
    add(b, c, d, 1);
    add(a, c, d, -1);
    add(a, b, d, 1);
    add(a, b, c, -1);
    return sum.sign();
}

}  // namespace bilayer::detail
