// SPDX-License-Identifier: Apache-2.0
// Field: queries of many points, rays, spheres and boxes at once.
#include <fmt/format.h>

#include <glm/geometric.hpp>
#include <memory>
#include <optional>
#include <stdexcept>

#include <bilayer/collider/field.h>

#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"
#include "integration/python/cancellable.h"
#include "integration/python/objects.h"
#include "sdf/base/unit_tolerance.h"

namespace bilayer::python {
namespace {

constexpr std::array<std::pair<const char*, Storage>, 2> storages{
    {{"float32", Storage::float32}, {"fixed16", Storage::fixed16}}};
/// Queries of a part of a batch. Closest points are found in groups of 64, which parts must not cut: any of several
/// equally close features may be the answer, and it must be the library's.
constexpr std::size_t part = 1024;

// A hit as numpy sees it.
struct Hit {
    bool hit = false;
    float distance = std::numeric_limits<float>::infinity();
    glm::vec3 position{std::numeric_limits<float>::quiet_NaN()}, normal{std::numeric_limits<float>::quiet_NaN()};
    std::uint32_t triangle = noTriangle;
};

py::object sample(const FieldObject& field, const py::object& object) {
    const Floats points(object, "points", {3});
    std::vector<Sample> samples(points.points().size());
    answerInParts(samples.size(), part, [&](std::size_t begin, std::size_t end) {
        field.sample(points.points().subspan(begin, end - begin), std::span(samples).subspan(begin, end - begin));
    });
    const Records<Sample> records(std::move(samples), points.shape());
    return result("Samples", records.member(&Sample::distance), records.member(&Sample::gradient),
                  records.member(&Sample::inBand));
}

py::object closest(const FieldObject& field, const py::object& object, float maxDistance) {
    const Floats points(object, "points", {3});
    if (!(maxDistance >= 0))
        throw std::invalid_argument(fmt::format("max_distance is {}, and must be 0 or above", maxDistance));
    std::vector<ClosestPoint> answers(points.points().size());
    answerInParts(answers.size(), part, [&](std::size_t begin, std::size_t end) {
        field.closest(points.points().subspan(begin, end - begin), std::span(answers).subspan(begin, end - begin),
                      maxDistance);
    });
    const Records<ClosestPoint> records(std::move(answers), points.shape());
    return result("ClosestPoints", records.member(&ClosestPoint::distance), records.member(&ClosestPoint::position),
                  records.member(&ClosestPoint::normal), records.member(&ClosestPoint::triangle),
                  records.member(&ClosestPoint::feature), records.member(&ClosestPoint::index),
                  records.member(&ClosestPoint::found));
}

// An array of the answers of a batch of yes-or-no questions, of this shape. Calls ask(begin, count, answers).
template <class Ask>
py::object flags(const Shape& shape, const Ask& ask) {
    py::array_t<bool> array(shape);
    bool* const answers = array.mutable_data();
    answerInParts(std::size_t(array.size()), part, [&](std::size_t begin, std::size_t end) {
        ask(begin, end - begin, std::span(answers + begin, end - begin));
    });
    return shape.empty() ? array[py::tuple()] : py::object(array);
}

py::object inside(const FieldObject& field, const py::object& object) {
    const Floats points(object, "points", {3});
    return flags(points.shape(), [&](std::size_t begin, std::size_t count, std::span<bool> answers) {
        field.inside(points.points().subspan(begin, count), answers);
    });
}

// The hits of a batch of casts, of this shape. Calls cast(begin, count, hits).
template <class Cast>
py::object hits(const Shape& shape, std::size_t count, const Cast& cast) {
    std::vector<Hit> all(count);
    answerInParts(count, part, [&](std::size_t begin, std::size_t end) {
        std::vector<std::optional<RayHit>> found(end - begin);
        cast(begin, end - begin, std::span(found));
        for (std::size_t i = begin; i < end; ++i)
            if (const auto& hit = found[i - begin])
                all[i] = {true, hit->distance, hit->position, hit->normal, hit->triangle};
    });
    const Records<Hit> records(std::move(all), shape);
    return result("Hits", records.member(&Hit::hit), records.member(&Hit::distance), records.member(&Hit::position),
                  records.member(&Hit::normal), records.member(&Hit::triangle));
}

struct Rays {
    Rays(const py::object& from, const py::object& along, const py::object& reach)
        : origins(from, "origins", {3}),
          directions(along, "directions", {3}),
          lengths(reach, "max_distance", {}, Range::positiveOrInfinite) {}

    // Some rays, after broadcasting. Throws std::invalid_argument for a direction of zero length.
    std::vector<Ray> make(std::size_t begin, std::size_t count) const {
        const auto from = origins.points(), along = directions.points();
        const auto reach = lengths.as<float>();
        std::vector<Ray> rays(count);
        for (std::size_t k = 0; k < count; ++k) {
            const std::size_t i = begin + k;
            if (along[i] == glm::vec3(0))
                throw std::invalid_argument(fmt::format("directions: direction {} is zero", i));
            rays[k] = {from[i], along[i], reach[i]};
        }
        return rays;
    }

    Floats origins, directions, lengths;
};

py::object raycast(const FieldObject& field, const py::object& origins, const py::object& directions,
                   const py::object& maxDistance) {
    Rays rays(origins, directions, maxDistance);
    const Shape shape = broadcast({&rays.origins, &rays.directions, &rays.lengths});
    return hits(shape, rays.origins.points().size(), [&](std::size_t begin, std::size_t count, auto found) {
        field.raycast(rays.make(begin, count), found);
    });
}

py::object sphereCast(const FieldObject& field, const py::object& origins, const py::object& directions,
                      const py::object& radii, const py::object& maxDistance) {
    Rays rays(origins, directions, maxDistance);
    Floats radius(radii, "radii", {}, Range::nonNegative);
    const Shape shape = broadcast({&rays.origins, &rays.directions, &radius, &rays.lengths});
    return hits(shape, rays.origins.points().size(), [&](std::size_t begin, std::size_t count, auto found) {
        field.sphereCast(rays.make(begin, count), radius.as<float>().subspan(begin, count), found);
    });
}

py::object segment(const FieldObject& field, const py::object& start, const py::object& end) {
    Floats from(start, "start", {3}), to(end, "end", {3});
    const Shape shape = broadcast({&from, &to});
    return hits(shape, from.points().size(), [&](std::size_t begin, std::size_t count, auto found) {
        field.segment(from.points().subspan(begin, count), to.points().subspan(begin, count), found);
    });
}

py::object overlapsSphere(const FieldObject& field, const py::object& centres, const py::object& radii) {
    Floats centre(centres, "centres", {3}), radius(radii, "radii", {}, Range::nonNegative);
    const Shape shape = broadcast({&centre, &radius});
    return flags(shape, [&](std::size_t begin, std::size_t count, std::span<bool> answers) {
        field.overlapsSphere(centre.points().subspan(begin, count), radius.as<float>().subspan(begin, count), answers);
    });
}

py::object overlapsBox(const FieldObject& field, const py::object& centres, const py::object& halfSizes,
                       const py::object& rotations) {
    Floats centre(centres, "centres", {3}), half(halfSizes, "half_sizes", {3}, Range::nonNegative);
    Floats rotation(rotations.is_none() ? py::object(py::make_tuple(1, 0, 0, 0)) : rotations, "rotations", {4});
    const Shape shape = broadcast({&centre, &half, &rotation});
    const auto quaternions = rotation.as<glm::vec4>();
    return flags(shape, [&](std::size_t begin, std::size_t count, std::span<bool> answers) {
        std::vector<OrientedBox> boxes(count);
        for (std::size_t k = 0; k < count; ++k) {
            const std::size_t i = begin + k;
            const glm::vec4& q = quaternions[i];
            if (std::abs(glm::dot(q, q) - 1) > detail::unitTolerance)
                throw std::invalid_argument(fmt::format("rotations: quaternion {} is not of length 1", i));
            boxes[k] = {centre.points()[i], half.points()[i], glm::quat(q.x, q.y, q.z, q.w)};  // w, x, y, z
        }
        field.overlapsBox(boxes, answers);
    });
}

FieldObject makeField(const LevelSet& levelSet, const py::object& mesh, const std::string& storage) {
    const FieldOptions options{byWord(storages, storage, "storage")};
    const SharedMesh shared = mesh.is_none() ? nullptr : meshOf(mesh);
    const py::tuple recipe = py::make_tuple(py::type::of<FieldObject>(), py::make_tuple(levelSet, shared, storage));
    const auto make = [&] {
        const py::gil_scoped_release release;
        return shared ? Field(levelSet, *shared, options) : Field(levelSet, options);
    };
    return {make(), recipe};
}

py::object meshOfField(const FieldObject& field) {
    const Mesh* mesh = field.mesh();
    if (!mesh) return py::none();
    SharedMesh copy;
    {
        const py::gil_scoped_release release;
        copy = std::make_shared<Mesh>(*mesh);
    }
    return py::cast(copy);
}

constexpr const char* fieldDoc = R"(Field(level_set, mesh=None, storage="float32")

A level set laid out for queries, from any number of threads. With its mesh, closest points, rays and inside tests are
exact; without it they follow the trilinear interpolant. Large batches run on all cores, and Ctrl-C cancels them.
Pickles hold the level set and the mesh.

mesh: the Mesh that the level set was built from, or None.
storage: "float32", or "fixed16" for half the memory and an error below 5e-5 voxels.

Arguments are arrays of any real dtype, or nested lists. Points may have any leading shape: (3,), (N, 3), (H, W, 3), and
results have the same. Coordinates are relative to LevelSet.origin. Results are arrays that share one buffer: use
numpy.ascontiguousarray() where a contiguous one is needed.

Raises ValueError if the level set belongs to another mesh. Queries raise ValueError that names the argument for a wrong
shape or dtype, and for a value that is not finite.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> field.sample([[1.1, 0, 0], [0.9, 0, 0]]).distance.round(3).tolist()
[0.10000000149011612, -0.10000000149011612]
)";

constexpr const char* sampleDoc = R"(sample(points) -> Samples(distance, gradient, in_band)

Trilinear samples. points: (..., 3).

distance: float32 (...); outside the band a bound with the right sign.
gradient: float32 (..., 3), of length near 1; zero outside the band.
in_band: bool (...), whether all eight voxels around the point are in the band.

>>> import bilayer
>>> field = bilayer.Field(bilayer.build(bilayer.box((2, 2, 2)), resolution=32))
>>> field.sample([1.1, 0, 0]).gradient.round(3).tolist()
[1.0, 0.0, 0.0]
)";

constexpr const char* closestDoc = R"(closest(points, max_distance=inf) -> ClosestPoints

The closest point of the surface, from any distance. points: (..., 3).

distance: float32 (...), negative inside.
position, normal: float32 (..., 3).
triangle: int32 (...), index of the face; -1 without a mesh.
feature: uint8 (...): 0 face, 1 edge, 2 vertex; feature_index: uint8 (...), of that edge or corner in the face.
found: bool (...), False where the surface is farther than max_distance; the other members are then invalid.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> float(field.closest([5, 0.1, 0.2]).distance)
4.0
)";

constexpr const char* raycastDoc =
    R"(raycast(origins, directions, max_distance=inf) -> Hits(hit, distance, position, normal, triangle)

The first point of each ray inside the solid. Arguments are broadcast against each other.

origins, directions: (..., 3); directions of any non-zero length.
max_distance: (...), 0 or above.
hit: bool (...); distance: float32 (...), inf without a hit; position, normal: float32 (..., 3), nan without a hit;
triangle: int32 (...), -1 where there is none.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> field.raycast([5, 0, 0], [[-1, 0, 0], [1, 0, 0]]).distance.tolist()
[4.0, inf]
)";

constexpr const char* sphereCastDoc = R"(sphere_cast(origins, directions, radii, max_distance=inf) -> Hits

The first contact of a sphere that moves along each ray; as raycast(). distance is the path length of its centre.

radii: (...), 0 or above.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> round(float(field.sphere_cast([5, 0, 0], [-1, 0, 0], 0.5).distance), 4)
3.5
)";

constexpr const char* insideDoc = R"(inside(points) -> bool (...)

Whether points (..., 3) are inside; exact with the mesh.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> field.inside([[0, 0, 0.99], [0, 0, 1.01]]).tolist()
[True, False]
)";

constexpr const char* segmentDoc = R"(segment(start, end) -> Hits

As raycast(), along segments between points (..., 3). distance is the path length from the start.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> field.segment([5, 0, 0], [[0, 0, 0], [2, 0, 0]]).hit.tolist()
[True, False]
)";

constexpr const char* overlapsSphereDoc = R"(overlaps_sphere(centres, radii) -> bool (...)

Whether spheres and the solid overlap. centres: (..., 3); radii: (...), 0 or above.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> field.overlaps_sphere([2, 0, 0], [0.9, 1.1]).tolist()
[False, True]
)";

constexpr const char* overlapsBoxDoc = R"(overlaps_box(centres, half_sizes, rotations=None) -> bool (...)

Whether boxes and the solid overlap. centres, half_sizes: (..., 3), half sizes 0 or above; rotations: unit quaternions
w, x, y, z (..., 4), or None.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> field.overlaps_box([2, 0, 0], [[0.9, 1, 1], [1.1, 1, 1]]).tolist()
[False, True]
)";

}  // namespace

void addField(py::module_& module) {
    py::class_<FieldObject>(module, "Field", fieldDoc)
        .def(py::init(&makeField), py::arg("level_set"), py::arg("mesh") = py::none(), py::arg("storage") = "float32")
        .def("sample", sample, py::arg("points"), sampleDoc)
        .def("closest", closest, py::arg("points"), py::arg("max_distance") = std::numeric_limits<float>::infinity(),
             closestDoc)
        .def("inside", inside, py::arg("points"), insideDoc)
        .def("raycast", raycast, py::arg("origins"), py::arg("directions"),
             py::arg("max_distance") = std::numeric_limits<float>::infinity(), raycastDoc)
        .def("sphere_cast", sphereCast, py::arg("origins"), py::arg("directions"), py::arg("radii"),
             py::arg("max_distance") = std::numeric_limits<float>::infinity(), sphereCastDoc)
        .def("segment", segment, py::arg("start"), py::arg("end"), segmentDoc)
        .def("overlaps_sphere", overlapsSphere, py::arg("centres"), py::arg("radii"), overlapsSphereDoc)
        .def("overlaps_box", overlapsBox, py::arg("centres"), py::arg("half_sizes"), py::arg("rotations") = py::none(),
             overlapsBoxDoc)
        .def_property_readonly(
            "voxel_size", [](const FieldObject& self) { return self.voxelSize(); },
            "Edge of a voxel, in the mesh's unit.")
        .def_property_readonly(
            "exterior_width", [](const FieldObject& self) { return self.exteriorWidth(); },
            "Width of the band outside.")
        .def_property_readonly(
            "interior_width", [](const FieldObject& self) { return self.interiorWidth(); }, "Width of the band inside.")
        .def_property_readonly(
            "bounds", [](const FieldObject& field) { return toArray(field.bounds()); },
            "float32 of shape (2, 3): of all points in the band.")
        .def_property_readonly("mesh", meshOfField, "A copy of the mesh, with faces outward; None without one.")
        .def_property_readonly(
            "memory_bytes", [](const FieldObject& self) { return self.memoryBytes(); }, "Of samples and mesh.")
        .def("__reduce__", [](const FieldObject& self) { return self.recipe; })
        .def("__copy__", [](const FieldObject& self) { return self; })
        .def(
            "__deepcopy__", [](const FieldObject& self, const py::dict&) { return self; }, py::arg("memo"))
        .def("__repr__", [](const FieldObject& self) {
            return fmt::format("Field(voxels of {:g}, {} mesh)", self.voxelSize(), self.mesh() ? "with" : "without");
        });
}

}  // namespace bilayer::python
