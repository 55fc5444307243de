// SPDX-License-Identifier: Apache-2.0
// TiledField: queries of the tiles that `bilayer build --tiles` wrote, within a budget of memory.
#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/options.h>

#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"
#include "integration/python/cancellable.h"
#include "integration/python/define.h"
#include "integration/python/queries.h"
#include "integration/python/tiled_field_docs.h"
#include "integration/python/without_gil.h"
#include "sdf/tiles/tile_manifest.h"

namespace bilayer::python {
namespace {

/// Points of a batch that read each tile at most once; Ctrl-C is looked for after each of these [points].
constexpr std::size_t pointsPerBatch = 1 << 20;

struct TiledFieldObject : TiledField {
    glm::dvec3 origin;  ///< of the level set: world coordinates of the coordinates' zero
};

std::vector<Sample> samplesAt(const TiledFieldObject& field, std::span<const glm::vec3> points) {
    return cancellable(py::none(), [&](const ProgressCallback& progressCallback) {
        std::vector<Sample> samples(points.size());
        for (std::size_t i = 0; i < points.size(); i += pointsPerBatch) {
            if (!progressCallback(float(i) / float(points.size()))) throw Cancelled();
            const std::size_t count = std::min(pointsPerBatch, points.size() - i);
            field.sample(points.subspan(i, count), std::span(samples).subspan(i, count));
        }
        return samples;
    });
}

py::object sampleTiled(const TiledFieldObject& field, const py::object& object) {
    const Floats points(object, "points", {3});
    return samplesOf(samplesAt(field, points.points()), points.shape());
}

py::object insideTiled(const TiledFieldObject& field, const py::object& object) {
    const Floats points(object, "points", {3});
    const std::vector<Sample> samples = samplesAt(field, points.points());
    py::array_t<bool> array(points.shape());
    std::transform(samples.begin(), samples.end(), array.mutable_data(),
                   [](const Sample& s) { return s.distance < 0; });
    return points.shape().empty() ? array[py::tuple()] : py::object(array);
}

py::object closestTiled(const TiledFieldObject& field, const py::object& object, const py::object& maxDistance) {
    Floats points(object, "points", {3}), limits(maxDistance, "max_distance", {}, Range::nonNegativeOrInfinite);
    const Shape shape = broadcast({&points, &limits});
    std::vector<ClosestPoint> answers(points.points().size());
    answerInParts(answers.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) answers[i] = field.closest(points.points()[i], limits.as<float>()[i]);
    });
    clearMissing(answers);
    return closestPointsOf(std::move(answers), shape);
}

py::object raycastTiled(const TiledFieldObject& field, const py::object& origins, const py::object& directions,
                        const py::object& maxDistance) {
    Rays rays(origins, directions, maxDistance);
    const Shape shape = broadcast({&rays.origins, &rays.directions, &rays.lengths});
    return hits(shape, rays.origins.points().size(), [&](std::size_t begin, std::size_t count, auto found) {
        const std::vector<Ray> some = rays.make(begin, count);
        std::transform(some.begin(), some.end(), found.begin(), [&](const Ray& ray) { return field.raycast(ray); });
    });
}

TiledFieldObject makeTiledField(const Path& folder, std::uint64_t budget, const std::string& storage) {
    const FieldOptions options{byWord(storages, storage, "storage")};
    const WithoutGil release;
    return {TiledField(folder.text, std::size_t(budget), options), detail::readTileManifest(folder.text).origin};
}

}  // namespace

void addTiledField(py::module_& module) {
    py::class_<TiledFieldObject> type(module, "TiledField", tiledFieldDoc);
    defineConstructor(type, tiledFieldDoc, makeTiledField);
    defineMethod(type, tiledSampleDoc, sampleTiled);
    defineMethod(type, tiledClosestDoc, closestTiled);
    defineMethod(type, tiledInsideDoc, insideTiled);
    defineMethod(type, tiledRaycastDoc, raycastTiled);
    type.def_property_readonly(
            "voxel_size", [](const TiledFieldObject& self) { return self.voxelSize(); },
            "Edge of a voxel, in the mesh's unit.")
        .def_property_readonly(
            "origin", [](const TiledFieldObject& self) { return toArray(self.origin); },
            "float64 of shape (3,): LevelSet.origin. Points of the world minus this are those of queries.")
        .def_property_readonly(
            "exterior_width", [](const TiledFieldObject& self) { return self.exteriorWidth(); },
            "Width of the band outside.")
        .def_property_readonly(
            "interior_width", [](const TiledFieldObject& self) { return self.interiorWidth(); },
            "Width of the band inside.")
        .def_property_readonly(
            "bounds", [](const TiledFieldObject& self) { return toArray(self.bounds()); },
            "float32 of shape (2, 3): lower and upper corner of the band, relative to `origin`.")
        .def_property_readonly(
            "tile_count", [](const TiledFieldObject& self) { return self.tileCount(); },
            "Number of tiles, those without a file included.")
        .def_property_readonly(
            "tiles_read", [](const TiledFieldObject& self) { return self.tilesRead(); },
            "Number of tiles that were read since the folder was opened.")
        .def_property_readonly(
            "memory_bytes", [](const TiledFieldObject& self) { return self.memoryBytes(); },
            "Memory of the tiles that are kept and of the coarse cells of all tiles, in bytes.")
        .def("__repr__", [](const TiledFieldObject& self) {
            return fmt::format("TiledField({} tiles with voxels of {:g})", self.tileCount(), self.voxelSize());
        });
}

}  // namespace bilayer::python
