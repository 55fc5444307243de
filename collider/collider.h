// SPDX-License-Identifier: Apache-2.0
// The collision shape of a rigid body: a field, its mesh, and the data that contact generation needs.
#pragma once

#include <bilayer/collider/field.h>
#include <bilayer/collider/mass.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

#include <cstdint>
#include <memory>

namespace bilayer {

namespace detail {
struct Access;
struct ColliderData;
}  // namespace detail

/// The source of contact distances and normals. Field samples find the candidates first.
enum class ContactAccuracy {
    samples,            ///< field samples only; lowest memory use
    exactNearFeatures,  ///< triangles where samples are inaccurate: at edges, in grooves, and where the surface bends
                        ///< within a voxel
    exact,              ///< triangles everywhere
};

/// The name in files, on the command line and in Python: samples, exact-near-features or exact.
const char* nameOf(ContactAccuracy accuracy);

/// Options for making a collider.
struct ColliderOptions {
    /// Distance between neighbouring surface points, in voxels of the field. A smaller spacing finds finer contacts and
    /// costs more. Curved surfaces get denser points, which limits the penetration between points to 0.05 spacings.
    float pointSpacingVoxels = 2.0f;
    /// Contacts are created up to this separation [m], at most 1000 voxels. Negative: one voxel of the field.
    float margin = -1;
    /// ContactAccuracy::exactNearFeatures queries the triangles where samples are off by more than a tenth of a
    /// voxel. Both exact modes keep the mesh in memory (see Field) and take a microsecond per
    /// triangle to build. With ContactAccuracy::exact, time grows with the contact count. Use it for parts that fit
    /// into each other to a fraction of a voxel.
    ContactAccuracy accuracy = ContactAccuracy::exactNearFeatures;
};

/// A field, surface points, and other contact data. Immutable: share it between bodies and threads.
class Collider {
  public:
    /// Builds a collider from a mesh and the level set that was built from it. Inward-facing triangles are flipped, as
    /// in build(). If the signs come from winding numbers, holes are filled with triangles and cracks up to a hundredth
    /// of a voxel are closed. A level set of the closed mesh is then built, with the same voxel size
    /// and band widths. Distances and normals are thus defined at the former holes too. Throws std::invalid_argument
    /// for a mesh that fails validate(), for invalid options, and if the level set belongs to another mesh.
    Collider(Mesh mesh, const LevelSet& levelSet, const ColliderOptions& options = {});

    /// Restores a collider from a level set with a stored body, as readVdb() returns it for a file written by
    /// withBody(). The result equals the original collider bit for bit. A body without a mesh uses the triangles of the
    /// field's zero set where triangles are requested. Throws std::invalid_argument if there is no body, if its format
    /// is newer, or if it cannot belong to this field; the message says what is missing or damaged.
    explicit Collider(const LevelSet& levelSet);

    /// The mesh, with all triangles facing outward; the triangles over its holes come last. If the body has no mesh,
    /// one is extracted from the field at the first call and kept.
    const Mesh& mesh() const;
    const Field& field() const;  ///< the field that its queries use
    /// The field with the mesh, if the body has one. This is field() itself if contacts use triangles; otherwise it is
    /// created at the first call, and shares the samples.
    const Field& exactField() const;
    const Bounds& bounds() const;  ///< of the mesh [m]
    float margin() const;          ///< as in ColliderOptions, never negative [m]
    /// Mass properties of the mesh. If the mesh has holes, they come from the interior of the field, unless they were
    /// stored with the body. Throws std::invalid_argument if there is no volume.
    const MassProperties& mass() const;
    std::uint64_t id() const;  ///< unique within this process

  private:
    friend struct detail::Access;

    std::shared_ptr<const detail::ColliderData> data_;
};

/// Returns the level set of a mesh with the mesh's body stored in it, for writing as a .vdb file. Collider(const
/// LevelSet&) then makes the same collider as Collider(mesh, levelSet, options), bit for bit, without the mesh file.
/// The grids are shared, not copied.
/// @param keepMesh  false: store no mesh. Queries then use the field alone, which rounds sharp edges: contacts are
///                  those of ContactAccuracy::samples, ray hits are off by at most half a voxel, and swept motion stops
///                  up to 1.5 voxels late.
///
/// Throws as Collider's constructor does, and std::invalid_argument for a mesh of more than 2 GiB.
LevelSet withBody(const LevelSet& levelSet, Mesh mesh, const ColliderOptions& options = {}, bool keepMesh = true);

/// Whether the level set stores a body.
bool hasBody(const LevelSet& levelSet);

}  // namespace bilayer
