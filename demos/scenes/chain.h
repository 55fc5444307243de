// A chain of rings that hang in each other, a heavy ring at its end: contact alone carries everything, and any link
// that is missed once lets the rest fall. After Z. Ferguson and others, "Intersection-free rigid body dynamics", ACM
// TOG 40 (2021).
#pragma once

#include <bilayer/collider/pose.h>
#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct ChainOptions {
    int links = 101;  ///< the first one does not move
    float bob = 10;   ///< mass of the last one [links]
    float push = 1;   ///< speed of the last one at the start, sideways [m/s]
    float seconds = 10;
    float stepsPerSecond = 240;
    int iterations = 50;       ///< of Bullet's solver: an impulse travels about one link in each
    float voxelSize = 0.005f;  ///< [m]
};

/// Criteria: the Gauss linking number of neighbours stays as it was in every frame; the chain gets less than 2 % longer
/// than links that hang in each other surface on surface.
Outcome chain(const ChainOptions& options);

/// How often two circles of a radius [m], each around the z axis of its pose, are linked: the integral of Gauss, to
/// 1e-3 where they pass each other at a tenth of the radius at least; its sign depends on the sense in which they run.
double gaussLinkingNumber(const Pose& a, double radiusA, const Pose& b, double radiusB);

}  // namespace bilayer::demo
