// SPDX-License-Identifier: Apache-2.0
// A chain of linked rings with a heavy ring at its end. Contacts alone carry the load: one missed contact lets the rest
// fall. After Z. Ferguson and others, "Intersection-free rigid body dynamics", ACM TOG 40 (2021).
#pragma once

#include <bilayer/collider/pose.h>
#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct ChainOptions {
    int links = 101;  ///< the first link is static
    float bob = 10;   ///< mass of the last one [links]
    float push = 1;   ///< initial horizontal speed of the last link [m/s]
    float seconds = 10;
    float stepsPerSecond = 240;
    int iterations = 50;       ///< of Bullet's solver: an impulse travels about one link per iteration
    float voxelSize = 0.005f;  ///< [m]
};

/// Criteria: the Gauss linking number of neighbours does not change in any frame. The chain stretches by less than 2 %
/// beyond links that hang in each other surface on surface.
Outcome chain(const ChainOptions& options);

/// Returns the linking number of two circles of given radii [m], each around the z axis of its pose, by Gauss's
/// integral. Accurate to 1e-3 if the distance of the circles is at least a tenth of the radius. The sign depends on the
/// orientations of the circles.
double gaussLinkingNumber(const Pose& a, double radiusA, const Pose& b, double radiusB);

}  // namespace bilayer::demo
