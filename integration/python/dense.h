// SPDX-License-Identifier: Apache-2.0
// Dense numpy arrays and level sets.
#pragma once

#include <pybind11/pybind11.h>

#include <bilayer/sdf/level_set.h>

namespace bilayer::python {

namespace py = pybind11;

/// A bilayer.results.Dense of the band's bounding box and `padding` voxels around it.
py::object toDense(const LevelSet& levelSet, int padding);

/// The level set of distances at the points origin + spacing * (i, j, k).
/// @param halfWidth    a width, an exterior and an interior one, or None for those that the values allow
/// @param fieldOrigin  LevelSet::origin()
/// Throws std::invalid_argument that names the argument, and the first voxel that is no distance.
LevelSet fromDense(const py::object& values, const py::object& origin, double spacing, const py::object& halfWidth,
                   const py::object& fieldOrigin);

}  // namespace bilayer::python
