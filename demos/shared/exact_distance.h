// SPDX-License-Identifier: Apache-2.0
// The exact signed distance to a mesh, and the exact penetration depth of two meshes. It uses double precision and does
// not depend on the library's own fields. Demos and tests use it as the reference.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include <bilayer/collider/pose.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::demo {

/// The signed distance to a closed, oriented mesh. A tree of boxes finds the nearest triangle. The sign is that of the
/// angle-weighted pseudonormal of the nearest face, edge or vertex (J. A. Baerentzen, H. Aanaes, "Signed distance
/// computation using the angle weighted pseudonormal", IEEE TVCG 11 (2005) 243-253).
class ExactDistance {
  public:
    /// Throws std::invalid_argument as validate() does, or if no triangle has an area.
    explicit ExactDistance(const Mesh& mesh);

    /// Returns the distance at a point, negative inside [m]. Thread-safe; O(log triangles) near the surface.
    double operator()(const glm::dvec3& point) const;

    /// The bounding box of the mesh [m].
    const glm::dvec3& lower() const { return nodes_.front().lower; }
    const glm::dvec3& upper() const { return nodes_.front().upper; }

  private:
    struct Triangle {
        std::array<glm::dvec3, 3> corners;
        /// Normals of the face, of the edges after corners 0, 1, 2, and of the corners 0, 1, 2; not normalised.
        std::array<glm::dvec3, 7> normals;
    };
    struct Node {
        glm::dvec3 lower, upper;
        std::uint32_t begin, end;  // range of triangles
        std::uint32_t right;       // the second child, or 0 for a leaf; the first child is the next node
    };
    struct Nearest;

    void addTriangles(const Mesh& mesh);
    void addNode(std::uint32_t begin, std::uint32_t end);
    void search(const Node& node, const glm::dvec3& point, Nearest& nearest) const;

    std::vector<Triangle> triangles_;
    std::vector<Node> nodes_;
};

/// A body whose penetration is measured: its exact distance, and sample points on its surface in a tree of balls.
class Specimen {
  public:
    /// @param spacing  max distance between sample points [m]; points are the vertices, with additional ones on larger
    ///                 triangles
    Specimen(const Mesh& mesh, double spacing);

    const ExactDistance& distance() const { return distance_; }
    std::span<const glm::dvec3> points() const { return points_; }

    /// Returns the max depth of this body's surface points below the surface of another body, or `minimum` if that is
    /// greater [m].
    double deepestIn(const ExactDistance& other, const Pose& self, const Pose& otherPose, double minimum = 0) const;

  private:
    struct Ball {
        glm::dvec3 centre;
        double radius;
        std::uint32_t begin, end;  // range of points
        std::uint32_t right;       // the second child, or 0 for a leaf; the first child is the next ball
    };
    struct Descent;

    void addBall(std::uint32_t begin, std::uint32_t end);

    ExactDistance distance_;
    std::vector<glm::dvec3> points_;
    std::vector<Ball> balls_;
};

/// Returns the penetration depth: the max depth of the surface points of either body below the surface of the other, or
/// `minimum` if that is greater [m].
double penetration(const Specimen& a, const Pose& poseA, const Specimen& b, const Pose& poseB, double minimum = 0);

}  // namespace bilayer::demo
