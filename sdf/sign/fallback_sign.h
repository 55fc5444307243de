// SPDX-License-Identifier: Apache-2.0
// Fallback sign test for the rare voxels that nearby triangles leave undecided: the winding number of the whole mesh.
#pragma once

#include <atomic>
#include <glm/vec3.hpp>
#include <mutex>
#include <optional>

#include "sdf/bvh/winding_number.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Counts the signed crossings of a ray through a closed mesh. For other meshes, after many points, and if all rays
/// pass too close to edges, evaluates the winding number with a hierarchy. The hierarchy is built on first use, which
/// most meshes never need. Thread-safe.
class FallbackSign {
  public:
    /// Uses the job's mesh, and adds to its count of undecided voxels.
    explicit FallbackSign(const MeshJob& job)
        : mesh_(job.mesh),
          progress_(job.progress),
          asked_(job.undecided),
          isPart_(job.isPart),
          reach_(double(job.reach) * double(job.voxelSize)) {}

    /// Returns whether a point is inside [m]. Throws Cancelled, and std::invalid_argument for a part of a mesh.
    bool isInside(const glm::dvec3& point);

  private:
    std::optional<int> windingByRay(const glm::dvec3& point, const glm::dvec3& end) const;

    const Mesh& mesh_;
    Progress& progress_;
    std::atomic<std::size_t>* asked_;
    bool isPart_;
    double reach_;  // maximum distance of queried points from the mesh [m]
    std::once_flag looked_, made_;
    bool closed_ = false;
    std::atomic<int> byRays_ = 0;  // points so far
    double beyond_ = 0;            // length of a ray that leaves the mesh for certain [m]
    std::optional<WindingNumber> winding_;
};

}  // namespace bilayer::detail
