// What a liquid stands in: a closed box whose walls are faces of cells, and a solid body of any shape within.
#pragma once

#include <openvdb/openvdb.h>

#include <bilayer/integration/fluid/obstacle.h>
#include "demos/shared/face_velocity.h"

namespace bilayer::demo {

class Basin {
  public:
    /// @param cells     the liquid's voxels
    /// @param size      along each axis [cells]: those from 0 to size - 1 are in the box
    Basin(const openvdb::math::Transform& cells, const openvdb::Coord& size);

    /// Puts a body into the box in place of the last one. Its half width must be 5 voxels at least.
    void place(const fluid::Solid& solid);

    const openvdb::CoordBBox& box() const { return box_; }
    /// The part of each face that liquid can cross, 0..1; staggered, 0 outside the box.
    const openvdb::Vec3SGrid& open() const { return *open_; }
    /// Of the body across each face in its band and not in the box's walls, else 0 [m/s]; staggered.
    const openvdb::Vec3SGrid& bodyVelocity() const { return *solid_.velocity; }

    /// Lets a level set go on behind walls as if these were mirrors, and in the body's skin by its slope outside, so
    /// that what lies at a wall has no surface there.
    void continueBehindWalls(openvdb::FloatGrid& liquid) const;
    /// The same for its velocity, which then neither enters nor leaves: the part along a normal is turned around behind
    /// the box's walls, and is the body's own in the body.
    void continueBehindWalls(FaceVelocity& velocity) const;

    /// What of a level set is in the box and not in the body.
    openvdb::FloatGrid::Ptr inside(const openvdb::FloatGrid& liquid) const;

  private:
    openvdb::Vec3SGrid::Ptr besideWalls(const openvdb::Vec3SGrid& bodyVelocity) const;
    void continueInBody(openvdb::FloatGrid& liquid, const openvdb::FloatGrid& before) const;
    void slideAlongBody(FaceVelocity& velocity) const;

    openvdb::CoordBBox box_;
    openvdb::FloatGrid::Ptr room_;          // the box as a level set
    openvdb::Vec3SGrid::Ptr empty_, open_;  // open faces without and with the body
    fluid::Solid solid_;
};

}  // namespace bilayer::demo
