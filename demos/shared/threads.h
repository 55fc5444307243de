// SPDX-License-Identifier: Apache-2.0
// Bolts and nuts by formula; meshes and clearances as in machines.h.
#pragma once

#include <bilayer/collider/pose.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::shapes {

/// A right-handed metric thread, M16 by default, with the basic profile of ISO 68-1. The flanks are at 60 degrees. Of
/// their sharp triangle of height H = sqrt(3)/2 pitch, H/8 is cut off at the crest of the bolt and H/4 at its root. The
/// flats are 1/8 and 1/4 of the pitch. ISO 261 lists the coarse pitches.
struct Thread {
    float diameter = 16e-3f;  ///< of the bolt's crests [m]
    float pitch = 2e-3f;      ///< advance per rotation [m]
    /// The distance of bolt and nut when the nut is centred in its play, equal on flanks, crests and roots [m]. The nut
    /// keeps the basic profile and the bolt's profile is offset inward, as in ISO 965-1 for H and g. In 6H/6g the
    /// flanks of M16 are 0.010 to 0.102 mm apart. The axial play is clearance / cos 30 degrees in either direction.
    float clearance = 50e-6f;
};

/// A screw with a hexagon head, ISO 4017 M16 x 60 by default. Its axis is z. The head's bearing face is at z = 0, the
/// head below and the shank above. In the half-plane of +x, crests are at multiples of the pitch.
struct Bolt {
    Thread thread{};
    float length = 60e-3f;  ///< from the bearing face to the tip [m]
    /// Length of the unthreaded shank next to the head [m]; the grooves reach full depth within one more pitch. The tip
    /// starts with a stub of the root's diameter. The stub is shorter than half a pitch unless `segments` are few, and
    /// the crests rise from it within their own height.
    float plain = 4e-3f;
    float acrossFlats = 24e-3f;  ///< of the head [m]
    float headHeight = 10e-3f;   ///< [m]
    int segments = 96;           ///< edges per circle, a multiple of 24
};
Mesh bolt(const Bolt& part = {});

/// A hexagon nut, ISO 4032 M16 by default: around z, from -height / 2 to height / 2, with its openings widened to 1.05
/// diameters.
struct Nut {
    Thread thread{};
    float acrossFlats = 24e-3f;  ///< [m]
    float height = 14.8e-3f;     ///< [m]
    int segments = 96;           ///< edges per circle, a multiple of 24
};
Mesh nut(const Nut& part = {});

/// Returns the pose of a nut relative to its bolt, centred in its play, with its centre at `height` [m].
Pose onThread(const Thread& thread, float height);

}  // namespace bilayer::shapes
