// SPDX-License-Identifier: Apache-2.0
// Checks of samples of a field, shared by CPU and devices.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include <bilayer/collider/query.h>
#include <bilayer/sdf/level_set.h>
#include "tests/support/analytic.h"

namespace bilayer::test {

/// Samples points of one field.
using Sampler = std::function<std::vector<Sample>(std::span<const glm::vec3>)>;
/// Makes the sampler of a level set.
using MakeSampler = std::function<Sampler(const LevelSet&)>;

/// A sphere, a box and a torus in the cube of half size 0.5.
std::vector<Solid> smallSolids();

// Each check has the name of a test case in tests/collider/field.cpp.
void checkInBand(const MakeSampler& make);
void checkVoxelCentres(const MakeSampler& make);
void checkBeyondBand(const MakeSampler& make);
void checkEmptyBlocks(const MakeSampler& make);
void checkNarrowBand(const MakeSampler& make);
void checkNowhere(const MakeSampler& make);
void checkFarFromOrigin(const MakeSampler& make);
void checkOtherLevelSets(const MakeSampler& make);

}  // namespace bilayer::test
