// Lower bounds of the distance to a field's surface where samples are outside the band. Negative inside. Points are in
// voxels from the directory's first voxel, bounds in metres.
#pragma once

#include <glm/vec3.hpp>

#include "collider/field/field_data.h"

namespace bilayer::detail {

/// For a point outside the directory's box.
float boundOutside(const FieldData& field, const glm::dvec3& local);

/// For a point in a block that is entirely outside the band.
float boundInEmptyBlock(const FieldData& field, bool inside, const glm::dvec3& local);

/// For a point in a cell that is partly outside the band, with the interpolated distance there [m].
float boundNextToBand(const FieldData& field, float distance, const glm::dvec3& local);

}  // namespace bilayer::detail
