// SPDX-License-Identifier: Apache-2.0
// Field: queries of many points, rays, spheres and boxes at once.
#include <fmt/format.h>

#include <functional>
#include <glm/geometric.hpp>
#include <memory>
#include <optional>
#include <stdexcept>

#include <bilayer/collider/field.h>

#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"

namespace bilayer::python {
namespace {

constexpr std::array<std::pair<const char*, Storage>, 2> storages{
    {{"float32", Storage::float32}, {"fixed16", Storage::fixed16}}};
/// Tolerance of a unit quaternion's squared length: float32 quaternions that were multiplied are off by less.
constexpr float unitTolerance = 1e-3f;

// A hit as numpy sees it.
struct Hit {
    bool hit = false;
    float distance = std::numeric_limits<float>::infinity();
    glm::vec3 position{std::numeric_limits<float>::quiet_NaN()}, normal{std::numeric_limits<float>::quiet_NaN()};
    std::uint32_t triangle = noTriangle;
};

py::object sample(const Field& field, const py::object& object) {
    const Floats points(object, "points", {3});
    std::vector<Sample> samples(points.points().size());
    {
        const py::gil_scoped_release release;
        field.sample(points.points(), samples);
    }
    const Records<Sample> records(std::move(samples), points.shape());
    return result("Samples", records.member(&Sample::distance), records.member(&Sample::gradient),
                  records.member(&Sample::inBand));
}

py::object closest(const Field& field, const py::object& object, float maxDistance) {
    const Floats points(object, "points", {3});
    if (!(maxDistance >= 0))
        throw std::invalid_argument(fmt::format("max_distance is {}, and must be 0 or above", maxDistance));
    std::vector<ClosestPoint> answers(points.points().size());
    {
        const py::gil_scoped_release release;
        field.closest(points.points(), answers, maxDistance);
    }
    const Records<ClosestPoint> records(std::move(answers), points.shape());
    return result("ClosestPoints", records.member(&ClosestPoint::distance), records.member(&ClosestPoint::position),
                  records.member(&ClosestPoint::normal), records.member(&ClosestPoint::triangle),
                  records.member(&ClosestPoint::feature), records.member(&ClosestPoint::index),
                  records.member(&ClosestPoint::found));
}

// Calls ask(flags) without the GIL for an array of answers of this shape.
py::object flags(const Shape& shape, const std::function<void(std::span<bool>)>& ask) {
    py::array_t<bool> array(shape);
    const std::span<bool> answers(array.mutable_data(), std::size_t(array.size()));
    {
        const py::gil_scoped_release release;
        ask(answers);
    }
    return shape.empty() ? array[py::tuple()] : py::object(array);
}

py::object inside(const Field& field, const py::object& object) {
    const Floats points(object, "points", {3});
    return flags(points.shape(), [&](std::span<bool> answers) { field.inside(points.points(), answers); });
}

py::object hitsOf(const std::vector<std::optional<RayHit>>& found, const Shape& shape) {
    std::vector<Hit> hits(found.size());
    for (std::size_t i = 0; i < found.size(); ++i)
        if (const auto& hit = found[i]) hits[i] = {true, hit->distance, hit->position, hit->normal, hit->triangle};
    const Records<Hit> records(std::move(hits), shape);
    return result("Hits", records.member(&Hit::hit), records.member(&Hit::distance), records.member(&Hit::position),
                  records.member(&Hit::normal), records.member(&Hit::triangle));
}

struct Rays {
    Rays(const py::object& from, const py::object& along, const py::object& reach)
        : origins(from, "origins", {3}),
          directions(along, "directions", {3}),
          lengths(reach, "max_distance", {}, Range::positiveOrInfinite) {}

    // After broadcasting. Throws std::invalid_argument for a direction of zero length.
    std::vector<Ray> make() const {
        const auto from = origins.points(), along = directions.points();
        const auto reach = lengths.as<float>();
        std::vector<Ray> rays(from.size());
        for (std::size_t i = 0; i < rays.size(); ++i) {
            if (along[i] == glm::vec3(0))
                throw std::invalid_argument(fmt::format("directions: direction {} is zero", i));
            rays[i] = {from[i], along[i], reach[i]};
        }
        return rays;
    }

    Floats origins, directions, lengths;
};

py::object raycast(const Field& field, const py::object& origins, const py::object& directions,
                   const py::object& maxDistance) {
    Rays given(origins, directions, maxDistance);
    const Shape shape = broadcast({&given.origins, &given.directions, &given.lengths});
    std::vector<std::optional<RayHit>> hits;
    {
        const py::gil_scoped_release release;
        const std::vector<Ray> rays = given.make();
        hits.resize(rays.size());
        field.raycast(rays, hits);
    }
    return hitsOf(hits, shape);
}

py::object sphereCast(const Field& field, const py::object& origins, const py::object& directions,
                      const py::object& radii, const py::object& maxDistance) {
    Rays given(origins, directions, maxDistance);
    Floats radius(radii, "radii", {}, Range::nonNegative);
    const Shape shape = broadcast({&given.origins, &given.directions, &radius, &given.lengths});
    std::vector<std::optional<RayHit>> hits;
    {
        const py::gil_scoped_release release;
        const std::vector<Ray> rays = given.make();
        hits.resize(rays.size());
        field.sphereCast(rays, radius.as<float>(), hits);
    }
    return hitsOf(hits, shape);
}

py::object segment(const Field& field, const py::object& start, const py::object& end) {
    Floats from(start, "start", {3}), to(end, "end", {3});
    const Shape shape = broadcast({&from, &to});
    std::vector<std::optional<RayHit>> hits(from.points().size());
    {
        const py::gil_scoped_release release;
        field.segment(from.points(), to.points(), hits);
    }
    return hitsOf(hits, shape);
}

py::object overlapsSphere(const Field& field, const py::object& centres, const py::object& radii) {
    Floats centre(centres, "centres", {3}), radius(radii, "radii", {}, Range::nonNegative);
    const Shape shape = broadcast({&centre, &radius});
    return flags(shape,
                 [&](std::span<bool> answers) { field.overlapsSphere(centre.points(), radius.as<float>(), answers); });
}

py::object overlapsBox(const Field& field, const py::object& centres, const py::object& halfSizes,
                       const py::object& rotations) {
    Floats centre(centres, "centres", {3}), half(halfSizes, "half_sizes", {3}, Range::nonNegative);
    Floats rotation(rotations.is_none() ? py::object(py::make_tuple(1, 0, 0, 0)) : rotations, "rotations", {4});
    const Shape shape = broadcast({&centre, &half, &rotation});
    const auto quaternions = rotation.as<glm::vec4>();
    std::vector<OrientedBox> boxes(centre.points().size());
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        const glm::vec4& q = quaternions[i];
        if (std::abs(glm::dot(q, q) - 1) > unitTolerance)
            throw std::invalid_argument(fmt::format("rotations: quaternion {} is not of length 1", i));
        boxes[i] = {centre.points()[i], half.points()[i], glm::quat(q.x, q.y, q.z, q.w)};  // w, x, y, z
    }
    return flags(shape, [&](std::span<bool> answers) { field.overlapsBox(boxes, answers); });
}

Field makeField(const LevelSet& levelSet, const py::object& mesh, const std::string& storage) {
    const FieldOptions options{byWord(storages, storage, "storage")};
    if (mesh.is_none()) {
        const py::gil_scoped_release release;
        return Field(levelSet, options);
    }
    const SharedMesh shared = meshOf(mesh);
    const py::gil_scoped_release release;
    return Field(levelSet, *shared, options);
}

py::object meshOfField(const Field& field) {
    const Mesh* mesh = field.mesh();
    if (!mesh) return py::none();
    return py::cast(std::make_shared<Mesh>(*mesh));
}

constexpr const char* fieldDoc = R"(Field(level_set, mesh=None, storage="float32")

A level set laid out for queries, from any number of threads. With its mesh, closest points, rays and inside tests are
exact; without it they follow the trilinear interpolant.

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

}  // namespace

void addField(py::module_& module) {
    py::class_<Field>(module, "Field", fieldDoc)
        .def(py::init(&makeField), py::arg("level_set"), py::arg("mesh") = py::none(), py::arg("storage") = "float32")
        .def("sample", sample, py::arg("points"), sampleDoc)
        .def("closest", closest, py::arg("points"), py::arg("max_distance") = std::numeric_limits<float>::infinity(),
             closestDoc)
        .def("inside", inside, py::arg("points"),
             "inside(points) -> bool (...)\n\nWhether points (..., 3) are inside; exact with the mesh.")
        .def("raycast", raycast, py::arg("origins"), py::arg("directions"),
             py::arg("max_distance") = std::numeric_limits<float>::infinity(), raycastDoc)
        .def("sphere_cast", sphereCast, py::arg("origins"), py::arg("directions"), py::arg("radii"),
             py::arg("max_distance") = std::numeric_limits<float>::infinity(), sphereCastDoc)
        .def("segment", segment, py::arg("start"), py::arg("end"),
             "segment(start, end) -> Hits\n\nAs raycast(), along segments between points (..., 3).")
        .def("overlaps_sphere", overlapsSphere, py::arg("centres"), py::arg("radii"),
             "overlaps_sphere(centres, radii) -> bool (...)\n\nWhether spheres and the solid overlap. centres: (..., "
             "3); "
             "radii: (...), 0 or above.")
        .def("overlaps_box", overlapsBox, py::arg("centres"), py::arg("half_sizes"), py::arg("rotations") = py::none(),
             "overlaps_box(centres, half_sizes, rotations=None) -> bool (...)\n\nWhether boxes and the solid overlap. "
             "centres, half_sizes: (..., 3); rotations: unit quaternions w, x, y, z (..., 4).")
        .def_property_readonly("voxel_size", &Field::voxelSize, "Edge of a voxel, in the mesh's unit.")
        .def_property_readonly("exterior_width", &Field::exteriorWidth, "Width of the band outside.")
        .def_property_readonly("interior_width", &Field::interiorWidth, "Width of the band inside.")
        .def_property_readonly(
            "bounds", [](const Field& field) { return toArray(field.bounds()); },
            "float32 of shape (2, 3): of all points in the band.")
        .def_property_readonly("mesh", meshOfField, "A copy of the mesh, with faces outward; None without one.")
        .def_property_readonly("memory_bytes", &Field::memoryBytes, "Of samples and mesh.")
        .def("__copy__", [](const Field& self) { return self; })
        .def(
            "__deepcopy__", [](const Field& self, const py::dict&) { return self; }, py::arg("memo"))
        .def("__repr__", [](const Field& self) {
            return fmt::format("Field(voxels of {:g}, {} mesh)", self.voxelSize(), self.mesh() ? "with" : "without");
        });
}

}  // namespace bilayer::python
