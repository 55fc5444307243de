// What a rigid body is beside its field. Made from the mesh once, it can stay with the field's grids, and in their .vdb
// file, ever after: then nobody needs the mesh's own file again.
#pragma once

#include <memory>
#include <optional>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/mass.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>
#include "collider/contact/surface_points.h"

namespace bilayer::detail {

struct Body {
    SurfacePoints points;
    Bounds bounds;                       ///< of the mesh [m]
    float margin = 0;                    ///< contacts are made up to this distance between surfaces [m]
    std::optional<MassProperties> mass;  ///< nothing where the mesh encloses no volume
    /// All of it facing outward. Null for a body that answers by its field alone, which rounds sharp edges: contacts
    /// are those of ContactAccuracy::samples, rays are off by half a voxel at most, and sweeps end up to a voxel and a
    /// half late.
    std::shared_ptr<const Mesh> mesh;
    ContactAccuracy accuracy = ContactAccuracy::samples;  ///< as in ColliderOptions; samples where there is no mesh
    /// The level set to collide by instead of the mesh's own, whose holes have been filled; nothing: its own.
    std::optional<LevelSet> filled;
};

/// Wider margins are a mistake of units [voxels].
inline constexpr float maxMargin = 1000;

/// The level set, to write as a .vdb file, with the body beside it: surface points as a grid of OpenVDB points, the
/// rest as metadata. Nothing is lost: bodyOf() gives the same bits, but that a body with Body::filled is put beside
/// that level set instead of the given one. The grids are shared, not copied. Throws std::invalid_argument if the body
/// has no points, a mesh that is not valid or of more than 2 GiB, or if it is one that bodyOf() would refuse.
LevelSet withBody(const LevelSet& levelSet, const Body& body);

/// The body beside a level set. Throws std::invalid_argument that says what is missing or damaged if there is none, if
/// it is of a newer kind, or if it cannot be one of this field.
Body bodyOf(const LevelSet& levelSet);

}  // namespace bilayer::detail
