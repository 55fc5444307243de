// A liquid with a free surface in a box, around a solid body: a small solver on OpenVDB's own tools. The surface is a
// level set that LevelSetAdvection carries, velocities stand at the faces of cells and are carried by VolumeAdvection,
// and the pressure is found by OpenVDB's conjugate gradients (pressure.h).
#pragma once

#include <openvdb/openvdb.h>

#include <glm/vec3.hpp>

#include "demos/shared/basin.h"
#include "demos/shared/face_velocity.h"
#include "demos/shared/pressure.h"

namespace bilayer::demo {

struct WaterOptions {
    glm::vec3 gravity{0, 0, -9.81f};  ///< [m/s^2]
    /// What is lost where the liquid is thinner than its voxels comes back in this time, evenly from all of it, as a
    /// divergence (B. Kim, Y. Liu, I. Llamas, X. Jiao, J. Rossignac, "Simulation of bubbles in foam with the volume
    /// control method", 2007) [s]; 0: never.
    float restoring = 0.1f;
    double volume = 0;  ///< to be kept [m^3]; 0: that of the start
};

class Water {
  public:
    /// @param surface  a level set; behind the basin's walls and in its body it may be anything
    Water(const openvdb::FloatGrid& surface, const Basin& basin, const WaterOptions& options = {});

    /// One step. The basin's body is where it will be at its end.
    Projection step(const Basin& basin, float seconds);

    /// What of the liquid is in the box and not in the body, as a level set.
    const openvdb::FloatGrid& shape() const { return *shape_; }
    double volume() const { return volume_; }        ///< within the shape's surface, as a mesh [m^3]
    double kept() const { return options_.volume; }  ///< the volume that is restored [m^3]
    double restored() const { return restored_; }    ///< volume given back so far, taken away being negative [m^3]
    /// The fastest of the liquid's faces [m/s].
    float fastest() const { return velocity_.fastest(); }

  private:
    void carrySurface(float seconds);
    double growth() const;
    void measure(const Basin& basin);

    WaterOptions options_;
    openvdb::FloatGrid::Ptr surface_, shape_;
    FaceVelocity velocity_;
    Pressure pressure_;
    double volume_ = 0, restored_ = 0;
};

}  // namespace bilayer::demo
