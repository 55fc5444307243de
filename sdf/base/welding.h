// SPDX-License-Identifier: Apache-2.0
// Vertex welding that reuses what is already known about the mesh; internal.
// Tested by tests/sdf/mesh.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

/// How the triangles of a mesh use its vertices.
struct VertexUse {
    std::vector<std::uint8_t> used;  ///< for each vertex, whether a triangle uses it
    bool repeats = false;            ///< whether any triangle uses a vertex twice
};

/// Throws std::runtime_error if a triangle refers to a vertex that does not exist.
VertexUse vertexUse(const std::vector<glm::uvec3>& triangles, std::size_t vertices);

/// Equals weld() for a mesh whose vertex use is `use`.
Mesh weld(Mesh mesh, const VertexUse& use);

/// Equals weld(), but returns nothing if the mesh is already welded.
std::optional<Mesh> weldUnlessDone(const Mesh& mesh);

}  // namespace bilayer::detail
