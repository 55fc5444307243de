// SPDX-License-Identifier: Apache-2.0
#include "tests/support/cells.h"

#include <glm/vec3.hpp>

namespace bilayer::test {

Mesh solidOf(const Planes& planes, const std::function<bool(const glm::ivec3& cell)>& filled) {
    const glm::ivec3 cells(planes[0].size() - 1, planes[1].size() - 1, planes[2].size() - 1);
    const auto isFilled = [&](const glm::ivec3& c) {
        for (int axis = 0; axis < 3; ++axis)
            if (c[axis] < 0 || c[axis] >= cells[axis]) return false;
        return filled(c);
    };
    Mesh mesh;
    const auto addFace = [&](const glm::ivec3& cell, int axis, int side) {
        // corners counter-clockwise seen from along the axis; clockwise for the lower side
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const auto first = unsigned(mesh.points.size());
        for (int corner = 0; corner < 4; ++corner) {
            glm::ivec3 at = cell;
            at[axis] += side;
            at[u] += corner == 1 || corner == 2;
            at[v] += corner >= 2;
            mesh.points.emplace_back(planes[0][std::size_t(at.x)], planes[1][std::size_t(at.y)],
                                     planes[2][std::size_t(at.z)]);
        }
        const std::array<glm::uvec3, 2> upper{glm::uvec3(0, 1, 2), glm::uvec3(0, 2, 3)};
        for (const glm::uvec3& t : upper) mesh.triangles.push_back(first + (side ? t : glm::uvec3(t.x, t.z, t.y)));
    };
    glm::ivec3 cell;
    for (cell.x = 0; cell.x < cells.x; ++cell.x)
        for (cell.y = 0; cell.y < cells.y; ++cell.y)
            for (cell.z = 0; cell.z < cells.z; ++cell.z)
                for (int axis = 0; axis < 3 && isFilled(cell); ++axis)
                    for (const int side : {0, 1}) {
                        glm::ivec3 beside = cell;
                        beside[axis] += side ? 1 : -1;
                        if (!isFilled(beside)) addFace(cell, axis, side);
                    }
    return mesh;
}

}  // namespace bilayer::test
