// SPDX-License-Identifier: Apache-2.0
// Where a field's samples are inaccurate: at edges, in grooves, and wherever the surface bends within a voxel.
#pragma once

#include <atomic>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>

#include <bilayer/collider/field.h>

namespace bilayer::detail {

/// Marks the cells of a field's band where the interpolant is off from the mesh by more than a tenth of a voxel. A cell
/// has eight neighbouring voxels as its corners, and is tested at 27 places; between them the error may be slightly
/// larger. A cell is tested at its first query, which takes a few microseconds; the result depends only on the cell.
/// Copies share the results. Safe from any thread.
class InterpolationErrorMask {
  public:
    InterpolationErrorMask() = default;  ///< marks no cell

    /// The mask of a field with its mesh. Takes 128 bytes per stored block.
    explicit InterpolationErrorMask(const Field& field);

    /// Whether a point, in field coordinates [m], is in a marked cell.
    bool isMarked(const glm::vec3& point) const noexcept;

  private:
    bool exceedsTolerance(const glm::ivec3& cell) const noexcept;
    bool isOff(const glm::dvec3& local) const noexcept;

    std::shared_ptr<const Field> field_;
    std::shared_ptr<std::atomic<std::uint64_t>[]> known_;  ///< two bits per cell of each stored block
};

}  // namespace bilayer::detail
