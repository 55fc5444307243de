// SPDX-License-Identifier: Apache-2.0
// The triangle mesh that fields are built from, and basic operations on it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <vector>

namespace bilayer {

/// A triangle mesh in world units. Triangles are counter-clockwise when seen from outside.
struct Mesh {
    std::vector<glm::vec3> points;      ///< vertex positions [m]
    std::vector<glm::uvec3> triangles;  ///< three indices into `points` per triangle
    /// World coordinates are `points` plus this [m]. It is zero unless the mesh is so far from the world origin that
    /// float coordinates would lose precision (see readMesh()). Fields and queries of such a mesh are also relative to
    /// this origin.
    glm::dvec3 origin{0};
};

/// An axis-aligned box [m]; empty (lower > upper) by default.
struct Bounds {
    glm::vec3 lower{1e30f};   ///< lower corner [m]
    glm::vec3 upper{-1e30f};  ///< upper corner [m]

    /// Lengths of the sides [m].
    glm::vec3 size() const { return upper - lower; }
    /// The middle of the box [m].
    glm::vec3 centre() const { return 0.5f * (lower + upper); }
    float longestSide() const;  ///< its length [m]
    /// Whether it holds no point.
    bool empty() const { return lower.x > upper.x; }
    /// Grows to hold a point.
    void add(const glm::vec3& point) {
        lower = glm::min(lower, point);
        upper = glm::max(upper, point);
    }
};

/// Returns the bounds of all vertices that triangles use; empty for a mesh without triangles.
Bounds bounds(const Mesh& mesh);

/// Throws std::invalid_argument that names the first invalid triangle or vertex: no triangle, an index out of range, a
/// coordinate that is NaN or infinite.
void validate(const Mesh& mesh);

/// Merges vertices with equal coordinates (0 and -0 are equal), removes triangles that use a vertex twice, and removes
/// unused vertices. Preserves the order of the rest. O(n), on all threads. A mesh that is moved in is welded in place.
/// All indices must be in range.
Mesh weld(Mesh mesh);

/// Applies an affine map to a mesh. A map with a negative determinant also flips the triangles, so that normals still
/// point outward. A nonzero origin is transformed too. Throws std::invalid_argument for a vertex beyond floats.
Mesh transformed(const Mesh& mesh, const glm::mat4& map);

/// Returns a 64-bit hash of the vertices and triangles. It does not depend on the thread count.
std::uint64_t hash(const Mesh& mesh);

}  // namespace bilayer
