// SPDX-License-Identifier: Apache-2.0
// The container of a liquid: a closed box whose walls are cell faces, with a solid body of any shape inside.
#pragma once

#include <openvdb/openvdb.h>

#include <bilayer/integration/fluid/obstacle.h>
#include "demos/shared/face_velocity.h"

namespace bilayer::demo {

class Basin {
  public:
    /// @param cells     the liquid's voxels
    /// @param size      along each axis [cells]; cells 0 to size - 1 are inside the box
    Basin(const openvdb::math::Transform& cells, const openvdb::Coord& size);

    /// Replaces the body in the box. Its half width must be at least 5 voxels.
    void place(const fluid::Solid& solid);

    const openvdb::CoordBBox& box() const { return box_; }
    /// Returns the fraction of each face that is open to liquid, 0..1; staggered, 0 outside the box.
    const openvdb::Vec3SGrid& open() const { return *open_; }
    /// Returns the body's velocity across each face in its band, except for faces in the box's walls, which have 0
    /// [m/s]; staggered.
    const openvdb::Vec3SGrid& bodyVelocity() const { return *solid_.velocity; }

    /// Extends a level set behind the walls by mirroring, and into the body's skin by its slope outside. Liquid that
    /// touches a wall then has no surface there.
    void extendBehindWalls(openvdb::FloatGrid& liquid) const;
    /// Extends the liquid's velocity in the same way, so that no liquid crosses the walls. Behind the box's walls the
    /// normal component is reversed. In the body it is the body's own.
    void extendBehindWalls(FaceVelocity& velocity) const;

    /// Returns the part of a level set that is inside the box and outside the body.
    openvdb::FloatGrid::Ptr inside(const openvdb::FloatGrid& liquid) const;

  private:
    openvdb::Vec3SGrid::Ptr nextToWalls(const openvdb::Vec3SGrid& bodyVelocity) const;
    void extendInBody(openvdb::FloatGrid& liquid, const openvdb::FloatGrid& before) const;
    void slideAlongBody(FaceVelocity& velocity) const;

    openvdb::CoordBBox box_;
    openvdb::FloatGrid::Ptr room_;          // the box as a level set
    openvdb::Vec3SGrid::Ptr empty_, open_;  // open faces without the body, and with it
    fluid::Solid solid_;
};

}  // namespace bilayer::demo
