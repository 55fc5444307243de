// SPDX-License-Identifier: Apache-2.0
// A liquid with a free surface in a box, around a solid body: a small solver on OpenVDB's tools. LevelSetAdvection
// advects the surface, which is a level set. VolumeAdvection advects the velocities, which are stored at cell faces.
// OpenVDB's conjugate gradients solve for the pressure (pressure.h).
#pragma once

#include <openvdb/openvdb.h>

#include <glm/vec3.hpp>

#include "demos/shared/basin.h"
#include "demos/shared/face_velocity.h"
#include "demos/shared/pressure.h"

namespace bilayer::demo {

struct WaterOptions {
    glm::vec3 gravity{0, 0, -9.81f};  ///< [m/s^2]
    /// Time constant for restoring lost volume [s]; 0: never. Volume is lost where the liquid is thinner than its
    /// voxels. It is restored as a uniform divergence of all liquid (B. Kim, Y. Liu, I. Llamas, X. Jiao, J. Rossignac,
    /// "Simulation of bubbles in foam with the volume control method", 2007).
    float restoring = 0.1f;
    double volume = 0;  ///< target volume [m^3]; 0: the initial volume
};

class Water {
  public:
    /// @param surface  a level set; its values behind the basin's walls and in its body do not matter
    Water(const openvdb::FloatGrid& surface, const Basin& basin, const WaterOptions& options = {});

    /// Advances one step. The basin's body must be at its pose at the end of the step.
    Projection step(const Basin& basin, float seconds);

    /// Returns the part of the liquid that is inside the box and outside the body, as a level set.
    const openvdb::FloatGrid& shape() const { return *shape_; }
    double volume() const { return volume_; }  ///< enclosed by the surface of shape(), computed from a mesh [m^3]
    double targetVolume() const { return options_.volume; }  ///< the target volume [m^3]
    double restored() const { return restored_; }  ///< volume restored so far; removed volume counts as negative [m^3]
    /// Returns the max speed of the liquid's faces [m/s].
    float fastest() const { return velocity_.fastest(); }

  private:
    void advectSurface(float seconds);
    double growth() const;
    void measure(const Basin& basin);

    WaterOptions options_;
    openvdb::FloatGrid::Ptr surface_, shape_;
    FaceVelocity velocity_;
    Pressure pressure_;
    double volume_ = 0, restored_ = 0;
};

}  // namespace bilayer::demo
