// SPDX-License-Identifier: Apache-2.0
// LevelSet: metadata, files, conversion to numpy, isosurfaces, extension beyond the band.
#include <fmt/format.h>
#include <openvdb/tree/LeafManager.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>

#include <bilayer/integration/fluid/extend.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/nanovdb.h>
#include <bilayer/sdf/surface.h>
#include <bilayer/sdf/vdb_io.h>

#include "collider/contact/body/body.h"
#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"
#include "integration/python/define.h"
#include "integration/python/dense.h"
#include "integration/python/grid_bytes.h"
#include "integration/python/without_gil.h"
#include "sdf/base/openvdb.h"

namespace bilayer::python {
namespace {

// What visits the whole tree, without the GIL.
template <auto count>
std::uint64_t counted(const LevelSet& levelSet) {
    const WithoutGil release;
    return (levelSet.*count)();
}

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;

// The tree with voxels in place of active tiles, which fields of other programs may have.
FloatTree::ConstPtr withoutTiles(const FloatGrid& grid) {
    if (grid.tree().activeTileCount() == 0) return grid.constTreePtr();
    const auto copy = std::make_shared<FloatTree>(grid.tree());
    copy->voxelizeActiveTiles();
    return copy;
}

struct ActiveVoxels {
    std::vector<std::int32_t> coordinates;  // three per voxel
    std::vector<float> values;
    std::vector<std::int32_t> triangles;  // empty if the level set has none
};

ActiveVoxels activeVoxels(const LevelSet& levelSet) {
    const FloatTree::ConstPtr tree = withoutTiles(*levelSet.grids().distance);
    openvdb::tree::LeafManager<const FloatTree> leaves(*tree);
    std::vector<std::size_t> begins(leaves.leafCount() + 1, 0);
    for (std::size_t i = 0; i < leaves.leafCount(); ++i) begins[i + 1] = begins[i] + leaves.leaf(i).onVoxelCount();
    ActiveVoxels voxels;
    voxels.coordinates.resize(3 * begins.back());
    voxels.values.resize(begins.back());
    const openvdb::Int32Grid* triangle = levelSet.grids().triangle.get();
    if (triangle) voxels.triangles.resize(begins.back());
    leaves.foreach ([&](const FloatTree::LeafNodeType& leaf, std::size_t index) {
        std::size_t at = begins[index];
        const auto* nearest = triangle ? triangle->tree().probeConstLeaf(leaf.origin()) : nullptr;
        for (auto voxel = leaf.cbeginValueOn(); voxel; ++voxel, ++at) {
            const Coord coordinate = voxel.getCoord();
            std::copy_n(coordinate.asPointer(), 3, &voxels.coordinates[3 * at]);
            voxels.values[at] = *voxel;
            if (triangle) voxels.triangles[at] = nearest ? nearest->getValue(voxel.pos()) : -1;
        }
    });
    return voxels;
}

template <class Value>
py::array arrayOf(std::vector<Value> values, const Shape& shape) {
    Value* first = nullptr;
    const py::capsule owner = owned(std::move(values), first);
    return py::array(py::dtype::of<Value>(), shape, first, owner);
}

py::object sparse(const LevelSet& levelSet) {
    ActiveVoxels voxels;
    {
        const WithoutGil release;
        voxels = activeVoxels(levelSet);
    }
    const auto count = py::ssize_t(voxels.values.size());
    py::object triangles = py::none();
    if (levelSet.grids().triangle) triangles = arrayOf(std::move(voxels.triangles), {count});
    return result("Sparse", arrayOf(std::move(voxels.coordinates), {count, 3}),
                  arrayOf(std::move(voxels.values), {count}), triangles, toArray(glm::dvec3(0)), levelSet.voxelSize());
}

py::dict metadataOf(const LevelSet& levelSet) {
    const BuildTimes& times = levelSet.buildTimes();
    py::dict all;
    all["voxel_size"] = levelSet.voxelSize();
    all["origin"] = toArray(levelSet.origin());
    all["exterior_width"] = levelSet.exteriorWidth();
    all["interior_width"] = levelSet.interiorWidth();
    all["active_voxels"] = counted<&LevelSet::activeVoxels>(levelSet);
    all["leaves"] = counted<&LevelSet::leaves>(levelSet);
    all["memory_bytes"] = counted<&LevelSet::memoryBytes>(levelSet);
    all["has_triangles"] = levelSet.grids().triangle != nullptr;
    all["method"] = levelSet.method();
    all["sign"] = levelSet.sign();
    all["sign_reason"] = levelSet.signReason();
    all["sign_conflicts"] = levelSet.signConflicts();
    all["sign_undecided"] = levelSet.signUndecided();
    all["error_bound"] = levelSet.errorBound();
    all["mesh_hash"] = levelSet.meshHash();
    all["build_seconds"] = times.total;
    return all;
}

py::bytes packed(const LevelSet& levelSet) {
    const Grids& grids = levelSet.grids();
    openvdb::GridCPtrVec all{grids.distance};
    if (grids.triangle) all.push_back(grids.triangle);
    if (grids.points) all.push_back(grids.points);
    return bytesOf(all);
}

LevelSet unpackedLevelSet(const py::object& packed) {
    const openvdb::GridPtrVec all = gridsOf(packed);
    auto grids = std::make_shared<Grids>();
    for (const auto& grid : all) {
        if (grid->getName() == contactPoints)
            grids->points = grid;
        else if (grid->isType<openvdb::Int32Grid>())
            grids->triangle = openvdb::gridPtrCast<openvdb::Int32Grid>(grid);
        else
            grids->distance = openvdb::gridPtrCast<FloatGrid>(grid);
    }
    const WithoutGil release;
    return LevelSet(std::move(grids));
}

bool equal(const LevelSet& a, const LevelSet& b) {
    const FloatGrid &left = *a.grids().distance, &right = *b.grids().distance;
    if (&left == &right) return true;
    if (left.transform() != right.transform() || left.background() != right.background() ||
        a.interiorWidth() != b.interiorWidth() || a.origin() != b.origin() ||
        left.activeVoxelCount() != right.activeVoxelCount())
        return false;
    const ActiveVoxels one = activeVoxels(a), other = activeVoxels(b);
    return one.coordinates == other.coordinates && one.values == other.values && one.triangles == other.triangles;
}

void save(const LevelSet& levelSet, const Path& path, bool halfFloat) {
    requireExtension(path, {".vdb", ".nvdb"});
    const std::string& file = path.text;
    const bool nano = std::tolower(file[file.size() - 4]) == 'n';
    if (nano && halfFloat) throw std::invalid_argument("half_float: .nvdb files hold 32-bit floats");
    const WithoutGil release;
    nano ? writeNanoVdb(file, levelSet) : writeVdb(file, levelSet, {.halfFloat = halfFloat});
}

LevelSet load(const Path& path) {
    requireExisting(path);
    const WithoutGil release;
    return detail::readStored(path.text).levelSet;
}

SharedMesh extract(const LevelSet& levelSet, float isovalue, float adaptivity) {
    const WithoutGil release;
    return std::make_shared<Mesh>(surface(levelSet, {isovalue, adaptivity}));
}

LevelSet extended(const LevelSet& levelSet, std::optional<float> distance) {
    const WithoutGil release;
    return distance ? fluid::extend(levelSet, *distance) : fluid::extend(levelSet);
}

constexpr const char* levelSetDoc = R"(An immutable narrow-band signed distance field, in an OpenVDB grid.

build() makes it, LevelSet.load() reads it. Distances are negative inside, in the mesh's unit. Coordinates are those of
Mesh.vertices; add `origin` for the world's. Voxel centres are at whole multiples of the voxel size. Copies share
memory; pickles hold all grids.

>>> import bilayer, pickle
>>> level_set = bilayer.build(bilayer.box(), resolution=16)
>>> pickle.loads(pickle.dumps(level_set)) == level_set
True
)";

constexpr const char* denseDoc = R"(to_numpy(padding=1) -> Dense(values, origin, spacing)

The field as a dense array over the band's bounding box.

padding: voxels added on each side.
values: float32 of shape (nx, ny, nz). Outside the band: the exterior width outside, minus the interior width inside.
origin: float64 of shape (3,), the centre of values[0, 0, 0]; relative to LevelSet.origin, as the points of queries.
spacing: the voxel size. values[i, j, k] is at origin + spacing * (i, j, k).

Raises ValueError for a negative padding, and for more than 2^31 voxels.

>>> import bilayer
>>> values, origin, spacing = bilayer.build(bilayer.box(), resolution=16).to_numpy()
>>> values.shape, bool(values[12, 12, 12] < 0)
((23, 23, 23), True)
)";

constexpr const char* fromDenseDoc =
    R"(from_numpy(values, origin=(0, 0, 0), spacing=1, *, half_width=None, field_origin=(0, 0, 0)) -> LevelSet

The level set of a dense array of signed distances, as to_numpy() returns it. Voxels beyond the band are dropped.

values: real numbers of shape (nx, ny, nz), negative inside, in the unit of the spacing.
origin: three numbers, the centre of values[0, 0, 0], at a whole number of voxels from zero.
spacing: distance of neighbouring voxels, above 0.
half_width: width of the band in the unit of the spacing, or a pair for outside and inside; None for the smallest value
at the border of the array, and minus the smallest value.
field_origin: LevelSet.origin: what to add to coordinates of the level set for those of the world.

Raises ValueError that names the argument for a wrong shape or dtype and values that are not finite; if no value is
negative; if the solid or the band reaches the border; and for values that are no distances: that differ by more than
1.5 spacings between neighbours, or do not change by about a spacing across the surface.

>>> import bilayer
>>> level_set = bilayer.build(bilayer.box(), resolution=16)
>>> bilayer.LevelSet.from_numpy(*level_set.to_numpy()) == level_set
True
)";

constexpr const char* sparseDoc = R"(sparse() -> Sparse(coordinates, values, triangles, origin, spacing)

The active voxels, in the order of the tree.

coordinates: int32 of shape (N, 3), the voxels' indices. The centre of a voxel is at origin + spacing * coordinates,
relative to LevelSet.origin.
values: float32 of shape (N,), signed distances.
triangles: int32 of shape (N,), the nearest face; None unless build() was asked for triangles.
origin: float64 of shape (3,), zero. spacing: the voxel size.

>>> import bilayer
>>> level_set = bilayer.build(bilayer.box(), resolution=16)
>>> level_set.sparse().values.size == level_set.active_voxels
True
)";

constexpr const char* extendedDoc = R"(extended(distance=None) -> LevelSet

Extends the field beyond its band by fast sweeping: to a distance on either side of the surface, or to the whole
bounding box of the band. The band keeps its values; those beyond are of first order.

Raises ValueError for a field without an inside, and for a distance that is not positive.

>>> import bilayer
>>> level_set = bilayer.build(bilayer.box(), resolution=16)
>>> level_set.extended(0.5).exterior_width
0.5
)";

constexpr const char* surfaceDoc = R"(surface(isovalue=0, adaptivity=0) -> Mesh

Extracts an isosurface, with faces that point outward.

isovalue: the distance at the surface, within the band.
adaptivity: 0 for a uniform mesh, to 1 for the fewest faces in flat regions.

Raises ValueError for a value out of range.

>>> import bilayer
>>> bilayer.inspect(bilayer.build(bilayer.box(), resolution=16).surface()).closed
True
)";

constexpr const char* saveLevelSetDoc = R"(save(path, half_float=False)

Writes a .vdb file, which Houdini, Blender and ParaView open, or a .nvdb file for code on a GPU. The file appears whole
or not at all.

half_float: store distances as 16-bit floats, half the size, with three decimal digits.

Raises ValueError for another extension, RuntimeError if the file cannot be written.

>>> import bilayer, os, tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     bilayer.build(bilayer.box(), resolution=16).save(os.path.join(folder, "box.nvdb"))
)";

constexpr const char* loadDoc = R"(load(path) -> LevelSet

Reads the first level set of a .vdb file, of bilayer or another program.

Raises FileNotFoundError if there is no such file, and RuntimeError that names the file if it cannot be read.

>>> import bilayer, os, tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     path = os.path.join(folder, "box.vdb")
...     bilayer.build(bilayer.box(), resolution=16).save(path)
...     bilayer.LevelSet.load(path).method
'exact'
)";

}  // namespace

void addLevelSet(py::module_& module) {
    py::class_<LevelSet> type(module, "LevelSet", levelSetDoc);
    defineMethod(type, denseDoc, toDense);
    defineStatic(type, fromDenseDoc, fromDense);
    defineMethod(type, sparseDoc, sparse);
    defineMethod(type, surfaceDoc, extract);
    defineMethod(type, extendedDoc, extended);
    defineMethod(type, saveLevelSetDoc, save);
    defineStatic(type, loadDoc, load);
    type.def_property_readonly("voxel_size", &LevelSet::voxelSize, "Edge of a voxel, in the mesh's unit.")
        .def_property_readonly(
            "origin", [](const LevelSet& self) { return toArray(self.origin()); },
            "float64 of shape (3,): Mesh.origin. World coordinates minus this are those of queries.")
        .def_property_readonly("exterior_width", &LevelSet::exteriorWidth,
                               "Voxels with 0 <= distance < this are active.")
        .def_property_readonly("interior_width", &LevelSet::interiorWidth,
                               "Voxels with -this < distance < 0 are active.")
        .def_property_readonly("active_voxels", counted<&LevelSet::activeVoxels>, "Number of voxels in the band.")
        .def_property_readonly("memory_bytes", counted<&LevelSet::memoryBytes>, "Memory that all grids take, in bytes.")
        .def_property_readonly("method", &LevelSet::method, "How distances were computed; '' if not known.")
        .def_property_readonly("sign", &LevelSet::sign,
                               "How the inside was found: 'normals', 'winding' or 'flood'; 'layers' for the method "
                               "'double-layer', and 'prisms' for 'prism', which have signs of their own; '' if not "
                               "known.")
        .def_property_readonly("sign_reason", &LevelSet::signReason, "Why that sign method was chosen.")
        .def_property_readonly("error_bound", &LevelSet::errorBound,
                               "Maximum error of active voxels; inf: not bounded; nan: not known.")
        .def_property_readonly("mesh_hash", &LevelSet::meshHash, "Hash of the mesh, or 0.")
        .def_property_readonly(
            "has_triangles", [](const LevelSet& self) { return self.grids().triangle != nullptr; },
            "Whether the nearest face of each active voxel is stored.")
        .def_property_readonly(
            "metadata", metadataOf,
            "All of the above by name, and more: `leaves`, the number of blocks of 8 x 8 x 8 voxels; "
            "`sign_conflicts` and `sign_undecided`, where signs are in doubt; `build_seconds`.")
        .def(
            "__eq__",
            [](const LevelSet& a, const LevelSet& b) {
                const WithoutGil release;
                return equal(a, b);
            },
            py::is_operator())
        .def("__hash__", [](const LevelSet& self) { return py::ssize_t(self.meshHash() >> 1); })
        .def("__copy__", [](const LevelSet& self) { return self; })
        .def(
            "__deepcopy__", [](const LevelSet& self, const py::dict&) { return self; }, py::arg("memo"))
        .def("__repr__", [](const LevelSet& self) {
            return fmt::format("LevelSet({} active voxels of {:g})", self.activeVoxels(), self.voxelSize());
        });
    defineReduce(type, "_unpacked(packed) -> LevelSet", unpackedLevelSet, packed);
}

}  // namespace bilayer::python
