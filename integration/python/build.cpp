// SPDX-License-Identifier: Apache-2.0
// build() and rebuild(), with progress and cancellation.
#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <optional>
#include <stdexcept>

#include <bilayer/cl/device.h>
#include <bilayer/cl/filler.h>
#include <bilayer/sdf/build.h>

#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"
#include "integration/python/cancellable.h"
#include "sdf/base/method_names.h"

namespace bilayer::python {
namespace {

// The keyword arguments of a call. Each is taken once; what is left at the end is unknown.
class Keywords {
  public:
    explicit Keywords(const py::kwargs& given) : left_(given.attr("copy")()) {}

    // None counts as not given. Raises TypeError for a value of another type.
    template <class Value>
    std::optional<Value> take(const char* name, const char* expected) {
        if (!left_.contains(name)) return std::nullopt;
        const py::object value = left_.attr("pop")(name);
        if (value.is_none()) return std::nullopt;
        try {
            return value.cast<Value>();
        } catch (const py::cast_error&) {
            throw py::type_error(fmt::format("{}: expected {}, got {}", name, expected, Py_TYPE(value.ptr())->tp_name));
        }
    }

    std::optional<double> positive(const char* name) {
        const auto value = take<double>(name, "a number");
        if (value) requirePositive(*value, name);
        return value;
    }

    template <class Value>
    void set(Value& option, const char* name, const char* expected) {
        if (const auto value = take<Value>(name, expected)) option = *value;
    }

    void requireEmpty(const char* function) const {
        for (const auto& [name, value] : left_)
            throw py::type_error(fmt::format("{}() has no argument '{}'", function, py::str(name).cast<std::string>()));
    }

  private:
    py::dict left_;
};

void setVoxelSize(Keywords& keywords, const Mesh& mesh, BuildOptions& options) {
    const auto size = keywords.positive("voxel_size"), resolution = keywords.positive("resolution");
    if (bool(size) == bool(resolution))
        throw std::invalid_argument("expected exactly one of voxel_size and resolution");
    options.voxelSize = size ? float(*size) : voxelSizeFor(mesh, float(*resolution));
}

void setBand(Keywords& keywords, BuildOptions& options) {
    const auto world = keywords.positive("half_width"), voxels = keywords.positive("half_width_voxels");
    const auto exterior = keywords.positive("exterior_width_voxels");
    const auto interior = keywords.positive("interior_width_voxels");
    if (bool(world) + bool(voxels) + (exterior || interior) > 1)
        throw std::invalid_argument(
            "expected only one of half_width, half_width_voxels, and exterior_width_voxels with interior_width_voxels");
    if (world && *world > 1000 * double(options.voxelSize))
        throw std::invalid_argument(fmt::format(
            "half_width is {:g} in the mesh's unit, which is {:.0f} voxels of {:g}, and must be at most 1000 voxels; "
            "half_width_voxels takes voxels",
            *world, *world / double(options.voxelSize), options.voxelSize));
    if (world || voxels)
        options.exteriorWidthVoxels = options.interiorWidthVoxels =
            voxels ? float(*voxels) : float(*world / double(options.voxelSize));
    if (exterior) options.exteriorWidthVoxels = float(*exterior);
    if (interior) options.interiorWidthVoxels = float(*interior);
}

struct Request {
    BuildOptions options;
    std::optional<OpenclFiller> filler;
    py::object progress = py::none();
};

// "cpu", "opencl" for the first device, or "opencl:" with a part of the device's name.
std::optional<OpenclFiller> fillerOf(const std::string& device) {
    constexpr std::string_view opencl = "opencl";
    if (device == "cpu") return std::nullopt;
    const bool named = device.starts_with("opencl:");
    if (device != opencl && !named)
        throw std::invalid_argument(fmt::format(
            "device: expected 'cpu', 'opencl' or 'opencl:' and a part of a device's name, got '{}'", device));
    return openclFiller(openDevice(named ? device.substr(opencl.size() + 1) : ""));
}

Request requestOf(const py::kwargs& given, const Mesh& mesh, const char* function) {
    Keywords keywords(given);
    Request request;
    BuildOptions& options = request.options;
    setVoxelSize(keywords, mesh, options);
    setBand(keywords, options);
    if (const auto word = keywords.take<std::string>("method", "a string"))
        options.method = byWord(bilayer::detail::methodNames, *word, "method");
    if (const auto word = keywords.take<std::string>("sign", "a string"))
        options.sign = byWord(bilayer::detail::signNames, *word, "sign");
    keywords.set(options.gapVoxels, "gap_voxels", "a number");
    keywords.set(options.unite, "unite", "True or False");
    keywords.set(options.triangles, "triangles", "True or False");
    keywords.set(options.threads, "threads", "an integer");
    keywords.set(options.doubleLayer.delta, "delta", "a number");
    keywords.set(options.doubleLayer.epsilon, "epsilon", "a number");
    keywords.set(options.doubleLayer.neighbourhood, "neighbourhood", "an integer");
    keywords.set(options.doubleLayer.maxSubdivision, "max_subdivision", "an integer");
    if (const auto progress = keywords.take<py::object>("progress", "a callable")) {
        if (!PyCallable_Check(progress->ptr())) throw py::type_error("progress: expected a callable");
        request.progress = *progress;
    }
    const auto device = keywords.take<std::string>("device", "a string");
    keywords.requireEmpty(function);
    if (device) request.filler = fillerOf(*device);
    return request;
}

// Runs a build that Ctrl-C cancels.
LevelSet run(Request& request, const std::function<LevelSet(const BuildOptions&)>& job) {
    return cancellable(request.progress, [&](const Listener& listener) {
        request.options.progress = listener;
        return job(request.options);
    });
}

LevelSet buildField(const py::object& object, const py::kwargs& keywords) {
    const SharedMesh mesh = meshOf(object);
    Request request = requestOf(keywords, *mesh, "build");
    const BlockFiller* filler = request.filler ? &*request.filler : nullptr;
    return run(request, [&](const BuildOptions& options) { return build(*mesh, options, filler); });
}

// The triangles of which a corner differs.
std::vector<std::uint32_t> movedTriangles(const Mesh& before, const Mesh& after) {
    std::vector<std::uint32_t> moved;
    for (std::size_t i = 0; i < std::min(before.triangles.size(), after.triangles.size()); ++i)
        for (int corner = 0; corner < 3; ++corner)
            if (before.points[before.triangles[i][corner]] != after.points[after.triangles[i][corner]]) {
                moved.push_back(std::uint32_t(i));
                break;
            }
    return moved;
}

LevelSet rebuildField(const LevelSet& old, const py::object& oldObject, const py::object& newObject,
                      const py::object& moved, const py::kwargs& keywords) {
    const SharedMesh before = meshOf(oldObject), after = meshOf(newObject);
    Request request = requestOf(keywords, *before, "rebuild");
    if (request.filler) throw std::invalid_argument("device: rebuild() runs on the 'cpu'");
    std::vector<std::uint32_t> triangles;
    if (!moved.is_none()) triangles = indices(moved, "moved", 1, after->triangles.size(), "a face");
    return run(request, [&, given = !moved.is_none()](const BuildOptions& options) {
        return rebuild(old, *before, *after, given ? triangles : movedTriangles(*before, *after), options);
    });
}

py::list listDevices() {
    py::list list;
    for (const DeviceInfo& device : devices()) {
        py::dict entry;
        entry["platform"] = device.platform;
        entry["name"] = device.name;
        entry["gpu"] = device.gpu;
        entry["compute_units"] = device.computeUnits;
        entry["memory_bytes"] = device.memoryBytes;
        list.append(entry);
    }
    return list;
}

constexpr const char* buildDoc = R"(build(mesh, *, resolution | voxel_size, ...) -> LevelSet

Builds the narrow-band signed distance field of a mesh on all cores. The bytes of the field do not depend on the number
of threads. Ctrl-C cancels.

mesh: a Mesh, or anything that as_mesh() takes.
resolution: voxels along the longest side of the mesh's bounds; or
voxel_size: the edge of a voxel, in the mesh's unit.
half_width: width of the band on each side of the surface, in the mesh's unit; or
half_width_voxels: the same in voxels, default 3; or
exterior_width_voxels, interior_width_voxels: each side by itself.
method: "exact" (default), "double-layer", "pseudonormal"; "prism" needs an OpenCL device.
sign: "auto" (default), "normals", "winding" or "flood".
gap_voxels: widest gap that "flood" closes, default 2.
unite: build the union of overlapping solids, default False.
triangles: also store the nearest face of each voxel (LevelSet.sparse), default False.
threads: maximum number of threads; 0, the default, for all.
device: "cpu" (default), "opencl", or "opencl:" and a part of a device's name.
delta, epsilon, neighbourhood, max_subdivision: of the double layer method.
progress: called with the fraction done, 0 to 1, on the calling thread; return False to cancel.

Raises ValueError that names the argument or the face, TypeError for an unknown argument, Cancelled after progress
returned False, DeviceError for errors of a device, and what progress raises.

>>> import bilayer
>>> level_set = bilayer.build(bilayer.box(), resolution=32)
>>> level_set.sign, round(level_set.voxel_size, 6)
('normals', 0.03125)
)";

constexpr const char* rebuildDoc = R"(rebuild(level_set, old_mesh, new_mesh, moved=None, *, ...) -> LevelSet

Updates a field after some faces of its mesh have moved. Fills only the blocks near those; the bytes equal those of
build(new_mesh, ...). Needs the options of the build that made `level_set`; `resolution` refers to old_mesh.

moved: integers of shape (K,), all faces with a corner that moved; None compares the vertices.

Raises what build() raises, and ValueError if the field belongs to another mesh or options, the meshes have different
numbers of faces, or a face has moved that `moved` does not list.

>>> import bilayer, numpy
>>> old = bilayer.box()
>>> level_set = bilayer.build(old, voxel_size=0.05)
>>> vertices = old.vertices.copy()
>>> vertices[0] -= 0.1
>>> new = bilayer.Mesh(vertices, old.faces)
>>> bilayer.rebuild(level_set, old, new, voxel_size=0.05) == bilayer.build(new, voxel_size=0.05)
True
)";

constexpr const char* devicesDoc = R"(devices() -> list of dict

The OpenCL devices: platform, name, gpu, compute_units, memory_bytes. Raises DeviceError if a platform fails to answer.

>>> import bilayer
>>> all(device["memory_bytes"] > 0 for device in bilayer.devices())
True
)";

}  // namespace

void addBuild(py::module_& module) {
    module.def("build", buildField, py::arg("mesh"), buildDoc);
    module.def("rebuild", rebuildField, py::arg("level_set"), py::arg("old_mesh"), py::arg("new_mesh"),
               py::arg("moved") = py::none(), rebuildDoc);
    module.def("devices", listDevices, devicesDoc);
}

}  // namespace bilayer::python
