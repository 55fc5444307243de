// SPDX-License-Identifier: Apache-2.0
// The objects behind Python's Field, Collider and Shape. Each holds how it was made, since pickles make it again.
#pragma once

#include <pybind11/pybind11.h>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/field.h>
#include <bilayer/collider/shapes.h>

namespace bilayer::python {

namespace py = pybind11;

struct FieldObject : Field {
    /// As __reduce__ returns it: a callable and a tuple of its arguments; empty if it keeps no level set.
    py::tuple recipe;
    glm::dvec3 origin;        ///< of the level set: world coordinates of the coordinates' zero
    std::size_t keptBytes{};  ///< of the level set that the recipe keeps
};

struct ColliderObject : Collider {
    py::tuple recipe;
    glm::dvec3 origin;  ///< of the level set
};

struct ShapeObject : ContactShape {
    /// The name of the static function that made it, and a tuple of its arguments.
    py::tuple call;
};

}  // namespace bilayer::python
