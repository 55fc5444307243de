// The triangle mesh that everything starts from, and the small things one asks of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <vector>

namespace bilayer {

/// A triangle mesh in world units. Triangles are counter-clockwise seen from outside.
struct Mesh {
    std::vector<glm::vec3> points;      ///< vertex positions [m]
    std::vector<glm::uvec3> triangles;  ///< three indices into `points` a triangle
    /// Added to `points` it gives world coordinates [m]. Zero, but for a mesh that is so far away that floats would
    /// round it (readMesh()); fields and queries of such a mesh are relative to it too.
    glm::dvec3 origin{0};
};

/// An axis-aligned box [m]; empty (lower > upper) by default.
struct Bounds {
    glm::vec3 lower{1e30f};
    glm::vec3 upper{-1e30f};

    glm::vec3 size() const { return upper - lower; }
    glm::vec3 centre() const { return 0.5f * (lower + upper); }
    float longestSide() const;
    bool empty() const { return lower.x > upper.x; }
    void add(const glm::vec3& point) {
        lower = glm::min(lower, point);
        upper = glm::max(upper, point);
    }
};

/// The box around all vertices that some triangle uses; empty for a mesh without triangles.
Bounds bounds(const Mesh& mesh);

/// Throws std::invalid_argument that names the first triangle or vertex at fault: no triangle, an index out of range,
/// a coordinate that is NaN or infinite.
void validate(const Mesh& mesh);

/// Merges vertices with equal coordinates (0 and -0 are equal), drops triangles that use a vertex twice, and drops
/// vertices that no triangle uses. Keeps the order of what remains. O(n), on all threads; a mesh that is moved in is
/// welded in its own memory. No index may be out of range.
Mesh weld(Mesh mesh);

/// The mesh under an affine map; triangles are turned around when the map mirrors, so that normals stay outward. An
/// origin that is not zero moves with the map.
Mesh transformed(const Mesh& mesh, const glm::mat4& map);

/// 64 bits that change with any vertex or triangle; the same for any number of threads.
std::uint64_t hash(const Mesh& mesh);

}  // namespace bilayer
