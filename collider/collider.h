// A rigid body's shape: a field, its mesh, and what contacts need of both.
#pragma once

#include <bilayer/collider/field.h>
#include <bilayer/collider/mass.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

#include <cstdint>
#include <memory>

namespace bilayer {

namespace detail {
struct ColliderData;
}

/// What the distances and normals of contacts are taken from, once the field's samples have found them.
enum class ContactAccuracy {
    samples,            ///< nothing else: takes the least memory
    exactNearFeatures,  ///< the triangles where samples are off: at edges, in grooves, and where the surface bends in a
                        ///< voxel
    exact,              ///< the triangles everywhere
};

/// As in files and on the command line: samples, edges or triangles.
const char* nameOf(ContactAccuracy accuracy);

struct ColliderOptions {
    /// Distance between neighbouring surface points [voxels of the field]. Smaller finds finer contacts and costs more.
    /// What is round has points closer to each other, so that it sinks in between them by 0.05 spacings at most.
    float pointSpacing = 2.0f;
    /// Contacts are made up to this distance between the surfaces [m], 1000 voxels at most. Negative: one voxel of the
    /// field.
    float margin = -1;
    /// ContactAccuracy::exactNearFeatures asks the triangles where samples are off by more than a tenth of a voxel (see
    /// InterpolationErrorMask). But for samples alone, the mesh takes memory (see Field), and a microsecond a triangle
    /// to sort. ContactAccuracy::exact costs more time the more contacts there are: for parts that fit into each other
    /// to a fraction of a voxel.
    ContactAccuracy accuracy = ContactAccuracy::exactNearFeatures;
};

/// A field, points on the surface, and what else contacts need. Immutable; share it between bodies and threads.
class Collider {
  public:
    /// Of a mesh and the level set that was built of it. Triangles that face the wrong way are turned around, as
    /// build() does. Where the signs are of winding numbers, the holes that these close are filled with triangles and
    /// cracks of up to a hundredth of a voxel are closed (see fillHoles()): a level set is then built of the closed
    /// mesh, with the same voxels and widths, and the body has its distances and normals there too. Throws
    /// std::invalid_argument as validate() does, for options of no sense, and if the level set is of another mesh.
    Collider(Mesh mesh, const LevelSet& levelSet, const ColliderOptions& options = {});

    /// Of a level set with a body beside it, as readVdb() gives back what withBody() was written of. It is as the one
    /// that it was made of, to the bit; but a body without a mesh gives the triangles of the field's zero set where
    /// triangles are asked for. Throws std::invalid_argument
    /// that says what is missing or damaged if there is no body, if it is of a newer kind, or if it cannot be one of
    /// this field.
    explicit Collider(const LevelSet& levelSet);

    /// The mesh, all of it facing outward, the triangles over its holes last. Where the body has none, one like it is
    /// extracted from the field when first asked for, once.
    const Mesh& mesh() const;
    const Field& field() const;
    /// The field with the mesh, if the body has one: field() itself where contacts ask triangles, else made when first
    /// asked for, once, and sharing the samples.
    const Field& exactField() const;
    const Bounds& bounds() const;  ///< of the mesh [m]
    float margin() const;          ///< as in ColliderOptions, never negative [m]
    /// Of the mesh; where that has holes, of what the field has inside, but for a body from elsewhere. Throws
    /// std::invalid_argument where there is no volume.
    const MassProperties& mass() const;
    std::uint64_t id() const;  ///< no other collider of this process has it
    /// What contacts are made from, for the library itself.
    const detail::ColliderData& data() const { return *data_; }

  private:
    std::shared_ptr<const detail::ColliderData> data_;
};

/// The level set of a mesh, to write as a .vdb file, with the mesh's body beside it: Collider(const LevelSet&) then
/// makes the same collider as Collider(mesh, levelSet, options), to the bit, and nobody needs the mesh's file again.
/// The grids are shared, not copied.
/// @param keepMesh  false: without the mesh. The body answers by its field alone, which rounds sharp edges: contacts
/// are
///                  those of ContactAccuracy::samples, rays are off by half a voxel at most, and sweeps end up to a
///                  voxel and a half late.
/// Throws as Collider's constructor, and std::invalid_argument for a mesh of more than 2 GiB.
LevelSet withBody(const LevelSet& levelSet, Mesh mesh, const ColliderOptions& options = {}, bool keepMesh = true);

/// Whether some body was put beside a level set.
bool hasBody(const LevelSet& levelSet);

}  // namespace bilayer
