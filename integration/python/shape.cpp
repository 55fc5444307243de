// SPDX-License-Identifier: Apache-2.0
// Shape: bodies of other kinds than Collider.
#include <bilayer/collider/shapes.h>

#include <fmt/format.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"
#include "integration/python/objects.h"

namespace bilayer::python {
namespace {

/// @param maker  the static function of Shape that makes it again from the arguments
template <class... Arguments>
ShapeObject made(ContactShape shape, const char* maker, const Arguments&... arguments) {
    return {std::move(shape), py::make_tuple(maker, py::make_tuple(arguments...))};
}

// As __reduce__ returns it: a static function of a native class cannot be pickled itself.
py::tuple recipeOf(const ShapeObject& shape) {
    const py::tuple arguments = shape.call[1];
    const py::object call = py::module_::import("operator").attr("methodcaller")(shape.call[0], *arguments);
    return py::make_tuple(call, py::make_tuple(py::type::of<ShapeObject>()));
}

ShapeObject makeHull(const py::object& points, double radius) {
    const Floats all(points, "points", {3});
    return made(ContactShape::hull(all.points(), float(radius)), "hull", points, radius);
}

ShapeObject makeSpheres(const py::object& centres, const py::object& radii) {
    Floats centre(centres, "centres", {3}), radius(radii, "radii", {});
    broadcast({&centre, &radius});
    std::vector<SphereOfHull> spheres;
    for (std::size_t i = 0; i < centre.points().size(); ++i)
        spheres.push_back({centre.points()[i], radius.as<float>()[i]});
    return made(ContactShape::spheres(spheres), "spheres", centres, radii);
}

bool meets(const Bounds& box, const Bounds& other) {
    for (int axis = 0; axis < 3; ++axis)
        if (box.lower[axis] > other.upper[axis] || box.upper[axis] < other.lower[axis]) return false;
    return true;
}

ShapeObject makeTriangles(const py::object& mesh) {
    const SharedMesh shared = meshOf(mesh);
    validate(*shared);
    const TriangleSheet sheet{[shared](const Bounds& box, const TriangleSheet::Visitor& visitor) {
        for (std::size_t i = 0; i < shared->triangles.size(); ++i) {
            Triangle triangle;
            Bounds own;
            for (int k = 0; k < 3; ++k) own.add(triangle[std::size_t(k)] = shared->points[shared->triangles[i][k]]);
            if (meets(own, box)) visitor(triangle, i);
        }
    }};
    return made(ContactShape::triangles(sheet), "triangles", shared);
}

// As Python writes the call that made the shape.
std::string reprOf(const ShapeObject& shape) {
    std::string arguments;
    for (const py::handle& argument : py::tuple(shape.call[1]))
        arguments += (arguments.empty() ? "" : ", ") + py::repr(argument).cast<std::string>();
    return fmt::format("Shape.{}({})", shape.call[0].cast<std::string>(), arguments);
}

constexpr const char* sphereDoc = R"(sphere(radius) -> Shape

A sphere around the origin. Raises ValueError unless the radius is above 0 and finite.

>>> import bilayer
>>> bilayer.Shape.sphere(0.5)
Shape.sphere(0.5)
)";

constexpr const char* boxDoc = R"(box(half_extents) -> Shape

A box around the origin. half_extents: three numbers above 0.

>>> import bilayer
>>> bilayer.Shape.box((1, 2, 3))
Shape.box((1, 2, 3))
)";

constexpr const char* capsuleDoc = R"(capsule(radius, half_height) -> Shape

half_height: from the middle to the centre of either end's half sphere.

>>> import bilayer
>>> bilayer.Shape.capsule(0.5, 1)
Shape.capsule(0.5, 1.0)
)";

constexpr const char* cylinderDoc = R"(cylinder(radius, half_height) -> Shape

>>> import bilayer
>>> bilayer.Shape.cylinder(0.5, 1)
Shape.cylinder(0.5, 1.0)
)";

constexpr const char* coneDoc = R"(cone(radius, half_height) -> Shape

The base lies at y = -half_height, the apex at +half_height.

>>> import bilayer
>>> bilayer.Shape.cone(0.5, 1)
Shape.cone(0.5, 1.0)
)";

constexpr const char* hullDoc = R"(hull(points, radius=0) -> Shape

The convex hull of points of shape (N, 3), grown by a radius. Raises ValueError if they lie in one plane.

>>> import bilayer
>>> bilayer.Shape.hull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
Shape.hull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], 0.0)
)";

constexpr const char* spheresDoc = R"(spheres(centres, radii) -> Shape

The convex hull of spheres. centres: shape (N, 3). radii: shape (N,), or a number.

>>> import bilayer
>>> bilayer.Shape.spheres([(0, 0, 0), (2, 0, 0)], [1, 0.5])
Shape.spheres([(0, 0, 0), (2, 0, 0)], [1, 0.5])
)";

constexpr const char* planeDoc = R"(plane(normal, offset=0) -> Shape

The half-space of all x with x . normal / |normal| <= offset.

>>> import bilayer
>>> bilayer.Shape.plane((0, 0, 1))
Shape.plane((0, 0, 1), 0.0)
)";

constexpr const char* trianglesDoc = R"(triangles(mesh) -> Shape

An open surface: both of its sides are outside. Each call looks at all triangles.

>>> import bilayer
>>> ground = bilayer.Mesh([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], [(0, 1, 2)])
>>> box = bilayer.box()
>>> body = bilayer.Collider(box, bilayer.build(box, resolution=16))
>>> bilayer.distance(bilayer.Shape.triangles(ground), None, body, bilayer.Pose((0, 0, 2))).distance
1.5
)";

constexpr const char* shapeDoc =
    R"(Shapes of bodies for collide(), distance() and time_of_impact(), made by the functions below. Immutable; share one
between bodies and threads. Lengths are in the unit of the colliders' meshes. Capsules, cylinders and cones lie along y,
around the origin. At least one of two bodies is a Collider.

>>> import bilayer
>>> box = bilayer.box()
>>> body = bilayer.Collider(box, bilayer.build(box, resolution=16))
>>> bilayer.distance(bilayer.Shape.sphere(0.5), bilayer.Pose((2, 0, 0)), body, None).distance
1.0
)";

}  // namespace

void addShape(py::module_& module) {
    py::class_<ShapeObject>(module, "Shape", shapeDoc)
        .def_static(
            "sphere", [](double radius) { return made(ContactShape::sphere(float(radius)), "sphere", radius); },
            py::arg("radius"), sphereDoc)
        .def_static(
            "box",
            [](const py::object& halfExtents) {
                return made(ContactShape::box(vector(halfExtents, "half_extents")), "box", halfExtents);
            },
            py::arg("half_extents"), boxDoc)
        .def_static(
            "capsule",
            [](double radius, double halfHeight) {
                return made(ContactShape::capsule(float(radius), float(halfHeight)), "capsule", radius, halfHeight);
            },
            py::arg("radius"), py::arg("half_height"), capsuleDoc)
        .def_static(
            "cylinder",
            [](double radius, double halfHeight) {
                return made(ContactShape::cylinder(float(radius), float(halfHeight)), "cylinder", radius, halfHeight);
            },
            py::arg("radius"), py::arg("half_height"), cylinderDoc)
        .def_static(
            "cone",
            [](double radius, double halfHeight) {
                return made(ContactShape::cone(float(radius), float(halfHeight)), "cone", radius, halfHeight);
            },
            py::arg("radius"), py::arg("half_height"), coneDoc)
        .def_static("hull", makeHull, py::arg("points"), py::arg("radius") = 0., hullDoc)
        .def_static("spheres", makeSpheres, py::arg("centres"), py::arg("radii"), spheresDoc)
        .def_static(
            "plane",
            [](const py::object& normal, double offset) {
                return made(ContactShape::plane(vector(normal, "normal"), float(offset)), "plane", normal, offset);
            },
            py::arg("normal"), py::arg("offset") = 0., planeDoc)
        .def_static("triangles", makeTriangles, py::arg("mesh"), trianglesDoc)
        .def("__reduce__", recipeOf)
        .def("__copy__", [](const ShapeObject& self) { return self; })
        .def(
            "__deepcopy__", [](const ShapeObject& self, const py::dict&) { return self; }, py::arg("memo"))
        .def("__repr__", reprOf);
}

}  // namespace bilayer::python
