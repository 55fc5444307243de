// SPDX-License-Identifier: Apache-2.0
// Shapes with right angles and random sizes: the commonest shapes whose faces, edges and corners lie in the lattice.
// Tested by tests/fluid/repair.cpp.
#pragma once

#include <random>
#include <span>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::test {

/// The cross section of a prism: rows of cells that letters fill or leave out.
struct Profile {
    std::string name;
    std::vector<std::string> rows;
};

/// Box, prism, stairs, cross, plate, rod and L.
std::span<const Profile> profiles();

/// A prism with steps of random lengths from 1.5 to 12 voxels, in half of all cases whole numbers of voxels. Plates are
/// thin along one axis, rods along two.
/// @param voxel  [m]
Mesh prismOf(const Profile& profile, std::mt19937& random, double voxel);

}  // namespace bilayer::test
