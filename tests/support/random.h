// SPDX-License-Identifier: Apache-2.0
// Random numbers, points and directions from a seed.
#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <random>

namespace bilayer::test {

class Random {
  public:
    explicit Random(unsigned seed) : engine_(seed) {}
    double operator()(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
    glm::vec3 point(double halfSize) {
        return {float((*this)(-halfSize, halfSize)), float((*this)(-halfSize, halfSize)),
                float((*this)(-halfSize, halfSize))};
    }
    glm::vec3 direction() {
        for (;;) {
            const glm::vec3 p = point(1);
            const float length = glm::length(p);
            if (length > 0.1f && length < 1) return p / length;
        }
    }

  private:
    std::mt19937 engine_;
};

}  // namespace bilayer::test
