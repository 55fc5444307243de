// SPDX-License-Identifier: Apache-2.0
// A minimal user of the sources, added by add_subdirectory or FetchContent: a cube, its field, its surface.
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/surface.h>

int main() {
    bilayer::Mesh cube;
    for (int i = 0; i < 8; ++i) cube.points.push_back({i & 1, i >> 1 & 1, i >> 2});
    cube.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                      {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    const bilayer::LevelSet field = bilayer::build(cube, {.voxelSize = 0.1f});
    return field.sign() == "normals" && !bilayer::surface(field).triangles.empty() ? 0 : 1;
}
