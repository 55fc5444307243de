// SPDX-License-Identifier: Apache-2.0
// The native module of the package `bilayer`: pybind11 converts arguments and results, the libraries compute.
#include <pybind11/pybind11.h>

#include <bilayer/cl/device.h>
#include <bilayer/sdf/options.h>

#include "integration/python/bindings.h"

PYBIND11_MODULE(_bilayer, module) {
    using namespace bilayer;
    namespace py = pybind11;
    py::options options;
    options.disable_function_signatures();  // the docstrings name arguments and types of Python
    module.doc() = "The native part of bilayer. Import bilayer instead.";
    module.attr("__version__") = BILAYER_VERSION;
    py::register_exception<Cancelled>(module, "Cancelled", PyExc_RuntimeError).doc() =
        R"(Raised by build() and rebuild() after `progress` returned False.

>>> import bilayer
>>> try:
...     bilayer.build(bilayer.sphere(1), resolution=64, progress=lambda done: False)
... except bilayer.Cancelled:
...     print("cancelled")
cancelled
)";
    py::register_exception<DeviceError>(module, "DeviceError", PyExc_RuntimeError).doc() =
        R"(Error of an OpenCL device, or no such device.

>>> import bilayer
>>> try:
...     bilayer.build(bilayer.sphere(1), resolution=64, device="opencl:no such device")
... except bilayer.DeviceError:
...     print("no such device")
no such device
)";
    python::addMesh(module);
    python::addLevelSet(module);
    python::addBuild(module);
    python::addField(module);
    python::addTiledField(module);
    python::addPose(module);
    python::addShape(module);
    python::addCollider(module);
    python::addContact(module);
    python::addDistance(module);
    python::addFluid(module);
}
