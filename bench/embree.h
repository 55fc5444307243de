// SPDX-License-Identifier: Apache-2.0
// Embree on the triangles of a mesh: the exact peer for closest points and rays.
#pragma once

#include <memory>

#include <bilayer/sdf/mesh.h>
#include "bench/peers.h"

namespace bilayer::bench {

class Embree {
  public:
    /// @param robust  rays miss no edge between triangles, but are slower
    Embree(const Mesh& mesh, bool robust);

    /// rtcPointQuery: the closest point of the mesh. The distance is unsigned; there is no normal.
    /// @param radius  search radius [m], may be infinite
    Closest closest(const std::string& name, float radius) const;

    /// rtcIntersect1: the first triangle along a ray, two-sided.
    RayCaster rays() const;

  private:
    struct Scene;
    std::shared_ptr<const Scene> scene_;
};

}  // namespace bilayer::bench
