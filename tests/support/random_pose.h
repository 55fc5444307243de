// SPDX-License-Identifier: Apache-2.0
// Random poses.
#pragma once

#include <glm/gtc/quaternion.hpp>

#include <bilayer/collider/pose.h>
#include "tests/support/random.h"

namespace bilayer::test {

inline glm::quat randomRotation(Random& random) {
    return glm::angleAxis(float(random(0, 6.28)), random.direction());
}

/// A position in the cube of half size `reach` around the origin, with any rotation.
inline Pose randomPose(Random& random, double reach) {
    return {random.point(reach), randomRotation(random)};
}

/// A position at a distance from the origin, with any rotation.
inline Pose randomPoseAt(Random& random, double distance) {
    return {float(distance) * random.direction(), randomRotation(random)};
}

}  // namespace bilayer::test
