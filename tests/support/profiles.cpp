// SPDX-License-Identifier: Apache-2.0
#include "tests/support/profiles.h"

#include <array>
#include <cmath>

#include "tests/support/cells.h"

namespace bilayer::test {

std::span<const Profile> profiles() {
    static const std::vector<Profile> all{{"box", {"#"}},
                                          {"prism", {"#.#", "###"}},
                                          {"stairs", {"#...", "##..", "###.", "####"}},
                                          {"cross", {".#.", "###", ".#."}},
                                          {"plate", {"#"}},
                                          {"rod", {"#"}},
                                          {"L", {"#.", "##"}}};
    return all;
}

Mesh prismOf(const Profile& profile, std::mt19937& random, double voxel) {
    std::uniform_real_distribution<double> any(2, 12), thin(1.5, 3);
    const bool whole = random() % 2;  // whole numbers of voxels, as in CAD models
    const auto step = [&](int axis) {
        const bool isThin = (profile.name == "plate" && axis == 0) || (profile.name == "rod" && axis < 2);
        const double voxels = isThin ? thin(random) : any(random);
        return (whole ? std::round(voxels) : voxels) * voxel;
    };
    Planes planes;
    const std::array<std::size_t, 3> counts{profile.rows[0].size(), profile.rows.size(), 1};
    for (int axis = 0; axis < 3; ++axis) {
        double at = 0;
        for (std::size_t i = 0; i <= counts[std::size_t(axis)]; ++i, at += step(axis))
            planes[std::size_t(axis)].push_back(float(at));
    }
    return solidOf(
        planes, [&](const glm::ivec3& cell) { return profile.rows[std::size_t(cell.y)][std::size_t(cell.x)] == '#'; });
}

}  // namespace bilayer::test
