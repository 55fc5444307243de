// SPDX-License-Identifier: Apache-2.0
// Searches that divide cubes of space into octants, many cubes at once.
// Tested by tests/sdf/hole_width.cpp through widestHole().
#pragma once

#include <oneapi/tbb/parallel_for.h>

#include <cstddef>
#include <vector>

namespace bilayer::detail {

/// Count of cubes that such a search divides at once. It does not depend on the number of threads, so that results do
/// not either.
inline constexpr std::size_t cubesAtOnce = 64;

/// Returns divide(cube), a std::vector of parts, of all cubes in their order. Divides in parallel.
template <class Cube, class Divide>
std::vector<Cube> divided(const std::vector<Cube>& cubes, const Divide& divide) {
    std::vector<std::vector<Cube>> parts(cubes.size());
    tbb::parallel_for(std::size_t(0), cubes.size(), [&](std::size_t i) { parts[i] = divide(cubes[i]); });
    std::vector<Cube> all;
    for (const std::vector<Cube>& some : parts) all.insert(all.end(), some.begin(), some.end());
    return all;
}

}  // namespace bilayer::detail
