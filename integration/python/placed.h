// SPDX-License-Identifier: Apache-2.0
// Posed bodies as arguments.
#pragma once

#include <pybind11/pybind11.h>

#include <bilayer/collider/contact.h>

#include "integration/python/objects.h"

namespace bilayer::python {

namespace py = pybind11;

/// A body from the arguments NAME, a Collider or a Shape, and pose_NAME, scale_NAME and motion_NAME, where NAME is "a"
/// or "b".
/// @param motion  a displacement and a rotation vector, shape (2, 3), or None
/// Throws std::invalid_argument that names the argument.
PlacedShape placed(const py::object& body, const py::object& pose, float scale, const py::object& motion,
                   const char* name);

}  // namespace bilayer::python
