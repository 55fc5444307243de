// Where a field's samples are off from its mesh: at edges, in grooves, and wherever the surface bends within a voxel.
#pragma once

#include <atomic>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>

#include <bilayer/collider/field.h>

namespace bilayer::detail {

/// The cells of a field's band, the corners of which are eight neighbouring voxels, where its interpolant is off from
/// the mesh by more than a tenth of a voxel in one of 27 places: elsewhere it may be off by little more. A cell is
/// measured when it is first asked for, which takes some microseconds; the answer depends on nothing but the cell.
/// Copies share what they know. Safe from any thread.
class InterpolationErrorMask {
  public:
    InterpolationErrorMask() = default;  ///< none

    /// Of a field with its mesh. Takes 128 bytes a stored block.
    explicit InterpolationErrorMask(const Field& field);

    /// Whether a point is in such a cell, in the field's coordinates [m].
    bool hold(const glm::vec3& point) const noexcept;

  private:
    bool areAt(const glm::ivec3& cell) const noexcept;
    bool isOff(const glm::dvec3& local) const noexcept;

    std::shared_ptr<const Field> field_;
    std::shared_ptr<std::atomic<std::uint64_t>[]> known_;  ///< of each stored block's cells, two bits each
};

}  // namespace bilayer::detail
