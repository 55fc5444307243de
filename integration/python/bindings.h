// SPDX-License-Identifier: Apache-2.0
// The parts of the module `_bilayer`, in the order in which they are added: each uses types of those before it.
#pragma once

#include <pybind11/pybind11.h>

namespace bilayer::python {

void addMesh(pybind11::module_& module);
void addLevelSet(pybind11::module_& module);
void addBuild(pybind11::module_& module);
void addField(pybind11::module_& module);
void addTiledField(pybind11::module_& module);
void addPose(pybind11::module_& module);
void addShape(pybind11::module_& module);
void addCollider(pybind11::module_& module);
void addContact(pybind11::module_& module);
void addDistance(pybind11::module_& module);
void addFluid(pybind11::module_& module);

}  // namespace bilayer::python
