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
#include "integration/python/define.h"
#include "integration/python/field_docs.h"
#include "integration/python/objects.h"
#include "integration/python/queries.h"
#include "integration/python/without_gil.h"
#include "sdf/base/unit_tolerance.h"

namespace bilayer::python {
namespace {

py::object sample(const FieldObject& field, const py::object& object) {
    const Floats points(object, "points", {3});
    std::vector<Sample> samples(points.points().size());
    answerInParts(samples.size(), group, [&](std::size_t begin, std::size_t end) {
        field.sample(points.points().subspan(begin, end - begin), std::span(samples).subspan(begin, end - begin));
    });
    return samplesOf(std::move(samples), points.shape());
}

// A limit for each point, or one for all of them, which is faster.
void closestOf(const FieldObject& field, std::span<const glm::vec3> points, std::span<const float> limits,
               std::span<ClosestPoint> answers) {
    if (limits.size() == 1) return field.closest(points, answers, limits[0]);
    for (std::size_t i = 0; i < points.size(); ++i) answers[i] = field.closest(points[i], limits[i]);
}

py::object closest(const FieldObject& field, const py::object& object, const py::object& maxDistance) {
    Floats points(object, "points", {3}), limits(maxDistance, "max_distance", {}, Range::nonNegativeOrInfinite);
    const bool one = limits.shape().empty();
    const Shape shape = one ? points.shape() : broadcast({&points, &limits});
    std::vector<ClosestPoint> answers(points.points().size());
    answerInParts(answers.size(), group, [&](std::size_t begin, std::size_t end) {
        const auto reach = limits.as<float>();
        const auto found = std::span(answers).subspan(begin, end - begin);
        closestOf(field, points.points().subspan(begin, end - begin), one ? reach : reach.subspan(begin, end - begin),
                  found);
        clearMissing(found);
    });
    return closestPointsOf(std::move(answers), shape);
}

py::object inside(const FieldObject& field, const py::object& object) {
    const Floats points(object, "points", {3});
    return flags(points.shape(), [&](std::size_t begin, std::size_t count, std::span<bool> answers) {
        field.inside(points.points().subspan(begin, count), answers);
    });
}

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
                throw std::invalid_argument(
                    fmt::format("{} is a quaternion of length {:g}, and must be one of length 1{}", rotation.place(i),
                                glm::length(q), rotation.shapeText()));
            boxes[k] = {centre.points()[i], half.points()[i], glm::quat(q.x, q.y, q.z, q.w)};  // w, x, y, z
        }
        field.overlapsBox(boxes, answers);
    });
}

FieldObject makeField(const py::object& levelSet, const py::object& mesh, const std::string& storage,
                      bool keepLevelSet) {
    requireOrder(levelSet, mesh, "Field(level_set, mesh)");
    const auto& distances = argument<const LevelSet&>(levelSet, "level_set");
    const FieldOptions options{byWord(storages, storage, "storage")};
    const SharedMesh shared = mesh.is_none() ? nullptr : meshOf(mesh, "mesh");
    const auto make = [&] {
        const WithoutGil release;
        return shared ? Field(distances, *shared, options) : Field(distances, options);
    };
    FieldObject field{make(), py::tuple(), distances.origin()};
    if (keepLevelSet) {
        field.recipe = py::make_tuple(py::type::of<FieldObject>(), py::make_tuple(distances, shared, storage));
        field.keptBytes = distances.memoryBytes();
    }
    return field;
}

py::tuple reduced(const FieldObject& field) {
    if (field.recipe.empty()) throw py::type_error("a Field made with keep_level_set=False cannot be pickled");
    return field.recipe;
}

py::object meshOfField(const FieldObject& field) {
    const Mesh* mesh = field.mesh();
    if (!mesh) return py::none();
    SharedMesh copy;
    {
        const WithoutGil release;
        copy = std::make_shared<Mesh>(*mesh);
    }
    return py::cast(copy);
}

}  // namespace

void addField(py::module_& module) {
    py::class_<FieldObject> type(module, "Field", fieldDoc);
    defineConstructor(type, fieldDoc, makeField);
    defineMethod(type, sampleDoc, sample);
    defineMethod(type, closestDoc, closest);
    defineMethod(type, insideDoc, inside);
    defineMethod(type, raycastDoc, raycast);
    defineMethod(type, sphereCastDoc, sphereCast);
    defineMethod(type, segmentDoc, segment);
    defineMethod(type, overlapsSphereDoc, overlapsSphere);
    defineMethod(type, overlapsBoxDoc, overlapsBox);
    type.def_property_readonly(
            "voxel_size", [](const FieldObject& self) { return self.voxelSize(); },
            "Edge of a voxel, in the mesh's unit.")
        .def_property_readonly(
            "origin", [](const FieldObject& self) { return toArray(self.origin); },
            "float64 of shape (3,): LevelSet.origin. Points of the world minus this are those of queries.")
        .def_property_readonly(
            "exterior_width", [](const FieldObject& self) { return self.exteriorWidth(); },
            "Width of the band outside.")
        .def_property_readonly(
            "interior_width", [](const FieldObject& self) { return self.interiorWidth(); }, "Width of the band inside.")
        .def_property_readonly(
            "bounds", [](const FieldObject& field) { return toArray(field.bounds()); },
            "float32 of shape (2, 3): lower and upper corner of the band, relative to `origin`.")
        .def_property_readonly("mesh", meshOfField, "A copy of the mesh, with faces outward; None without one.")
        .def_property_readonly(
            "memory_bytes", [](const FieldObject& self) { return self.memoryBytes() + self.keptBytes; },
            "Memory of the samples, the mesh and its hierarchies, and of the level set that is kept for pickles, in "
            "bytes.")
        .def("__reduce__", reduced)
        .def("__copy__", [](const FieldObject& self) { return self; })
        .def(
            "__deepcopy__", [](const FieldObject& self, const py::dict&) { return self; }, py::arg("memo"))
        .def("__repr__", [](const FieldObject& self) {
            return fmt::format("Field(voxels of {:g}, {} mesh)", self.voxelSize(), self.mesh() ? "with" : "without");
        });
}

}  // namespace bilayer::python
