// SPDX-License-Identifier: Apache-2.0
// Spur gears by formula; meshes and clearances as in machines.h.
#pragma once

#include <bilayer/sdf/mesh.h>

namespace bilayer::shapes {

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

}  // namespace bilayer::shapes
