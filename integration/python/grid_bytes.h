// SPDX-License-Identifier: Apache-2.0
// OpenVDB grids as bytes, for pickles.
#pragma once

#include <pybind11/pybind11.h>

#include "sdf/base/openvdb.h"

namespace bilayer::python {

namespace py = pybind11;

/// The grids as they are in memory. Files hold those of a level set shifted by its origin.
py::bytes bytesOf(const openvdb::GridCPtrVec& grids);

/// Throws what OpenVDB throws for bytes that are no grids.
openvdb::GridPtrVec gridsOf(const py::bytes& bytes);

}  // namespace bilayer::python
