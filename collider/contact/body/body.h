// SPDX-License-Identifier: Apache-2.0
// The contact data of a rigid body, apart from its field. Built once from the mesh, it can be stored with the field's
// grids in their .vdb file. The mesh file is then not needed again.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/mass.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>
#include "collider/contact/body/surface_points.h"

namespace bilayer::detail {

struct Body {
    SurfacePoints points;
    Bounds bounds;                       ///< of the mesh [m]
    float margin = 0;                    ///< max separation of contacts [m]
    std::optional<MassProperties> mass;  ///< none if the mesh encloses no volume
    /// All triangles face outward. Null for a body that uses its field alone. The field rounds sharp edges: contacts
    /// are those of ContactAccuracy::samples, ray hits are off by at most half a voxel, and swept motion stops up to
    /// 1.5 voxels late.
    std::shared_ptr<const Mesh> mesh;
    ContactAccuracy accuracy = ContactAccuracy::samples;  ///< as in ColliderOptions; samples where there is no mesh
    /// The level set of the mesh with its holes filled, which replaces the given one for collisions. None: the given
    /// one is used.
    std::optional<LevelSet> filled;
};

/// Wider margins are taken for a mistake of units [voxels].
inline constexpr float maxMargin = 1000;

/// Returns the level set with the body stored in it, for writing as a .vdb file: surface points as an OpenVDB point
/// grid, the rest as metadata. The storage is lossless: bodyOf() returns the same bits. A body with Body::filled is
/// stored with that level set instead of the given one. The grids are shared, not copied. Throws std::invalid_argument
/// if the body has no points, if its mesh is invalid or larger than 2 GiB, or if bodyOf() would refuse the body.
LevelSet withBody(const LevelSet& levelSet, const Body& body);

/// Returns the body stored in a level set. Throws std::invalid_argument if there is none, if its format is newer, or if
/// it cannot belong to this field; the message says what is missing or damaged.
Body bodyOf(const LevelSet& levelSet);

/// A level set and the body stored with it, if any.
struct StoredField {
    LevelSet levelSet;
    std::optional<Body> body;
};

/// Reads a file as readVdb() does, and checks the body stored in it, also where only the field is of interest. Throws
/// std::runtime_error that names the file if readVdb() or bodyOf() would refuse it.
StoredField readStored(const std::filesystem::path& path);

}  // namespace bilayer::detail
