// SPDX-License-Identifier: Apache-2.0
// The objects behind Python's Field and Collider. Each holds how it was made, since pickles make it again.
#pragma once

#include <pybind11/pybind11.h>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/field.h>

namespace bilayer::python {

namespace py = pybind11;

struct FieldObject : Field {
    /// As __reduce__ returns it: a callable and a tuple of its arguments.
    py::tuple recipe;
};

struct ColliderObject : Collider {
    py::tuple recipe;
};

}  // namespace bilayer::python
