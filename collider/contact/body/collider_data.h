// SPDX-License-Identifier: Apache-2.0
// The data of a Collider.
// Tested by tests/collider/collider.cpp.
#pragma once

#include <bilayer/collider/collider.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "collider/contact/body/body.h"
#include "collider/contact/body/interpolation_error.h"
#include "collider/contact/body/sharp_edges.h"
#include "collider/contact/body/surface_points.h"
#include "collider/field/triangles/mesh_tree.h"

namespace bilayer::detail {

/// Builds the body of a mesh and its level set, as Collider's constructor does.
Body makeBody(Mesh mesh, const LevelSet& levelSet, const ColliderOptions& options);

/// The same samples with a mesh, whose triangles then decide near the surface.
Field fieldWithMesh(const Field& samples, std::shared_ptr<const Mesh> mesh);

struct ColliderData {
    ColliderData(const LevelSet& levelSet, Body body);

    const SurfacePoints& points() const { return body.points; }
    const Mesh& mesh() const;
    const Field& exactField() const;
    /// Whether contacts use the triangles at a point in body coordinates [m], as Body::accuracy says.
    /// @param exact  use them everywhere if there is a mesh (ContactOptions::exact)
    bool isExactAt(const glm::vec3& point, bool exact = false) const {
        if (exact || body.accuracy == ContactAccuracy::exact) return body.mesh != nullptr;
        return errorMask.isMarked(point);
    }
    const SharpEdges& edges() const { return sharpEdges; }
    /// The hierarchy over the triangles of mesh().
    const MeshTree& meshTree() const;
    /// A vertex of each connected component of mesh(), in body coordinates [m].
    std::span<const glm::vec3> componentPoints() const;

    const Body body;
    const Field field;
    const InterpolationErrorMask errorMask;
    const SharpEdges sharpEdges;
    const std::uint64_t id;

  private:
    template <class Make>
    static void once(std::once_flag& flag, const Make& make);

    // Created on demand, as they are rarely needed and take longer than restoring the rest of a body from a file. The
    // triangles of the field's zero set, for a body without a mesh; and the field with the mesh.
    mutable std::once_flag once_;
    mutable std::optional<LevelSet> levelSet_;
    mutable Mesh zeroSet_;
    mutable std::optional<Field> exact_;
    mutable std::once_flag treeOnce_, componentsOnce_;
    mutable std::optional<MeshTree> zeroSetTree_;
    mutable std::vector<glm::vec3> componentPoints_;
};

}  // namespace bilayer::detail
