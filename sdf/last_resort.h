// The winding number of the whole mesh, for the rare voxel whose side the triangles near it leave open.
#pragma once

#include <oneapi/tbb/task_arena.h>

#include <glm/vec3.hpp>
#include <mutex>
#include <optional>

#include "sdf/blocks.h"
#include "sdf/winding.h"

namespace bilayer {

/// Makes the hierarchy for winding numbers when it is first asked, which for most meshes is never. Safe from any
/// thread.
class LastResort {
  public:
    /// Works from the job's mesh, and adds to its count of undecided voxels.
    explicit LastResort(const MeshJob& job) : mesh_(job.mesh), progress_(job.progress), asked_(job.undecided) {}

    /// Whether a point is inside [m].
    bool isInside(const glm::dvec3& point) {
        if (asked_) ++*asked_;
        // isolated: a thread that waits for the tree must not be given a task that would wait for it too
        std::call_once(made_, [&] { tbb::this_task_arena::isolate([&] { winding_.emplace(mesh_, &progress_); }); });
        return (*winding_)(point) > 0.5;
    }

  private:
    const Mesh& mesh_;
    Progress& progress_;
    std::atomic<std::size_t>* asked_;
    std::once_flag made_;
    std::optional<WindingNumber> winding_;
};

}  // namespace bilayer
