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
#include "integration/python/define.h"
#include "integration/python/objects.h"
#include "integration/python/without_gil.h"
#include "sdf/base/box_relations.h"

namespace bilayer::python {
namespace {

constexpr py::ssize_t maxShownNumbers = 48;  // of an array in repr()

/// @param maker      the static function of Shape that makes it again from the arguments
/// @param arguments  numbers, meshes or frozen arrays, which nobody can change
template <class... Arguments>
ShapeObject made(ContactShape shape, const char* maker, const Arguments&... arguments) {
    return {std::move(shape), py::make_tuple(maker, py::make_tuple(arguments...))};
}

py::tuple recipeOf(const ShapeObject& shape) {
    return py::make_tuple(py::type::of<ShapeObject>().attr(shape.call[0]), shape.call[1]);
}

// Makes a shape without the GIL.
template <class Make>
ContactShape withoutGil(const Make& make) {
    const WithoutGil release;
    return make();
}

ShapeObject makeSphere(double radius) {
    return made(ContactShape::sphere(float(radius)), "sphere", radius);
}

ShapeObject makeBox(const py::object& halfExtents) {
    return made(ContactShape::box(vector(halfExtents, "half_extents")), "box", frozen(halfExtents, "half_extents"));
}

ShapeObject makeCapsule(double radius, double halfHeight) {
    return made(ContactShape::capsule(float(radius), float(halfHeight)), "capsule", radius, halfHeight);
}

ShapeObject makeCylinder(double radius, double halfHeight) {
    return made(ContactShape::cylinder(float(radius), float(halfHeight)), "cylinder", radius, halfHeight);
}

ShapeObject makeCone(double radius, double halfHeight) {
    return made(ContactShape::cone(float(radius), float(halfHeight)), "cone", radius, halfHeight);
}

ShapeObject makePlane(const py::object& normal, double offset) {
    return made(ContactShape::plane(vector(normal, "normal"), float(offset)), "plane", frozen(normal, "normal"),
                offset);
}

ShapeObject makeHull(const py::object& points, double radius) {
    const py::array_t<double> kept = frozen(points, "points");
    const Floats all(kept, "points", {3}, Range::finite, Items::list);
    return made(withoutGil([&] { return ContactShape::hull(all.points(), float(radius)); }), "hull", kept, radius);
}

ShapeObject makeSpheres(const py::object& centres, const py::object& radii) {
    const py::array_t<double> places = frozen(centres, "centres"), sizes = frozen(radii, "radii");
    const Floats centre(places, "centres", {3}, Range::finite, Items::list);
    Floats radius(sizes, "radii", {}, Range::nonNegative);
    if (!radius.shape().empty() && radius.shape() != centre.shape())
        throw std::invalid_argument(
            fmt::format("radii: expected one number, or shape {} as for the centres, got shape {}",
                        text(centre.shape()), text(radius.shape())));
    radius.broadcast(centre.shape());
    const auto make = [&] {
        std::vector<SphereOfHull> spheres;
        for (std::size_t i = 0; i < centre.points().size(); ++i)
            spheres.push_back({centre.points()[i], radius.as<float>()[i]});
        return ContactShape::spheres(spheres);
    };
    return made(withoutGil(make), "spheres", places, sizes);
}

ShapeObject makeTriangles(const SharedMesh& shared) {
    {
        const WithoutGil release;
        validate(*shared);
    }
    const OpenSurface openSurface{[shared](const Bounds& box, const OpenSurface::Visitor& visitor) {
        for (std::size_t i = 0; i < shared->triangles.size(); ++i) {
            Triangle triangle;
            Bounds own;
            for (int k = 0; k < 3; ++k) own.add(triangle[std::size_t(k)] = shared->points[shared->triangles[i][k]]);
            if (detail::overlap(own, box)) visitor(triangle, i);
        }
    }};
    return made(ContactShape::triangles(openSurface), "triangles", shared);
}

// As Python writes an argument; a long array by its shape.
std::string reprOf(const py::handle& argument) {
    if (!py::isinstance<py::array>(argument)) return py::repr(argument);
    const auto array = py::reinterpret_borrow<py::array>(argument);
    if (array.size() > maxShownNumbers)
        return fmt::format("<array of shape {}>", text(Shape(array.shape(), array.shape() + array.ndim())));
    return py::repr(array.attr("tolist")());
}

// As Python writes the call that made the shape.
std::string reprOf(const ShapeObject& shape) {
    std::string arguments;
    for (const py::handle& argument : py::tuple(shape.call[1]))
        arguments += (arguments.empty() ? "" : ", ") + reprOf(argument);
    return fmt::format("Shape.{}({})", shape.call[0].cast<std::string>(), arguments);
}

constexpr const char* sphereDoc = R"(sphere(radius) -> Shape

A sphere around the origin.

Raises ValueError unless the radius is above 0 and finite.

>>> import bilayer
>>> bilayer.Shape.sphere(0.5)
Shape.sphere(0.5)
)";

constexpr const char* boxDoc = R"(box(half_extents) -> Shape

A box around the origin. half_extents: three numbers above 0.

Raises ValueError for another shape or a number that is not above 0 and finite.

>>> import bilayer
>>> bilayer.Shape.box((1, 2, 3))
Shape.box([1.0, 2.0, 3.0])
)";

constexpr const char* capsuleDoc = R"(capsule(radius, half_height) -> Shape

A cylinder with half spheres at its ends. half_height: from the middle to the centre of either half sphere; 0: a sphere.

Raises ValueError unless the radius is above 0, the half height is 0 or above, and both are finite.

>>> import bilayer
>>> bilayer.Shape.capsule(0.5, 1)
Shape.capsule(0.5, 1.0)
)";

constexpr const char* cylinderDoc = R"(cylinder(radius, half_height) -> Shape

A cylinder around the origin, of twice the half height.

Raises ValueError unless both lengths are above 0 and finite.

>>> import bilayer
>>> bilayer.Shape.cylinder(0.5, 1)
Shape.cylinder(0.5, 1.0)
)";

constexpr const char* coneDoc = R"(cone(radius, half_height) -> Shape

A cone. The base lies at y = -half_height, the apex at +half_height.

Raises ValueError unless both lengths are above 0 and finite.

>>> import bilayer
>>> bilayer.Shape.cone(0.5, 1)
Shape.cone(0.5, 1.0)
)";

constexpr const char* hullDoc = R"(hull(points, radius=0) -> Shape

The convex hull of points of shape (N, 3), grown by a radius. The points are copied.

Raises ValueError if the points lie in one plane, for another shape, and for a value that is not finite.

>>> import bilayer
>>> bilayer.Shape.hull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
Shape.hull([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 0.0)
)";

constexpr const char* spheresDoc = R"(spheres(centres, radii) -> Shape

The convex hull of spheres. centres: shape (N, 3). radii: shape (N,), or a number. Both are copied. The time to make it
grows with the fourth power of N at worst: it suits up to a few hundred spheres.

Raises ValueError for other shapes, a negative radius, values that are not finite, and unless one radius is above 0.

>>> import bilayer
>>> bilayer.Shape.spheres([(0, 0, 0), (2, 0, 0)], [1, 0.5])
Shape.spheres([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], [1.0, 0.5])
)";

constexpr const char* planeDoc = R"(plane(normal, offset=0) -> Shape

The half-space of all x with x . normal / |normal| <= offset.

Raises ValueError for a normal of length 0 or another shape, and for values that are not finite.

>>> import bilayer
>>> bilayer.Shape.plane((0, 0, 1))
Shape.plane([0.0, 0.0, 1.0], 0.0)
)";

constexpr const char* trianglesDoc = R"(triangles(mesh) -> Shape

An open surface: both of its sides are outside. Contacts and distances test every triangle, so it suits small meshes.

Raises ValueError for a mesh without triangles, and what as_mesh() raises.

>>> import bilayer
>>> ground = bilayer.Mesh([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], [(0, 1, 2)])
>>> box = bilayer.box()
>>> body = bilayer.Collider(box, bilayer.build(box, resolution=16))
>>> bilayer.distance(bilayer.Shape.triangles(ground), None, body, bilayer.Pose((0, 0, 2))).distance
1.5
)";

constexpr const char* shapeDoc =
    R"(Shapes of bodies for collide(), distance() and time_of_impact(), made by the functions below.

Immutable: share one between bodies and threads. Arrays are copied. Lengths are in the unit of the colliders' meshes.
Capsules, cylinders and cones have y as their axis. At least one of two bodies is a Collider.

>>> import bilayer
>>> box = bilayer.box()
>>> body = bilayer.Collider(box, bilayer.build(box, resolution=16))
>>> bilayer.distance(bilayer.Shape.sphere(0.5), bilayer.Pose((2, 0, 0)), body, None).distance
1.0
)";

}  // namespace

void addShape(py::module_& module) {
    py::class_<ShapeObject> type(module, "Shape", shapeDoc);
    defineStatic(type, sphereDoc, makeSphere);
    defineStatic(type, boxDoc, makeBox);
    defineStatic(type, capsuleDoc, makeCapsule);
    defineStatic(type, cylinderDoc, makeCylinder);
    defineStatic(type, coneDoc, makeCone);
    defineStatic(type, hullDoc, makeHull);
    defineStatic(type, spheresDoc, makeSpheres);
    defineStatic(type, planeDoc, makePlane);
    defineStatic(type, trianglesDoc, makeTriangles);
    type.def("__reduce__", recipeOf)
        .def("__copy__", [](const ShapeObject& self) { return self; })
        .def(
            "__deepcopy__", [](const ShapeObject& self, const py::dict&) { return self; }, py::arg("memo"))
        .def("__repr__", [](const ShapeObject& self) { return reprOf(self); });
}

}  // namespace bilayer::python
