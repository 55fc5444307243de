// Welding where something is known of the mesh already; internal.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

/// How the vertices of a mesh are used by its triangles.
struct VertexUse {
    std::vector<std::uint8_t> used;  ///< a byte for each vertex: whether a triangle uses it
    bool repeats = false;            ///< whether some triangle uses a vertex twice
};

/// Throws std::runtime_error for a corner without a vertex.
VertexUse vertexUse(const std::vector<glm::uvec3>& triangles, std::size_t vertices);

/// weld() of a mesh whose vertices are used so.
Mesh weld(Mesh mesh, const VertexUse& use);

/// weld() of a mesh; nothing where it is welded already.
std::optional<Mesh> weldUnlessDone(const Mesh& mesh);

}  // namespace bilayer::detail
