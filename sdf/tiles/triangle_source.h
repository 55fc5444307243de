// SPDX-License-Identifier: Apache-2.0
// The triangles of a mesh in their order, from memory or from a file that need not fit into memory.
// Tested by tests/sdf/triangle_source.cpp.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>

#include <bilayer/sdf/mesh.h>
#include "sdf/tiles/tile_build.h"

namespace bilayer::detail {

/// A mesh whose triangles are visited one batch after another.
class TriangleSource {
  public:
    using Visit = std::function<void(std::span<const TileTriangle>)>;

    virtual ~TriangleSource() = default;

    /// Visits all triangles with three different corners, in their order and with their numbers in the mesh that
    /// readMesh() returns.
    virtual void forEach(const Visit& visit) const = 0;

    /// Returns whether every edge is used equally often in both directions, as balanced() does.
    virtual bool isBalanced() const = 0;

    const MeshFacts& facts() const { return facts_; }

  protected:
    MeshFacts facts_;
};

/// The triangles of a mesh in memory.
std::unique_ptr<TriangleSource> trianglesOf(Mesh mesh);
/// The same for a mesh whose triangles were flipped, with the hash that it had before.
std::unique_ptr<TriangleSource> trianglesOf(Mesh flipped, std::uint64_t hash);

/// The triangles of a binary STL file, or of a binary PLY file of triangles with coordinates that are floats. Of the
/// file, only some pages are in memory. The hash of the mesh is not known. Returns null for another file.
/// Throws std::runtime_error that names the file if it is damaged, or so far from zero that readMesh() would move it.
std::unique_ptr<TriangleSource> trianglesOfFile(const std::filesystem::path& path);

}  // namespace bilayer::detail
