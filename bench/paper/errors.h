// SPDX-License-Identifier: Apache-2.0
// Errors of fields against the true distances.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>

#include <bilayer/sdf/level_set.h>
#include "bench/paper/dense.h"

namespace bilayer::paper {

/// Every node of a cube of (2K + 1)^3 nodes around a sample is nearer than this to the surface [steps].
inline constexpr float reached = 6.1f;
inline constexpr float papersBand = 2;  // "about 2 Delta away from the triangle mesh" (section 5.2)
inline constexpr float noLimit = 1e9f;

/// Errors by Eq. 4, and wrong signs. Lengths in steps.
struct Errors {
    double worst = 0, sum = 0;
    std::uint64_t nodes = 0, signs = 0;

    void add(double value, double truth) {
        worst = std::max(worst, std::abs(value - truth));
        sum += std::abs(value - truth);
        signs += (value < 0) != (truth < 0);
        ++nodes;
    }
    nlohmann::json toJson() const {
        return {{"worst", worst}, {"mean", sum / double(nodes)}, {"nodes", nodes}, {"signs", signs}};
    }
};

bool finite(float phi);

/// Over all nodes where both are finite and the true distance does not exceed the limit.
Errors errors(const DenseField& field, const DenseField& truth, float within);

/// The same over the active voxels of a field.
Errors errors(const LevelSet& field, const DenseField& truth);

}  // namespace bilayer::paper
