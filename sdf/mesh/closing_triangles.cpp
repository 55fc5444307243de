// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/closing_triangles.h"

#include <cstddef>
#include <utility>

#include "sdf/base/progress.h"
#include "sdf/mesh/boundary_loops.h"

namespace bilayer::detail {
namespace {

void close(BoundaryLoops::Loop loop, std::vector<glm::uvec3>& triangles) {
    while (loop.size() > 2) {
        std::size_t kept = 0;
        const std::size_t n = loop.size();
        const unsigned first = loop[0];
        for (std::size_t i = 0; i < n; i += 2) {
            const unsigned corner = loop[i];
            if (i + 2 <= n) triangles.emplace_back(corner, loop[i + 1], i + 2 < n ? loop[i + 2] : first);
            loop[kept++] = corner;
        }
        loop.resize(kept);
    }
}

}  // namespace

std::vector<glm::uvec3> closingTriangles(const Mesh& mesh, Progress* progress) {
    std::vector<glm::uvec3> triangles;
    const auto last = [](const auto&, const BoundaryLoops::Loop& ends) { return ends.size() - 1; };
    for (BoundaryLoops::Loop& loop : BoundaryLoops(mesh, progress).takeLoops(last)) {
        poll(progress);
        close(std::move(loop), triangles);
    }
    return triangles;
}

}  // namespace bilayer::detail
