// SPDX-License-Identifier: Apache-2.0
// Pose: position and orientation of a body.
#include <bilayer/collider/pose.h>

#include <fmt/format.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <stdexcept>

#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"
#include "integration/python/define.h"
#include "integration/python/without_gil.h"
#include "sdf/base/unit_tolerance.h"

namespace bilayer::python {
namespace {

Pose makePose(const py::object& position, const py::object& rotation) {
    const glm::vec3 place = vector(position, "position");
    const Floats numbers(rotation, "rotation", {4}, Range::finite, Items::one);
    const auto q = numbers.as<float>();
    const glm::quat quaternion(q[0], q[1], q[2], q[3]);
    if (std::abs(glm::dot(quaternion, quaternion) - 1) > detail::unitTolerance)
        throw std::invalid_argument(fmt::format(
            "rotation: expected a quaternion w, x, y, z of length 1, got one of length {:g}", glm::length(quaternion)));
    const bool unit = glm::dot(quaternion, quaternion) == 1;  // to the bit through pickles
    return {place, unit ? quaternion : glm::normalize(quaternion)};
}

Pose inverse(const Pose& pose) {
    return relative(pose, {});
}

Pose product(const Pose& a, const Pose& b) {
    return {a.toWorld(b.position), glm::normalize(a.rotation * b.rotation)};
}

// Equal poses have equal hashes; 0 and -0 are equal.
py::ssize_t hashOf(const Pose& pose) {
    const auto number = [](float value) { return value + 0.f; };
    const glm::vec3& p = pose.position;
    const glm::quat& q = pose.rotation;
    return py::hash(
        py::make_tuple(number(p.x), number(p.y), number(p.z), number(q.w), number(q.x), number(q.y), number(q.z)));
}

py::array_t<float> rotationOf(const Pose& pose) {
    const glm::quat& q = pose.rotation;
    const float numbers[] = {q.w, q.x, q.y, q.z};
    return py::array_t<float>(4, numbers);
}

py::array_t<float> matrixOf(const Pose& pose) {
    const glm::mat3 axes = glm::mat3_cast(pose.rotation);
    py::array_t<float> matrix({4, 4});
    auto m = matrix.mutable_unchecked<2>();
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) m(row, column) = axes[column][row];
        m(row, 3) = pose.position[row];
        m(3, row) = 0;
    }
    m(3, 3) = 1;
    return matrix;
}

template <class Map>
py::object mapped(const py::object& object, Map map) {
    const Floats points(object, "points", {3});
    Shape shape = points.shape();
    shape.push_back(3);
    py::array_t<float> result(shape);
    auto* to = reinterpret_cast<glm::vec3*>(result.mutable_data());
    {
        const WithoutGil release;
        for (const glm::vec3& point : points.points()) *to++ = map(point);
    }
    return result;
}

// Restores a pose to the bit, without the normalization of a new one.
Pose unpackedPose(const py::object& packed) {
    const Floats numbers(packed, "packed", {7}, Range::finite, Items::one);
    const auto n = numbers.as<float>();
    return {{n[0], n[1], n[2]}, glm::quat(n[3], n[4], n[5], n[6])};
}

constexpr const char* poseDoc = R"(Pose(position=(0, 0, 0), rotation=(1, 0, 0, 0))

An immutable rigid transform: body coordinates x map to rotation * x + position in the world.

position: three numbers, in the unit of the meshes.
rotation: a unit quaternion w, x, y, z.

Where functions take a pose, they also take a matrix of shape (4, 4), or None for the identity. Body coordinates are
those of Mesh.vertices, without Mesh.origin. `a @ b` applies b first, then a.

Raises ValueError for another shape, a value that is not finite, and a quaternion that is not of length 1.

>>> import bilayer
>>> bilayer.Pose((1, 2, 3)).to_world([0, 0, 1]).tolist()
[1.0, 2.0, 4.0]
)";

constexpr const char* fromMatrixDoc = R"(from_matrix(matrix) -> Pose

The pose of a matrix of a rotation and a translation, real numbers of shape (4, 4).

Raises ValueError for another shape, a scale or a reflection, and a last row other than 0 0 0 1.

>>> import bilayer, numpy
>>> bilayer.Pose.from_matrix(numpy.eye(4)) == bilayer.Pose()
True
)";

constexpr const char* toWorldDoc = R"(to_world(points) -> float32 (..., 3)

Maps points (..., 3) of the body to the world.

Raises ValueError for another shape, and for a value that is not finite.

>>> import bilayer
>>> bilayer.Pose((1, 2, 3)).to_world([[0, 0, 0], [1, 0, 0]]).tolist()
[[1.0, 2.0, 3.0], [2.0, 2.0, 3.0]]
)";

constexpr const char* toBodyDoc = R"(to_body(points) -> float32 (..., 3)

Maps points (..., 3) of the world to the body.

Raises ValueError for another shape, and for a value that is not finite.

>>> import bilayer
>>> bilayer.Pose((1, 2, 3)).to_body([1, 2, 4]).tolist()
[0.0, 0.0, 1.0]
)";

constexpr const char* inverseDoc = R"(inverse() -> Pose

The pose of the world in the body's coordinates: pose @ pose.inverse() is the identity.

>>> import bilayer
>>> bilayer.Pose((1, 2, 3)).inverse().position.tolist()
[-1.0, -2.0, -3.0]
)";

}  // namespace

void addPose(py::module_& module) {
    py::class_<Pose> type(module, "Pose", poseDoc);
    defineConstructor(type, poseDoc, makePose);
    defineStatic(type, fromMatrixDoc, [](const py::object& matrix) { return poseOf(matrix, "matrix"); });
    defineMethod(type, toWorldDoc, [](const Pose& self, const py::object& points) {
        return mapped(points, [&](const glm::vec3& point) { return self.toWorld(point); });
    });
    defineMethod(type, toBodyDoc, [](const Pose& self, const py::object& points) {
        return mapped(points, [&](const glm::vec3& point) { return self.toBody(point); });
    });
    defineMethod(type, inverseDoc, inverse);
    type.def_property_readonly(
            "position", [](const Pose& pose) { return toArray(pose.position); }, "float32 of shape (3,).")
        .def_property_readonly("rotation", rotationOf, "float32 of shape (4,): a unit quaternion w, x, y, z.")
        .def_property_readonly("matrix", matrixOf, "float32 of shape (4, 4).")
        .def("__matmul__", product, py::is_operator())
        .def("__hash__", hashOf)
        .def(
            "__eq__", [](const Pose& a, const Pose& b) { return a.position == b.position && a.rotation == b.rotation; },
            py::is_operator())
        .def("__copy__", [](const Pose& self) { return self; })
        .def(
            "__deepcopy__", [](const Pose& self, const py::dict&) { return self; }, py::arg("memo"))
        .def("__repr__", [](const Pose& pose) {
            const glm::vec3& p = pose.position;
            const glm::quat& q = pose.rotation;
            return fmt::format("Pose(({}, {}, {}), ({}, {}, {}, {}))", p.x, p.y, p.z, q.w, q.x, q.y, q.z);
        });
    defineReduce(type, "_unpacked(packed) -> Pose", unpackedPose, [](const Pose& pose) {
        const glm::vec3& p = pose.position;
        const glm::quat& q = pose.rotation;
        return py::make_tuple(p.x, p.y, p.z, q.w, q.x, q.y, q.z);
    });
}

}  // namespace bilayer::python
