// Machine parts by formula, for bodies that fit into each other: threads, gears, pegs, poles, chains. Closed, oriented,
// free of self-intersections, of well-shaped triangles; lengths in metres. Round outsides are inscribed and round
// insides circumscribed, so that facets never eat into a clearance: between two parts it is what was asked for, or
// wider by no more than the sagitta of a chord of each. Wrong dimensions throw std::invalid_argument.
#pragma once

#include <vector>

#include <bilayer/collider/pose.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::shapes {

/// A right-handed metric thread, M16 by default. Its basic profile is that of ISO 68-1: flanks at 60 degrees, of whose
/// sharp triangle of height H = sqrt(3)/2 pitch an eighth is cut off at the crest of the bolt and a quarter at its
/// root; the flats are an eighth and a quarter of the pitch. Coarse pitches are listed in ISO 261.
struct Thread {
    float diameter = 16e-3f;  ///< of the bolt's crests [m]
    float pitch = 2e-3f;      ///< the advance of one turn [m]
    /// The distance of bolt and nut where the nut stands in the middle of its play, the same on flanks, crests and
    /// roots [m]. The nut keeps the basic profile and the bolt's is drawn in, as ISO 965-1 has it for H and g. In 6H/6g
    /// the flanks of M16 are 0.010 to 0.102 mm apart. Along the axis it plays by clearance / cos 30 degrees
    /// either way.
    float clearance = 50e-6f;
};

/// A screw with a hexagon head, ISO 4017 M16 x 60 by default. Around z: the head's bearing face lies at 0, the head
/// below, the shank above. Above the x axis crests lie at multiples of the pitch.
struct Bolt {
    Thread thread{};
    float length = 60e-3f;  ///< from the bearing face to the tip [m]
    /// Of the shank next to the head that carries no thread [m]; the grooves become deep within one pitch more. The tip
    /// begins with a stub as thin as the root, less than half a pitch long unless `segments` are few, from which the
    /// crests rise within their own height.
    float plain = 4e-3f;
    float acrossFlats = 24e-3f;  ///< of the head [m]
    float headHeight = 10e-3f;   ///< [m]
    int segments = 96;           ///< edges around, a multiple of 24
};
Mesh bolt(const Bolt& part = {});

/// A hexagon nut, ISO 4032 M16 by default: around z, from -height / 2 to height / 2, the mouths widened to 1.05
/// diameters.
struct Nut {
    Thread thread{};
    float acrossFlats = 24e-3f;  ///< [m]
    float height = 14.8e-3f;     ///< [m]
    int segments = 96;           ///< edges around, a multiple of 24
};
Mesh nut(const Nut& part = {});

/// Where a nut is in the middle of its play, seen from its bolt, with its own centre at `height` [m].
Pose onThread(const Thread& thread, float height);

/// A spur gear around z, from -faceWidth / 2 to faceWidth / 2: involute flanks, addendum 1 and dedendum 1.25 modules
/// (ISO 53), no fillet at the root. A tooth points along +x. Two gears of the same module and pressure angle mesh at
/// the distance of half the sum of their pitchDiameter().
struct Gear {
    /// At least 2 / sin^2(pressureAngle), 18 by default: those of fewer teeth would need an undercut.
    int teeth = 24;
    float toothModule = 2e-3f;            ///< the pitch diameter by the number of teeth [m]
    float pressureAngle = 0.3490658504f;  ///< of the flanks at the pitch circle [rad]: 20 degrees by ISO 53
    /// By how much the teeth of a pair of such gears are narrower than the gaps, along the pitch circle; each gear's
    /// are thinned by half [m]. ISO/TR 10064-2 recommends 0.10 mm for steel of this module at a distance of 50 mm.
    float backlash = 0.1e-3f;
    float faceWidth = 10e-3f;  ///< [m]
    float bore = 12e-3f;       ///< diameter [m]
    float edge = 0.6e-3f;      ///< about the length of the triangles' edges; along the flanks half of it [m]

    float pitchDiameter() const { return float(teeth) * toothModule; }
};
Mesh gear(const Gear& part = {});

/// The angle that a gear must be turned by to mesh with one that is turned by `angle`, in the middle of the backlash
/// [rad].
/// @param direction  in which it lies, seen from the other [rad]
float meshingAngle(const Gear& gear, float angle, const Gear& mate, float direction = 0);

/// A round peg with 45 degree chamfers: around z, from -length / 2 to length / 2.
struct Peg {
    float diameter = 8e-3f;     ///< of the hole that it is made for [m]
    float clearance = 0.1e-3f;  ///< by which it is thinner: hole less shaft, as ISO 286-1 defines it [m]
    float length = 50e-3f;      ///< [m]
    float chamfer = 0.5e-3f;    ///< [m]
    int segments = 96;          ///< edges around, a multiple of 24
};
Mesh peg(const Peg& part = {});

/// A square block with a round hole along z, its mouths chamfered by 45 degrees; from -height / 2 to height / 2.
struct HoledBlock {
    float diameter = 8e-3f;   ///< of the hole [m]
    float width = 25e-3f;     ///< of its sides [m]
    float height = 25e-3f;    ///< [m]
    float floor = 5e-3f;      ///< thickness below the hole [m]; 0: the hole goes through
    float chamfer = 0.5e-3f;  ///< [m]
    int segments = 96;        ///< edges around, a multiple of 24
};
Mesh holedBlock(const HoledBlock& part = {});

/// A pole with a round top on a round foot: around z, from 0 to height.
struct Pole {
    float radius = 20e-3f;      ///< [m]
    float height = 400e-3f;     ///< with the foot [m]
    float footRadius = 80e-3f;  ///< [m]
    float footHeight = 10e-3f;  ///< [m]
    int segments = 48;          ///< edges around, a multiple of 24
};
Mesh pole(const Pole& part = {});

/// Where the links of a chain are that hangs from the origin along -z, the first at the origin. A link is a torus, as
/// torus(major, minor) makes it; each is turned by 90 degrees against the one before.
/// @param slack  the gap between neighbours [m]; at 0 they touch
/// Throws std::invalid_argument if neighbours are not linked.
std::vector<Pose> chain(int links, float major, float minor, float slack = 0);

}  // namespace bilayer::shapes
