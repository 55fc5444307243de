// What lies on the two sides of a surface, by winding numbers: whether it bounds a solid there.
//
// The winding number is that of A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using
// generalized winding numbers" (SIGGRAPH 2013), as the mean over all directions of the signed crossings of a ray.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/triangle_tree.h"

namespace bilayer::detail {

/// What a surface bounds by its winding numbers, in parts of its area (estimated at some hundred points of it).
struct Bounding {
    double solid = 0;     ///< clearly more than a half behind, clearly less before: the surface of a solid
    double buried = 0;    ///< clearly more than a half on both sides: within the solid
    double reversed = 0;  ///< the solid is in front
    double nothing = 0;   ///< what remains: sheets, and where holes leave the winding number near a half
};

/// Estimates the winding numbers on both sides of a surface. Keeps references to what it is given.
class Sides {
  public:
    /// @param progress  polled, unless null
    Sides(const Mesh& mesh, const TriangleTree& tree, Progress* progress = nullptr);

    /// What some of the triangles bound, at `samples` points of equal shares of their area. Deterministic.
    Bounding measure(std::span<const unsigned> triangles, std::size_t samples) const;

  private:
    double area(unsigned triangle) const;
    void add(unsigned triangle, std::size_t sample, Bounding& sum) const;

    const Mesh& mesh_;
    const TriangleTree& tree_;
    Progress* progress_;
    double samePlace_;  // surfaces no farther apart are one [m]
    std::vector<glm::dvec3> directions_;
};

/// Measures what a mesh bounds as a whole. The mesh must be valid.
/// @param progress  polled, unless null
Bounding bounding(const Mesh& mesh, Progress* progress = nullptr);

}  // namespace bilayer::detail
