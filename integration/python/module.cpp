// SPDX-License-Identifier: Apache-2.0
// The native module of the package `bilayer`: pybind11 converts arguments and results, the libraries compute.
#include <pybind11/pybind11.h>

#include <array>
#include <exception>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include <bilayer/cl/device.h>
#include <bilayer/sdf/options.h>

#include "integration/python/bindings.h"

namespace {

/// Options in errors of the libraries, and their names here.
constexpr std::array<std::pair<std::string_view, std::string_view>, 6> optionNames{
    {{"voxelSize", "voxel_size"},
     {"exteriorWidthVoxels", "exterior_width_voxels"},
     {"interiorWidthVoxels", "interior_width_voxels"},
     {"gapVoxels", "gap_voxels"},
     {"maxSubdivision", "max_subdivision"},
     {"perVoxel", "per_voxel"}}};

/// std::invalid_argument becomes ValueError, with the names that options have here.
void translateArgumentErrors(std::exception_ptr error) {
    try {
        std::rethrow_exception(error);
    } catch (const std::invalid_argument& invalid) {
        std::string message = invalid.what();
        for (const auto& [name, here] : optionNames) {
            const std::size_t at = message.find(name);
            if (at != std::string::npos) message.replace(at, name.size(), here);
        }
        PyErr_SetString(PyExc_ValueError, message.c_str());
    }
}

}  // namespace

PYBIND11_MODULE(_bilayer, module) {
    using namespace bilayer;
    namespace py = pybind11;
    py::options options;
    options.disable_function_signatures();  // the docstrings name arguments and types of Python
    module.doc() = "The native part of bilayer. Import bilayer instead.";
    module.attr("__version__") = BILAYER_VERSION;
    py::register_local_exception_translator(translateArgumentErrors);
    py::register_exception<Cancelled>(module, "Cancelled", PyExc_RuntimeError).doc() =
        "Raised by build() and rebuild() after `progress` returned False.";
    py::register_exception<DeviceError>(module, "DeviceError", PyExc_RuntimeError).doc() =
        "Error of an OpenCL device, or no such device.";
    python::addMesh(module);
    python::addLevelSet(module);
    python::addBuild(module);
    python::addField(module);
    python::addPose(module);
    python::addShape(module);
    python::addCollider(module);
    python::addContact(module);
    python::addDistance(module);
    python::addFluid(module);
}
