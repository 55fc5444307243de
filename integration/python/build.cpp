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
#include "integration/python/define.h"
#include "integration/python/without_gil.h"
#include "sdf/base/method_names.h"
#include "sdf/leaf/build_options.h"

namespace bilayer::python {
namespace {

// The options of a call. None is the default.
class Keywords {
  public:
    explicit Keywords(py::dict given) : given_(std::move(given)) {}

    template <class Value>
    std::optional<Value> take(const char* name) const {
        return given_.contains(name) ? argument<std::optional<Value>>(given_[name], name) : std::nullopt;
    }

    std::optional<double> positive(const char* name) const {
        const auto value = take<double>(name);
        if (value) requirePositive(*value, name);
        return value;
    }

    template <class Value>
    void set(Value& option, const char* name) const {
        if (const auto value = take<Value>(name)) option = *value;
    }

  private:
    py::dict given_;
};

// With neither option, voxels are those of the old level set, if there is one.
void setVoxelSize(const Keywords& keywords, const Mesh& mesh, const LevelSet* old, BuildOptions& options) {
    const auto size = keywords.positive("voxel_size"), resolution = keywords.positive("resolution");
    if ((size && resolution) || (!size && !resolution && !old))
        throw std::invalid_argument(
            fmt::format("voxel_size, resolution: expected {} one of them", old ? "at most" : "exactly"));
    if (size) {
        requireVoxelSize(*size, "voxel_size");
        options.voxelSize = float(*size);
    } else if (resolution) {
        if (old && !(bounds(mesh).longestSide() > 0)) throw std::invalid_argument("old_mesh: the mesh has no extent");
        options.voxelSize = voxelSizeFor(mesh, float(*resolution));
    } else {
        options.voxelSize = float(old->voxelSize());
    }
}

void setBand(const Keywords& keywords, BuildOptions& options) {
    const auto world = keywords.positive("half_width"), voxels = keywords.positive("half_width_voxels");
    const auto exterior = keywords.positive("exterior_width_voxels");
    const auto interior = keywords.positive("interior_width_voxels");
    if (bool(world) + bool(voxels) + (exterior || interior) > 1)
        throw std::invalid_argument(
            "half_width: expected only one of half_width, half_width_voxels, and exterior_width_voxels with "
            "interior_width_voxels");
    if (voxels && *voxels > double(bilayer::detail::maxWidthVoxels))
        throw std::invalid_argument(fmt::format("half_width_voxels is {:g}, and must be at most {:g}", *voxels,
                                                bilayer::detail::maxWidthVoxels));
    if (world && *world > double(bilayer::detail::maxWidthVoxels) * double(options.voxelSize))
        throw std::invalid_argument(fmt::format(
            "half_width is {:g} in the mesh's unit, which is {:.0f} voxels of {:g}, and must be at most {:g} voxels; "
            "half_width_voxels takes voxels",
            *world, *world / double(options.voxelSize), options.voxelSize, bilayer::detail::maxWidthVoxels));
    if (world || voxels)
        options.exteriorWidthVoxels = options.interiorWidthVoxels =
            voxels ? float(*voxels) : float(*world / double(options.voxelSize));
    if (exterior) options.exteriorWidthVoxels = float(*exterior);
    if (interior) options.interiorWidthVoxels = float(*interior);
}

struct Request {
    BuildOptions options;
    std::optional<BlockFiller> filler;
    py::object progress = py::none();
};

// "cpu", "opencl" for the first device, or "opencl:" with a part of the device's name.
std::optional<BlockFiller> fillerOf(const std::string& device) {
    constexpr std::string_view opencl = "opencl";
    if (device == "cpu") return std::nullopt;
    const bool named = device.starts_with("opencl:");
    if (device != opencl && !named)
        throw std::invalid_argument(fmt::format(
            "device: expected 'cpu', 'opencl' or 'opencl:' and a part of a device's name, got '{}'", device));
    const WithoutGil release;
    return openclFiller(openDevice(named ? device.substr(opencl.size() + 1) : ""));
}

Request requestOf(const Options& given, const Mesh& mesh, const LevelSet* old = nullptr) {
    const Keywords keywords(given.values);
    Request request;
    BuildOptions& options = request.options;
    setVoxelSize(keywords, mesh, old, options);
    setBand(keywords, options);
    if (const auto word = keywords.take<std::string>("method"))
        options.method = byWord(bilayer::detail::methodNames, *word, "method");
    if (const auto word = keywords.take<std::string>("sign"))
        options.sign = byWord(bilayer::detail::signNames, *word, "sign");
    keywords.set(options.gapVoxels, "gap_voxels");
    keywords.set(options.unite, "unite");
    keywords.set(options.triangles, "triangles");
    keywords.set(options.threads, "threads");
    keywords.set(options.doubleLayer.delta, "delta");
    keywords.set(options.doubleLayer.epsilon, "epsilon");
    keywords.set(options.doubleLayer.neighbourhood, "neighbourhood");
    keywords.set(options.doubleLayer.maxSubdivision, "max_subdivision");
    keywords.set(request.progress, "progress");
    if (!request.progress.is_none() && !PyCallable_Check(request.progress.ptr()))
        refuseType("progress", "a callable", request.progress);
    if (const auto device = keywords.take<std::string>("device")) request.filler = fillerOf(*device);
    if (options.method == Method::prism && !request.filler)
        throw std::invalid_argument("method: 'prism' needs a build on an OpenCL device: device=\"opencl\"");
    return request;
}

// Runs a build that Ctrl-C cancels.
LevelSet run(Request& request, const std::function<LevelSet(const BuildOptions&)>& job) {
    return cancellable(request.progress, [&](const ProgressCallback& progressCallback) {
        request.options.progress = progressCallback;
        return job(request.options);
    });
}

LevelSet buildField(const SharedMesh& mesh, const Options& options) {
    Request request = requestOf(options, *mesh);
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

LevelSet rebuildField(const LevelSet& old, const SharedMesh& before, const SharedMesh& after, const py::object& moved,
                      const Options& options) {
    Request request = requestOf(options, *before, &old);
    std::vector<std::uint32_t> triangles;
    if (!moved.is_none()) triangles = indices(moved, "moved", 1, after->triangles.size(), "a face");
    return run(request, [&, given = !moved.is_none()](const BuildOptions& options) {
        return rebuild(old, *before, *after, given ? triangles : movedTriangles(*before, *after), options);
    });
}

py::list listDevices() {
    const std::vector<DeviceInfo> found = [] {
        const WithoutGil release;
        return devices();
    }();
    py::list list;
    for (const DeviceInfo& device : found) {
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

constexpr const char* buildDoc = R"(build(mesh, *, resolution=None, voxel_size=None, half_width=None,
      half_width_voxels=None, exterior_width_voxels=None, interior_width_voxels=None,
      method="exact", sign="auto", gap_voxels=2, unite=False, triangles=False, threads=0, device="cpu",
      delta=0.5, epsilon=1, neighbourhood=2, max_subdivision=32, progress=None) -> LevelSet

Builds the narrow-band signed distance field of a mesh on all cores. The bytes of the field do not depend on the number
of threads. Ctrl-C cancels.

mesh: a Mesh, or anything that as_mesh() takes.
resolution: voxels along the longest side of the mesh's bounds; or
voxel_size: the edge of a voxel, in the mesh's unit.
half_width: width of the band on each side of the surface, in the mesh's unit; or
half_width_voxels: the same in voxels, default 3; or
exterior_width_voxels, interior_width_voxels: the width of one side alone, in voxels.
method: "exact", "double-layer" or "pseudonormal"; "prism" needs device="opencl".
sign: "auto", "normals", "winding" or "flood".
gap_voxels: widest gap that "flood" closes.
unite: build the union of overlapping solids.
triangles: also store the nearest face of each voxel (LevelSet.sparse).
threads: maximum number of threads; 0 for all.
device: "cpu", "opencl" for the first OpenCL device, or "opencl:" and a part of a device's name.
delta, epsilon, neighbourhood, max_subdivision: parameters of the double layer method.
progress: called with the fraction done, 0 to 1, on the calling thread; return False to cancel.

Raises ValueError that names the argument or the face, TypeError for an unknown argument, Cancelled after progress
returned False, DeviceError for errors of a device, and what progress raises.

>>> import bilayer
>>> level_set = bilayer.build(bilayer.box(), resolution=32)
>>> level_set.sign, round(level_set.voxel_size, 6)
('normals', 0.03125)
)";

constexpr const char* rebuildDoc =
    R"(rebuild(level_set, old_mesh, new_mesh, moved=None, *, resolution=None, voxel_size=None,
        half_width=None, half_width_voxels=None, exterior_width_voxels=None, interior_width_voxels=None,
        method="exact", sign="auto", gap_voxels=2, unite=False, triangles=False, threads=0,
        delta=0.5, epsilon=1, neighbourhood=2, max_subdivision=32, progress=None) -> LevelSet

Updates a field after some faces of its mesh have moved. Fills only the blocks near those; the bytes equal those of
build(new_mesh, ...). Needs the options of the build that made `level_set`. Without resolution and voxel_size, voxels
are those of `level_set`; `resolution` refers to old_mesh.

moved: integers of shape (K,), all faces with a corner that moved; None compares the vertices.

Raises what build() raises, and ValueError if the field belongs to another mesh or options, the meshes have different
numbers of faces, or a face has moved that `moved` does not list.

>>> import bilayer, numpy
>>> old = bilayer.box()
>>> level_set = bilayer.build(old, voxel_size=0.05)
>>> vertices = old.vertices.copy()
>>> vertices[0] -= 0.1
>>> new = bilayer.Mesh(vertices, old.faces)
>>> bilayer.rebuild(level_set, old, new) == bilayer.build(new, voxel_size=0.05)
True
)";

constexpr const char* devicesDoc = R"(devices() -> list of dict

The OpenCL devices, each with the keys "platform" and "name" (str), "gpu" (bool), "compute_units" and "memory_bytes"
(int). Raises DeviceError if a platform fails to answer.

>>> import bilayer
>>> all(device["memory_bytes"] > 0 for device in bilayer.devices())
True
)";

}  // namespace

void addBuild(py::module_& module) {
    define(module, buildDoc, buildField);
    define(module, rebuildDoc, rebuildField);
    define(module, devicesDoc, listDevices);
}

}  // namespace bilayer::python
