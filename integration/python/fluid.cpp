// SPDX-License-Identifier: Apache-2.0
// seed(), particles(), obstacle(): liquids and moving solids.
#include <fmt/format.h>
#include <openvdb/tools/Dense.h>

#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>

#include <bilayer/integration/fluid/obstacle.h>
#include <bilayer/integration/fluid/particles.h>
#include <bilayer/integration/fluid/seed.h>
#include <bilayer/sdf/grids.h>

#include "integration/fluid/detail/liquid_copy.h"
#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"
#include "integration/python/cancellable.h"
#include "integration/python/define.h"
#include "integration/python/grid_bytes.h"
#include "integration/python/objects.h"
#include "integration/python/without_gil.h"
#include "sdf/base/openvdb.h"

namespace bilayer::python {
namespace {

using openvdb::math::Transform;

constexpr std::array<std::pair<const char*, fluid::SeedMode>, 3> modes{{{"unite", fluid::SeedMode::unite},
                                                                        {"intersect", fluid::SeedMode::intersect},
                                                                        {"subtract", fluid::SeedMode::subtract}}};

fluid::Placement placementOf(const py::object& pose, const py::object& scale) {
    Floats factors(scale, "scale", {}, Range::finite);
    if (!factors.shape().empty() && factors.shape() != Shape{3})
        throw std::invalid_argument("scale: expected one number or three, got shape " + text(factors.shape()));
    factors.broadcast({3});
    const auto f = factors.as<float>();
    for (const float factor : f) requirePositive(factor, "scale");
    return {poseOf(pose, "pose"), glm::vec3(f[0], f[1], f[2])};
}

LevelSet withoutOrigin(const LevelSet& levelSet) {
    openvdb::MetaMap all(*levelSet.grids().distance);
    all.removeMeta(metadata::origin);
    auto grids = std::make_shared<Grids>();
    grids->distance = levelSet.grids().distance->copyReplacingMetadata(all);
    return LevelSet(std::move(grids));
}

// A LevelSet, or a mesh of any kind. It is placed, scaled and rotated in its own coordinates, without its origin: those
// of the world may be too far from zero for floats.
class SolidArgument {
  public:
    SolidArgument(const py::object& solid, const char* name)
        : levelSet_(py::isinstance<LevelSet>(solid) ? solid.cast<const LevelSet*>() : nullptr),
          mesh_(levelSet_ ? nullptr : meshOf(solid, name)) {}

    const glm::dvec3& origin() const { return levelSet_ ? levelSetOrigin_ : mesh_->origin; }

    /// visit(LevelSet) or visit(Mesh), which have the origin zero; needs no GIL.
    template <class Visit>
    auto visit(const Visit& visit) const {
        const bool isFar = origin() != glm::dvec3(0);
        if (levelSet_) return isFar ? visit(withoutOrigin(*levelSet_)) : visit(*levelSet_);
        return isFar ? visit(Mesh{mesh_->points, mesh_->triangles, {}}) : visit(static_cast<const Mesh&>(*mesh_));
    }

  private:
    const LevelSet* levelSet_;
    SharedMesh mesh_;
    glm::dvec3 levelSetOrigin_ = levelSet_ ? levelSet_->origin() : glm::dvec3(0);
};

// A transform into coordinates whose zero is at `zero`.
Transform::Ptr relativeTo(const glm::dvec3& zero, const Transform& transform) {
    const Transform::Ptr result = transform.copy();
    result->postTranslate({-zero.x, -zero.y, -zero.z});
    return result;
}

py::object seedLiquid(const LevelSet& liquid, const py::object& body, const py::object& pose, const py::object& scale,
                      const std::string& mode, bool uniteSolids) {
    const fluid::Placement placement = placementOf(pose, scale);
    fluid::SeedOptions options(byWord(modes, mode, "mode"), uniteSolids);
    const SolidArgument solid(body, "body");
    const glm::dvec3 apart = solid.origin() - liquid.origin();
    openvdb::FloatGrid::Ptr grid;
    const auto [maxChange, where,
                changedVoxels] = cancellable(py::none(), [&](const ProgressCallback& progressCallback) {
        options.progress = progressCallback;
        grid = fluid::detail::liquidCopy(liquid);
        const Transform& voxels = liquid.grids().distance->transform();
        grid->setTransform(relativeTo(apart, voxels));
        const auto report = solid.visit([&](const auto& one) { return fluid::seed(*grid, one, placement, options); });
        grid->setTransform(voxels.copy());
        return report;
    });
    if (grid->activeVoxelCount() == 0) throw std::invalid_argument("body: it leaves nothing of the liquid");
    auto grids = std::make_shared<Grids>();
    grids->distance = grid;
    return result("Seeded", LevelSet(std::move(grids)), maxChange, toArray(where + apart), changedVoxels);
}

py::object makeParticles(const py::object& liquid, const py::object& pose, const py::object& scale,
                         std::optional<double> voxelSize, int perVoxel, std::uint64_t seed) {
    fluid::ParticleOptions options{.perVoxel = perVoxel, .seed = seed};
    std::function<fluid::Particles()> make;
    if (py::isinstance<LevelSet>(liquid)) {
        if (!pose.is_none() || voxelSize || placementOf(pose, scale).scale != glm::vec3(1))
            throw std::invalid_argument(
                "pose, scale, voxel_size: expected no values with a LevelSet, which has its own voxels: pass a Field");
        const auto& levelSet = liquid.cast<const LevelSet&>();
        make = [&] { return fluid::particles(*levelSet.grids().distance, options); };
    } else if (py::isinstance<FieldObject>(liquid)) {
        const auto& field = liquid.cast<const FieldObject&>();
        const double edge = voxelSize.value_or(double(field.voxelSize()));
        requireVoxelSize(edge, "voxel_size");
        make = [&options, &field, placement = placementOf(pose, scale), edge] {
            return fluid::particles(field, placement, *Transform::createLinearTransform(edge), options);
        };
    } else {
        refuseType("liquid", "a LevelSet or a Field", liquid);
    }
    fluid::Particles particles = cancellable(py::none(), [&](const ProgressCallback& progressCallback) {
        options.progress = progressCallback;
        return make();
    });
    const auto count = py::ssize_t(particles.positions.size());
    glm::vec3* first = nullptr;
    const py::capsule owner = owned(std::move(particles.positions), first);
    return py::array(py::dtype::of<float>(), Shape{count, 3}, reinterpret_cast<const float*>(first), owner);
}

// The grids of an obstacle, and where their dense arrays begin.
class Obstacle {
  public:
    explicit Obstacle(fluid::Solid solid) : solid_(std::move(solid)) {
        for (const auto& grid : grids()) box_.expand(grid->evalActiveVoxelBoundingBox());
    }

    const fluid::Solid& solid() const { return solid_; }
    openvdb::GridCPtrVec grids() const {
        return {solid_.distance, solid_.velocity, solid_.faceFluidFraction, solid_.cellFluidFraction};
    }
    double voxelSize() const { return solid_.distance->voxelSize()[0]; }
    glm::dvec3 origin() const {
        const openvdb::Vec3d place = solid_.distance->indexToWorld(box_.min());
        return {place.x(), place.y(), place.z()};
    }

    // (nx, ny, nz), with a last axis of three for vectors.
    template <class Grid>
    py::array_t<float> dense(const Grid& grid) const {
        using Value = typename Grid::ValueType;
        const openvdb::Coord size = box_.dim();
        Shape shape{size.x(), size.y(), size.z()};
        if (sizeof(Value) > sizeof(float)) shape.push_back(3);
        py::array_t<float> values(shape);
        auto* const memory = reinterpret_cast<Value*>(values.mutable_data());
        {
            const WithoutGil release;
            openvdb::tools::Dense<Value, openvdb::tools::LayoutZYX> target(box_, memory);
            openvdb::tools::copyToDense(grid, target);
        }
        return values;
    }

    void save(const Path& path) const {
        requireExtension(path, {".vdb"});
        const WithoutGil release;
        writeGrids(path.text, grids());
    }
    std::string text() const {
        const openvdb::Coord size = box_.dim();
        return fmt::format("Obstacle({} x {} x {} cells of {:g})", size.x(), size.y(), size.z(), voxelSize());
    }

  private:
    fluid::Solid solid_;
    openvdb::CoordBBox box_;
};

Obstacle makeObstacle(const py::object& solid, double voxelSize, const py::object& pose, const py::object& scale,
                      const py::object& velocity, const py::object& angularVelocity, float halfWidth) {
    requireVoxelSize(voxelSize, "voxel_size");
    const fluid::Placement placement = placementOf(pose, scale);
    fluid::SolidOptions options{.velocity = {vector(velocity, "velocity"), vector(angularVelocity, "angular_velocity")},
                                .halfWidthVoxels = halfWidth};
    const SolidArgument body(solid, "solid");
    return cancellable(py::none(), [&](const ProgressCallback& progressCallback) {
        options.progress = progressCallback;
        openvdb::initialize();
        const Transform::Ptr cells = Transform::createLinearTransform(voxelSize);
        const fluid::Solid made = body.visit(
            [&](const auto& one) { return fluid::solid(one, placement, *relativeTo(body.origin(), *cells), options); });
        for (openvdb::GridBase* grid : std::initializer_list<openvdb::GridBase*>{
                 made.distance.get(), made.velocity.get(), made.faceFluidFraction.get(), made.cellFluidFraction.get()})
            grid->setTransform(cells->copy());
        return Obstacle(made);
    });
}

template <class Grid>
bool same(const Grid& a, const Grid& b) {
    if (a.transform() != b.transform() || a.background() != b.background() || !a.tree().hasSameTopology(b.tree()))
        return false;
    auto other = b.tree().cbeginValueAll();
    for (auto one = a.tree().cbeginValueAll(); one; ++one, ++other)
        if (!(*one == *other)) return false;
    return true;
}

bool equal(const Obstacle& a, const Obstacle& b) {
    const WithoutGil release;
    const fluid::Solid &one = a.solid(), &other = b.solid();
    return same(*one.distance, *other.distance) && same(*one.velocity, *other.velocity) &&
           same(*one.faceFluidFraction, *other.faceFluidFraction) &&
           same(*one.cellFluidFraction, *other.cellFluidFraction);
}

// The obstacle of grids in the order of Obstacle::grids().
Obstacle unpacked(const py::object& bytes) {
    const openvdb::GridPtrVec grids = gridsOf(bytes);
    if (grids.size() != 4) throw std::invalid_argument("an obstacle has 4 grids");
    return Obstacle(
        {openvdb::gridPtrCast<openvdb::FloatGrid>(grids[0]), openvdb::gridPtrCast<openvdb::Vec3SGrid>(grids[1]),
         openvdb::gridPtrCast<openvdb::Vec3SGrid>(grids[2]), openvdb::gridPtrCast<openvdb::FloatGrid>(grids[3])});
}

constexpr const char* seedDoc = R"(seed(liquid, body, pose=None, scale=1, mode="unite", unite_solids=True) -> Seeded

Combines a body with a liquid's level set, in the liquid's voxels. The result passes OpenVDB's check of level sets.
Ctrl-C cancels.

liquid: a LevelSet with a band of 3 voxels or more on each side.
body: a mesh or a LevelSet. pose: a Pose, a matrix of shape (4, 4), or None. scale: one number or three, above 0. Both
act on the body's own coordinates, without its origin; then the body is where its origin puts it relative to the liquid.
mode: "unite", "intersect" or "subtract". unite_solids: ignore walls inside overlapping solids of the mesh.

Raises ValueError for a body that is open or without an inside, for a liquid that is no level set, and if nothing of the
liquid is left.

>>> import bilayer
>>> tank = bilayer.build(bilayer.box((2, 2, 1)), voxel_size=0.05)
>>> both = bilayer.seed(tank, bilayer.sphere(0.4), pose=bilayer.Pose((0, 0, 1.5))).liquid
>>> round(bilayer.mass_properties(both).volume, 1)
4.3
)";

constexpr const char* particlesDoc =
    R"(particles(liquid, pose=None, scale=1, voxel_size=None, per_voxel=8, seed=0) -> float32 (N, 3)

Marker particles at jittered positions inside a liquid; none outside. The same seed gives the same particles. Positions
are relative to the liquid's origin.
Ctrl-C cancels.

liquid: a LevelSet, or a Field in a pose, whose mesh keeps particles from passing thin walls.
pose, scale: of the field, as for seed(). voxel_size: of the solver's grid, for a Field; None for the field's own.
per_voxel: particles in a voxel that is entirely inside, 1 to 1000.
seed: an integer from 0 to 2^64 - 1.

Raises ValueError that names the argument for a type or value that is not listed above.

>>> import bilayer
>>> points = bilayer.particles(bilayer.build(bilayer.box(), resolution=16))
>>> points.shape[1], bool(abs(points).max() <= 0.5)
(3, True)
)";

constexpr const char* obstacleDoc =
    R"(obstacle(solid, voxel_size, pose=None, scale=1, velocity=(0, 0, 0), angular_velocity=(0, 0, 0),
         half_width_voxels=3) -> Obstacle

What a pressure solver needs of a moving body, in cells whose centres are at whole multiples of voxel_size in the world.
Ctrl-C cancels.

solid: a mesh or a LevelSet. pose, scale: as for seed().
velocity: of the pose's position, in units per second. angular_velocity: about that, in radians per second.
half_width_voxels: width of the band of `distance` on each side, 3 to 1000.

Raises ValueError for a body that is open or without an inside.

>>> import bilayer
>>> obstacle = bilayer.obstacle(bilayer.sphere(1), 0.1)
>>> float(obstacle.cell_fluid_fraction.min()), obstacle.velocity.shape[3]
(0.0, 3)
)";

constexpr const char* saveDoc = R"(save(path)

Writes the four grids to a .vdb file, whole or not at all.

Raises ValueError for another extension, and RuntimeError if the file cannot be written.

>>> import bilayer, os, tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     bilayer.obstacle(bilayer.sphere(1), 0.1).save(os.path.join(folder, "solid.vdb"))
)";

}  // namespace

void addFluid(py::module_& module) {
    py::class_<Obstacle> type(
        module, "Obstacle",
        R"(A moving body in a solver's grid; obstacle() makes it. Arrays are dense over one box of cells.

>>> import bilayer
>>> ball = bilayer.obstacle(bilayer.sphere(0.5), voxel_size=0.1)
>>> ball.distance.shape == ball.cell_fluid_fraction.shape
True
)");
    defineMethod(type, saveDoc, [](const Obstacle& self, const Path& path) { self.save(path); });
    type.def_property_readonly(
            "distance", [](const Obstacle& self) { return self.dense(*self.solid().distance); },
            "float32 (nx, ny, nz): level set at the cell centres, negative inside the body.")
        .def_property_readonly(
            "velocity", [](const Obstacle& self) { return self.dense(*self.solid().velocity); },
            "float32 (nx, ny, nz, 3): velocity across the lower faces of each cell.")
        .def_property_readonly(
            "face_fluid_fraction", [](const Obstacle& self) { return self.dense(*self.solid().faceFluidFraction); },
            "float32 (nx, ny, nz, 3): fluid fraction of the lower faces, 0 to 1.")
        .def_property_readonly(
            "cell_fluid_fraction", [](const Obstacle& self) { return self.dense(*self.solid().cellFluidFraction); },
            "float32 (nx, ny, nz): fluid fraction of each cell, 0 to 1.")
        .def_property_readonly(
            "origin", [](const Obstacle& self) { return toArray(self.origin()); },
            "float64 (3,): world coordinates of the centre of cell [0, 0, 0].")
        .def_property_readonly("voxel_size", &Obstacle::voxelSize, "Edge of a cell.")
        .def("__repr__", &Obstacle::text)
        .def("__eq__", equal, py::is_operator())
        .def("__copy__", [](const Obstacle& self) { return self; })
        .def(
            "__deepcopy__", [](const Obstacle& self, const py::dict&) { return self; }, py::arg("memo"));
    defineReduce(type, "_unpacked(packed) -> Obstacle", unpacked,
                 [](const Obstacle& self) { return bytesOf(self.grids()); });
    define(module, seedDoc, seedLiquid);
    define(module, particlesDoc, makeParticles);
    define(module, obstacleDoc, makeObstacle);
}

}  // namespace bilayer::python
