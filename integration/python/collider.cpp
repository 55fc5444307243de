// SPDX-License-Identifier: Apache-2.0
// Collider, mass_properties(), with_body().
#include <bilayer/collider/collider.h>

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <stdexcept>

#include <bilayer/collider/mass.h>

#include "collider/contact/body/accuracy_names.h"
#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"
#include "integration/python/define.h"
#include "integration/python/objects.h"
#include "integration/python/without_gil.h"

namespace bilayer::python {
namespace {

py::object toResult(const MassProperties& mass) {
    py::array_t<float> inertia({3, 3});
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) inertia.mutable_at(row, column) = mass.inertia[column][row];
    const glm::quat& q = mass.principalAxes;
    const float axes[] = {q.w, q.x, q.y, q.z};
    return result("MassProperties", mass.volume, toArray(mass.centre), inertia, toArray(mass.principalInertia),
                  py::array_t<float>(4, axes));
}

py::object massOf(const py::object& solid) {
    std::optional<MassProperties> mass;
    if (py::isinstance<LevelSet>(solid)) {
        const auto& levelSet = solid.cast<const LevelSet&>();
        const WithoutGil release;
        mass = massProperties(levelSet);
    } else {
        const SharedMesh mesh = meshOf(solid, "solid");
        const WithoutGil release;
        mass = massProperties(*mesh);
    }
    return toResult(*mass);
}

ColliderOptions optionsOf(float pointSpacing, std::optional<float> margin, const std::string& accuracy) {
    requirePositive(pointSpacing, "point_spacing_voxels");
    ColliderOptions options{.pointSpacingVoxels = pointSpacing,
                            .accuracy = byWord(bilayer::detail::accuracyNames, accuracy, "accuracy")};
    if (!margin) return options;
    requireNotNegative(*margin, "margin");
    options.margin = *margin;
    return options;
}

ColliderObject makeCollider(const py::object& mesh, const py::object& levelSet, float pointSpacing,
                            std::optional<float> margin, const std::string& accuracy) {
    requireOrder(levelSet, mesh, "Collider(mesh, level_set)");
    const auto& distances = argument<const LevelSet&>(levelSet, "level_set");
    const SharedMesh shared = meshOf(mesh, "mesh");
    const ColliderOptions options = optionsOf(pointSpacing, margin, accuracy);
    py::dict keywords;
    keywords["point_spacing_voxels"] = pointSpacing;
    keywords["margin"] = margin ? py::object(py::float_(double(*margin))) : py::none();
    keywords["accuracy"] = accuracy;
    const py::object make =
        py::module_::import("functools").attr("partial")(py::type::of<ColliderObject>(), **keywords);
    const py::tuple recipe = py::make_tuple(make, py::make_tuple(shared, distances));
    const auto collider = [&] {
        const WithoutGil release;
        return Collider(*shared, distances, options);
    };
    return {collider(), recipe, distances.origin()};
}

LevelSet storeBody(const py::object& levelSet, const py::object& mesh, float pointSpacing, std::optional<float> margin,
                   const std::string& accuracy, bool keepMesh) {
    requireOrder(levelSet, mesh, "with_body(level_set, mesh)");
    const auto& distances = argument<const LevelSet&>(levelSet, "level_set");
    const SharedMesh shared = meshOf(mesh, "mesh");
    const ColliderOptions options = optionsOf(pointSpacing, margin, accuracy);
    const WithoutGil release;
    return withBody(distances, *shared, options, keepMesh);
}

ColliderObject restore(const LevelSet& levelSet) {
    const auto collider = [&] {
        const WithoutGil release;
        return Collider(levelSet);
    };
    const py::object make = py::type::of<ColliderObject>().attr("from_level_set");
    return {collider(), py::make_tuple(make, py::make_tuple(levelSet)), levelSet.origin()};
}

// A field of a collider, which pickles as the collider and the attribute's name.
FieldObject fieldOf(const py::object& self, const Field& (Collider::*member)() const, const char* attribute) {
    const auto& collider = self.cast<const ColliderObject&>();
    const auto field = [&] {
        const WithoutGil release;
        return (collider.*member)();
    };
    const py::object get = py::module_::import("builtins").attr("getattr");
    return {field(), py::make_tuple(get, py::make_tuple(self, attribute)), collider.origin};
}

SharedMesh meshOfCollider(const Collider& collider) {
    const WithoutGil release;
    return std::make_shared<Mesh>(collider.mesh());
}

constexpr const char* colliderDoc =
    R"(Collider(mesh, level_set, *, point_spacing_voxels=2, margin=None, accuracy="exact-near-features")

The shape of a rigid body for collide() and distance(): a field, surface points and sharp edges. Immutable; share it
between bodies and threads. Pickles hold the mesh, the level set and the options.

mesh, level_set: a mesh and the field that build() made of it. Poses place the coordinates of Mesh.vertices.
point_spacing_voxels: distance between neighbouring surface points, in voxels.
margin: contacts are created up to this separation, in the mesh's unit; None for one voxel.
accuracy: "samples", "exact-near-features" or "exact": where contacts take distances from the triangles.

Raises ValueError for options out of range, and if the level set belongs to another mesh. A level set without a
mesh_hash, as of other programs, is not checked.

>>> import bilayer
>>> box = bilayer.box()
>>> bilayer.Collider(box, bilayer.build(box, resolution=16)).mass.volume
1.0
)";

constexpr const char* massDoc =
    R"(mass_properties(solid) -> MassProperties

Mass properties for density 1, of a mesh, or of the inside of a LevelSet. Holes of a mesh are filled. The centre is in
the coordinates of Mesh.vertices.

Raises ValueError for a solid without volume.

>>> import bilayer
>>> bilayer.mass_properties(bilayer.box((1, 2, 3))).volume
6.0
)";

constexpr const char* bodyDoc =
    R"(with_body(level_set, mesh, *, point_spacing_voxels=2, margin=None, accuracy="exact-near-features",
          keep_mesh=True) -> LevelSet

The level set with all that Collider.from_level_set() needs, for LevelSet.save() and pickles. Options as for Collider.

keep_mesh: False stores no mesh; contacts then follow the samples, which round sharp edges.

Raises ValueError for options out of range, if the level set belongs to another mesh, and for a mesh too large to store.

>>> import bilayer
>>> box = bilayer.box()
>>> stored = bilayer.with_body(bilayer.build(box, resolution=16), box)
>>> bilayer.Collider.from_level_set(stored).mass.volume
1.0
)";

constexpr const char* fromLevelSetDoc = R"(from_level_set(level_set) -> Collider

Restores the collider that with_body() stored. Raises ValueError if there is none.

>>> import bilayer
>>> box = bilayer.box()
>>> stored = bilayer.with_body(bilayer.build(box, resolution=16), box, margin=0.1)
>>> round(bilayer.Collider.from_level_set(stored).margin, 3)
0.1
)";

}  // namespace

void addCollider(py::module_& module) {
    py::class_<ColliderObject> type(module, "Collider", colliderDoc);
    defineConstructor(type, colliderDoc, makeCollider);
    defineStatic(type, fromLevelSetDoc, restore);
    type.def_property_readonly(
            "mesh", [](const ColliderObject& self) { return meshOfCollider(self); },
            "A copy of the mesh, with all faces outward and holes filled.")
        .def_property_readonly(
            "field", [](const py::object& self) { return fieldOf(self, &Collider::field, "field"); }, "The Field.")
        .def_property_readonly(
            "exact_field", [](const py::object& self) { return fieldOf(self, &Collider::exactField, "exact_field"); },
            "The Field with the mesh, if the body has one.")
        .def_property_readonly(
            "margin", [](const ColliderObject& self) { return self.margin(); },
            "Contacts are created up to this separation, in the mesh's unit.")
        .def_property_readonly(
            "mass",
            [](const ColliderObject& self) {
                const auto find = [&] {
                    const WithoutGil release;
                    return self.mass();
                };
                return toResult(find());
            },
            "MassProperties; ValueError if there is no volume.")
        .def("__reduce__", [](const ColliderObject& self) { return self.recipe; })
        .def("__copy__", [](const ColliderObject& self) { return self; })
        .def(
            "__deepcopy__", [](const ColliderObject& self, const py::dict&) { return self; }, py::arg("memo"))
        .def("__repr__", [](const ColliderObject& self) {
            return fmt::format("Collider(voxels of {:g}, margin {:g})", self.field().voxelSize(), self.margin());
        });
    define(module, massDoc, massOf);
    define(module, bodyDoc, storeBody);
}

}  // namespace bilayer::python
