// SPDX-License-Identifier: Apache-2.0
// Mesh, its files, inspect().
#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <glm/mat4x4.hpp>
#include <stdexcept>

#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>

#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"
#include "integration/python/cancellable.h"
#include "integration/python/define.h"
#include "integration/python/without_gil.h"

namespace bilayer::python {
namespace {

/// Above this ratio of distance from zero to size, float32 rounds coordinates by more than 6e-5 of the size.
constexpr double farSizes = 1000;

// Refuses coordinates that float32 cannot hold next to the size of the mesh. Those of floats are as the caller has
// them.
void requireNear(const py::array& vertices) {
    const bool isFloat = vertices.dtype().kind() == 'f' && vertices.dtype().itemsize() <= py::ssize_t(sizeof(float));
    if (vertices.size() == 0 || isFloat) return;
    // Python's integers do not overflow, and differ where their doubles are equal
    const py::list lower = vertices.attr("min")(0).attr("tolist")(), upper = vertices.attr("max")(0).attr("tolist")();
    double size = 0, far = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const py::object low = lower[axis], high = upper[axis];
        size = std::max(size, py::float_(high - low).cast<double>());
        far = std::max({far, std::abs(py::float_(low).cast<double>()), std::abs(py::float_(high).cast<double>())});
    }
    if (size > 0 && far > farSizes * size)
        throw std::invalid_argument(
            fmt::format("vertices: the mesh is {:.6g} long and {:.6g} from zero, where float32 rounds it: subtract an "
                        "origin, and pass that as `origin`",
                        size, far));
}

SharedMesh makeMesh(const py::object& vertices, const py::object& faces, const py::object& origin) {
    const Floats points(vertices, "vertices", {3}, Range::finite, Items::list);
    requireNear(py::array::ensure(vertices));
    const auto span = points.points();
    const std::vector<std::uint32_t> corners = indices(faces, "faces", 3, span.size(), "a vertex");
    const auto mesh = std::make_shared<Mesh>();
    if (!origin.is_none()) mesh->origin = doubleVector(origin, "origin");
    const WithoutGil release;
    mesh->points.assign(span.begin(), span.end());
    mesh->triangles.resize(corners.size() / 3);
    if (!corners.empty()) std::memcpy(mesh->triangles.data(), corners.data(), corners.size() * sizeof(std::uint32_t));
    return mesh;
}

bool equal(const Mesh& a, const Mesh& b) {
    const WithoutGil release;
    return a.points == b.points && a.triangles == b.triangles && a.origin == b.origin;
}

SharedMesh transform(const Mesh& mesh, const py::object& matrix) {
    const Floats numbers(matrix, "matrix", {4, 4}, Range::finite, Items::one);
    const auto values = numbers.as<float>();
    if (values[12] != 0 || values[13] != 0 || values[14] != 0 || values[15] != 1)
        throw std::invalid_argument("matrix: expected an affine map, whose last row is 0 0 0 1");
    glm::mat4 map;
    for (int row = 0; row < 4; ++row)
        for (int column = 0; column < 4; ++column) map[column][row] = values[std::size_t(4 * row + column)];
    const WithoutGil release;
    return std::make_shared<Mesh>(transformed(mesh, map));
}

py::object toReport(const MeshReport& r) {
    py::dict fields;
    const auto add = [&](const char* name, const auto& value) { fields[name] = value; };
    add("vertices", r.points);
    add("faces", r.triangles);
    add("components", r.components);
    add("bounds", toArray(r.bounds));
    add("origin", toArray(r.origin));
    add("boundary_edges", r.boundaryEdges);
    add("non_manifold_edges", r.nonManifoldEdges);
    add("misoriented_edges", r.misorientedEdges);
    add("degenerate_triangles", r.degenerateTriangles);
    add("duplicate_triangles", r.duplicateTriangles);
    add("boundary_loops", r.boundaryLoops);
    add("non_manifold_vertices", r.nonManifoldVertices);
    add("self_intersections", r.selfIntersections);
    add("flipped_triangles", r.flippedTriangles);
    add("inside_out_components", r.insideOutComponents);
    add("thinnest_wall", r.thinnestWall);
    add("common_wall", r.commonWall);
    add("thin_walls", r.thinWalls);
    add("area", r.area);
    add("volume", r.volume);
    add("closed", r.closed());
    add("oriented", r.oriented());
    add("verdict", verdict(r));
    return py::module_::import("bilayer.results").attr("MeshReport")(**fields);
}

py::object inspectMesh(const SharedMesh& mesh, float wall) {
    requireNotNegative(wall, "wall");
    return toReport(cancellable(
        py::none(), [&](const ProgressCallback& progressCallback) { return inspect(*mesh, wall, progressCallback); }));
}

SharedMesh read(const Path& path) {
    requireExisting(path);
    const WithoutGil release;
    return std::make_shared<Mesh>(readMesh(path.text));
}

void write(const Mesh& mesh, const Path& path) {
    requireExtension(path, {".obj", ".ply", ".stl"});
    const WithoutGil release;
    writeMesh(path.text, mesh);
}

SharedMesh weldedMesh(const Mesh& mesh) {
    const WithoutGil release;
    return std::make_shared<Mesh>(weld(mesh));
}

constexpr const char* meshDoc = R"(Mesh(vertices, faces, origin=None)

An immutable triangle mesh. Faces are counter-clockwise seen from outside.

vertices: real numbers of shape (N, 3), copied as float32, in the mesh's unit.
faces: integers of shape (M, 3), indices of vertices; copied.
origin: three numbers. World coordinates are vertices plus origin. Everything else uses the coordinates of the vertices.

Raises ValueError that names the argument for a wrong shape or dtype, a value that is not finite, and an index out of
range; also for float64 and integer coordinates so far from zero that float32 would round the shape.

>>> import bilayer
>>> faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
>>> tetrahedron = bilayer.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], faces)
>>> tetrahedron.vertices.shape, tetrahedron.faces.dtype
((4, 3), dtype('uint32'))
)";

constexpr const char* inspectDoc = R"(inspect(mesh, wall=0) -> MeshReport

Counts the defects of a mesh. Vertices with equal coordinates count as one. Ctrl-C cancels.

wall: walls thinner than this count as thin, in the mesh's unit; 0 counts none.

Raises ValueError for a mesh without faces.

>>> import bilayer
>>> bilayer.inspect(bilayer.box()).verdict
'closed and oriented'
)";

constexpr const char* readDoc = R"(read_mesh(path) -> Mesh

Reads a mesh: OBJ, PLY, STL, OFF, glTF and all other formats of Assimp, by the extension. Triangulates polygons and
merges vertices with equal coordinates. A mesh far from zero is moved to zero, and Mesh.origin says by how much: queries
then take points - mesh.origin.

Raises FileNotFoundError, and RuntimeError that names the file and line if it cannot be read, or a face has a coordinate
that is not finite.

>>> import bilayer, os, tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     path = os.path.join(folder, "box.ply")
...     bilayer.box().save(path)
...     bilayer.read_mesh(path)
Mesh(8 vertices, 12 faces)
)";

constexpr const char* weldedDoc = R"(welded() -> Mesh

Merges vertices with equal coordinates, and drops collapsed faces and unused vertices.

>>> import bilayer
>>> two = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
>>> bilayer.Mesh(two, [[0, 1, 2], [3, 4, 5]]).welded()
Mesh(4 vertices, 2 faces)
)";

constexpr const char* transformedDoc = R"(transformed(matrix) -> Mesh

Applies an affine map, real numbers of shape (4, 4). A reflection also flips the faces.

Raises ValueError for another shape or last row.

>>> import bilayer
>>> bilayer.box().transformed([[2, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]).bounds[:, 0].tolist()
[0.0, 2.0]
)";

constexpr const char* saveMeshDoc = R"(save(path)

Writes an .obj, .ply or .stl file, whole or not at all.

Raises ValueError for another extension and RuntimeError if the file cannot be written.

>>> import bilayer, os, tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     bilayer.box().save(os.path.join(folder, "box.obj"))
)";

}  // namespace

void addMesh(py::module_& module) {
    py::class_<Mesh, SharedMesh> type(module, "Mesh", meshDoc);
    defineConstructor(type, meshDoc, makeMesh);
    defineMethod(type, weldedDoc, weldedMesh);
    defineMethod(type, transformedDoc, transform);
    defineMethod(type, saveMeshDoc, write);
    type.def_property_readonly(
            "vertices",
            [](const py::object& self) {
                const Mesh& mesh = self.cast<const Mesh&>();
                return readOnly(reinterpret_cast<const float*>(mesh.points.data()),
                                {py::ssize_t(mesh.points.size()), 3}, self);
            },
            "float32 of shape (N, 3), without a copy; read-only.")
        .def_property_readonly(
            "faces",
            [](const py::object& self) {
                const Mesh& mesh = self.cast<const Mesh&>();
                return readOnly(reinterpret_cast<const std::uint32_t*>(mesh.triangles.data()),
                                {py::ssize_t(mesh.triangles.size()), 3}, self);
            },
            "uint32 of shape (M, 3), without a copy; read-only.")
        .def_property_readonly(
            "origin", [](const Mesh& mesh) { return toArray(mesh.origin); },
            "float64 of shape (3,): world coordinates are vertices plus this.")
        .def_property_readonly(
            "bounds",
            [](const Mesh& mesh) {
                const auto find = [&] {
                    const WithoutGil release;
                    return bounds(mesh);
                };
                return toArray(find());
            },
            "float32 of shape (2, 3): lower and upper corner of all vertices that faces use.")
        .def(
            "__eq__", [](const Mesh& a, const Mesh& b) { return equal(a, b); }, py::is_operator())
        .def("__hash__",
             [](const Mesh& mesh) {
                 const WithoutGil release;
                 return py::ssize_t(hash(mesh) >> 1);
             })
        .def("__copy__", [](const py::object& self) { return self; })
        .def(
            "__deepcopy__", [](const py::object& self, const py::dict&) { return self; }, py::arg("memo"))
        .def("__repr__",
             [](const Mesh& mesh) {
                 return fmt::format("Mesh({} vertices, {} faces)", mesh.points.size(), mesh.triangles.size());
             })
        .def("__reduce__", [](const py::object& self) {
            return py::make_tuple(self.get_type(),
                                  py::make_tuple(self.attr("vertices"), self.attr("faces"), self.attr("origin")));
        });
    define(module, readDoc, read);
    define(module, inspectDoc, inspectMesh);
}

}  // namespace bilayer::python
