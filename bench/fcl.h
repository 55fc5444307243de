// SPDX-License-Identifier: Apache-2.0
// The distance of two meshes by FCL (https://github.com/flexible-collision-library/fcl).
#pragma once

#include <memory>

#include <bilayer/collider/pose.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::bench {

/// A mesh with FCL's hierarchy of oriented boxes and swept rectangles in double precision, its own default.
class FclMesh {
  public:
    explicit FclMesh(const Mesh& mesh);
    ~FclMesh();
    FclMesh(FclMesh&&) noexcept;

    /// The distance to another mesh, 0 or less where they intersect [m].
    double distanceTo(const FclMesh& other, const Pose& pose, const Pose& poseOther) const;

  private:
    struct Data;
    std::unique_ptr<Data> data_;
};

}  // namespace bilayer::bench
