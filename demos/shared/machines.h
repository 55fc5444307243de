// Machine parts by formula, for bodies that fit into each other: threads, gears, pegs, poles, chains. The meshes are
// closed, oriented, free of self-intersections, and have well-shaped triangles. Lengths are in metres. Round outer
// surfaces are inscribed and round inner surfaces circumscribed, so that facets never reduce a clearance: it is the
// given one, or wider by at most the sagitta of a chord of each part. Invalid dimensions throw std::invalid_argument.
#pragma once

#include <vector>

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

/// A spur gear around z, from -faceWidth / 2 to faceWidth / 2, with involute flanks, addendum 1 and dedendum 1.25
/// modules (ISO 53), without root fillets. A tooth points along +x. Two gears of the same module and pressure angle
/// mesh if the distance of their axes is half the sum of their pitchDiameter().
struct Gear {
    /// At least 2 / sin^2(pressureAngle), 18 by default: fewer teeth would need an undercut.
    int teeth = 24;
    float toothModule = 2e-3f;            ///< pitch diameter divided by the count of teeth [m]
    float pressureAngle = 0.3490658504f;  ///< of the flanks at the pitch circle [rad]: 20 degrees by ISO 53
    /// The circumferential backlash of a pair of such gears: how much narrower teeth are than the spaces along the
    /// pitch circle [m]. The teeth of each gear are thinned by half of it. ISO/TR 10064-2 recommends 0.10 mm for steel
    /// of this module at an axis distance of 50 mm.
    float backlash = 0.1e-3f;
    float faceWidth = 10e-3f;  ///< [m]
    float bore = 12e-3f;       ///< diameter [m]
    float edge = 0.6e-3f;      ///< approximate edge length of the triangles; half of it along the flanks [m]

    float pitchDiameter() const { return float(teeth) * toothModule; }
};
Mesh gear(const Gear& part = {});

/// Returns the rotation angle at which a gear meshes with another one that is rotated by `angle`, centred in the
/// backlash [rad].
/// @param direction  direction from the other gear to this one [rad]
float meshingAngle(const Gear& gear, float angle, const Gear& mate, float direction = 0);

/// A round peg with 45 degree chamfers: around z, from -length / 2 to length / 2.
struct Peg {
    float diameter = 8e-3f;     ///< of the matching hole [m]
    float clearance = 0.1e-3f;  ///< diametral clearance: hole minus shaft, as in ISO 286-1 [m]
    float length = 50e-3f;      ///< [m]
    float chamfer = 0.5e-3f;    ///< [m]
    int segments = 96;          ///< edges per circle, a multiple of 24
};
Mesh peg(const Peg& part = {});

/// A square block with a round hole along z that has 45 degree chamfers; from -height / 2 to height / 2.
struct HoledBlock {
    float diameter = 8e-3f;   ///< of the hole [m]
    float width = 25e-3f;     ///< of its sides [m]
    float height = 25e-3f;    ///< [m]
    float floor = 5e-3f;      ///< thickness below the hole [m]; 0: a through hole
    float chamfer = 0.5e-3f;  ///< [m]
    int segments = 96;        ///< edges per circle, a multiple of 24
};
Mesh holedBlock(const HoledBlock& part = {});

/// A pole with a round top on a round foot: around z, from 0 to height.
struct Pole {
    float radius = 20e-3f;      ///< [m]
    float height = 400e-3f;     ///< including the foot [m]
    float footRadius = 80e-3f;  ///< [m]
    float footHeight = 10e-3f;  ///< [m]
    int segments = 48;          ///< edges per circle, a multiple of 24
};
Mesh pole(const Pole& part = {});

/// Returns the poses of the links of a chain that hangs from the origin along -z, the first link at the origin. A link
/// is a torus, as made by torus(major, minor). Each link is rotated by 90 degrees relative to the previous one.
/// @param slack  separation of neighbours [m]; at 0 they touch
/// Throws std::invalid_argument if neighbours are not linked.
std::vector<Pose> chain(int links, float major, float minor, float slack = 0);

}  // namespace bilayer::shapes
