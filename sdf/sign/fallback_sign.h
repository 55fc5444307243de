// The winding number of the whole mesh, for the rare voxel whose side the triangles near it leave open.
#pragma once

#include <glm/vec3.hpp>
#include <mutex>
#include <optional>

#include "sdf/bvh/winding_number.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Counts how a ray passes the triangles of a closed mesh; for other meshes, and where all rays come too close to edges
/// to tell, asks a hierarchy that is made when it is first needed, which for most meshes is never. Safe from any
/// thread.
class FallbackSign {
  public:
    /// Works from the job's mesh, and adds to its count of undecided voxels.
    explicit FallbackSign(const MeshJob& job)
        : mesh_(job.mesh),
          progress_(job.progress),
          asked_(job.undecided),
          reach_(double(job.reach) * double(job.voxelSize)) {}

    /// Whether a point is inside [m]. Throws Cancelled.
    bool isInside(const glm::dvec3& point);

  private:
    std::optional<int> windingByRay(const glm::dvec3& point, const glm::dvec3& way) const;

    const Mesh& mesh_;
    Progress& progress_;
    std::atomic<std::size_t>* asked_;
    double reach_;  // points asked for are no farther from the mesh [m]
    std::once_flag looked_, made_;
    bool closed_ = false;
    double beyond_ = 0;  // a way as long as this leaves the mesh [m]
    std::optional<WindingNumber> winding_;
};

}  // namespace bilayer::detail
