// The true signed distance to a mesh, and how deep two meshes overlap by it. Double precision, and independent of the
// library's own fields: what demos and tests measure them against.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include <bilayer/collider/pose.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::demo {

/// The signed distance to a closed, oriented mesh: the nearest triangle by a tree of boxes, the sign by the
/// angle-weighted pseudonormal of the nearest face, edge or vertex (J. A. Baerentzen, H. Aanaes, "Signed distance
/// computation using the angle weighted pseudonormal", IEEE TVCG 11 (2005) 243-253).
class ExactDistance {
  public:
    /// Throws std::invalid_argument as validate() does, or if all triangles are without area.
    explicit ExactDistance(const Mesh& mesh);

    /// The distance at a point, negative inside [m]. Safe from any thread; O(log triangles) near the surface.
    double operator()(const glm::dvec3& point) const;

    /// The box around the mesh [m].
    const glm::dvec3& lower() const { return nodes_.front().lower; }
    const glm::dvec3& upper() const { return nodes_.front().upper; }

  private:
    struct Triangle {
        std::array<glm::dvec3, 3> corners;
        /// Of the face, of the edges after corners 0, 1, 2, and of the corners 0, 1, 2; not of unit length.
        std::array<glm::dvec3, 7> normals;
    };
    struct Node {
        glm::dvec3 lower, upper;
        std::uint32_t begin, end;  // range of triangles
        std::uint32_t right;       // the second child, the first is the next node; 0: a leaf
    };
    struct Nearest;

    void addTriangles(const Mesh& mesh);
    void addNode(std::uint32_t begin, std::uint32_t end);
    void search(const Node& node, const glm::dvec3& point, Nearest& nearest) const;

    std::vector<Triangle> triangles_;
    std::vector<Node> nodes_;
};

/// A body to be measured: its true distance, and points all over its surface in a tree of balls.
class Specimen {
  public:
    /// @param spacing  points are the vertices and, on longer triangles, as many more as leave no gap beyond this [m]
    Specimen(const Mesh& mesh, double spacing);

    const ExactDistance& distance() const { return distance_; }
    std::span<const glm::dvec3> points() const { return points_; }

    /// How deep some surface point of this body lies under the surface of another, if
    /// deeper than `least`; else `least` [m].
    double deepestIn(const ExactDistance& other, const Pose& self, const Pose& otherPose, double least = 0) const;

  private:
    struct Ball {
        glm::dvec3 centre;
        double radius;
        std::uint32_t begin, end;  // range of points
        std::uint32_t right;       // the second child, the first is the next ball; 0: a leaf
    };
    struct Descent;

    void addBall(std::uint32_t begin, std::uint32_t end);

    ExactDistance distance_;
    std::vector<glm::dvec3> points_;
    std::vector<Ball> balls_;
};

/// How deep some surface point of one body lies under the surface of the other, if deeper than `least`; else `least`
/// [m].
double penetration(const Specimen& a, const Pose& poseA, const Specimen& b, const Pose& poseB, double least = 0);

}  // namespace bilayer::demo
