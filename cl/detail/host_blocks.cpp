// SPDX-License-Identifier: Apache-2.0
#include "cl/detail/host_blocks.h"

#include <algorithm>
#include <tuple>

#include "sdf/fill/exact.h"

namespace bilayer::detail {

void fillOnHost(const FillJob& job, std::vector<glm::ivec3> blocks) {
    const auto before = [](const glm::ivec3& a, const glm::ivec3& b) {
        return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
    };
    std::sort(blocks.begin(), blocks.end(), before);
    MeshJob mesh = job.input;
    mesh.wanted = [&](const glm::ivec3& first, int side) {
        if (side == blockSide) return std::binary_search(blocks.begin(), blocks.end(), first, before);
        return std::any_of(blocks.begin(), blocks.end(), [&](const glm::ivec3& block) {
            const glm::ivec3 offset = block - first;
            return std::min({offset.x, offset.y, offset.z}) >= 0 && std::max({offset.x, offset.y, offset.z}) < side;
        });
    };
    fillExact(mesh, job.box);
}

}  // namespace bilayer::detail
