// Signs by the generalized winding number: the part of all directions in which a point sees the inner side of the
// surface. It copes with holes, overlaps and soups, as long as most faces are turned the right way.
//
// A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding numbers",
// ACM TOG 32 (2013); clusters of triangles by their moments: G. Barill, N. Dickson, R. Schmidt, D. Levin, A. Jacobson,
// "Fast winding numbers for soups and clouds", ACM TOG 37 (2018).
#pragma once

#include <openvdb/openvdb.h>

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/band.h"
#include "sdf/mesh.h"

namespace bilayer {

class Progress;

/// The generalized winding number of a mesh: near 1 inside of a closed, outward mesh, near 0 outside. A hierarchy of
/// triangles; 72 to 108 bytes a triangle. Safe from any thread.
class WindingNumber {
  public:
    /// Throws std::invalid_argument as validate() does. The mesh need not outlive the constructor.
    /// @param progress  polled while the hierarchy is built, unless null
    explicit WindingNumber(const Mesh& mesh, Progress* progress = nullptr);

    /// The true number lies within `error` of `value`, rounding (about 1e-12) aside.
    struct Estimate {
        double value, error;
    };

    /// The winding number at a point [m], refined until the error is below a `share` (0..1) of the way from the value
    /// to a half, down to single triangles (A. Van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE
    /// TBME 30 (1983)) if need be: which side of a half it is on is certain, unless it is a half up to rounding.
    Estimate estimate(const glm::dvec3& point, double share) const;
    double operator()(const glm::dvec3& point) const { return estimate(point, 0.5).value; }

    /// Whether some triangle meets or touches the segment between two points [m].
    bool meets(const glm::dvec3& from, const glm::dvec3& to) const;

    double area() const { return nodes_.front().total; }  ///< of all triangles [m^2]

  private:
    using Corners = std::array<glm::vec3, 3>;
    struct Node {
        glm::dvec3 centre;               // of area
        double radius;                   // of a ball around it that holds all triangles
        double total;                    // area
        glm::dvec3 area;                 // the integral of the normal n
        std::array<double, 6> moment;    // of s n^T, symmetric part, s from the centre: xx, yy, zz, xy, yz, zx
        std::array<double, 10> moment2;  // of s s^T (x) n, symmetric part: see product() in winding.cpp
        double spread;                   // the integral of |s|^2
        std::uint32_t begin, end;        // triangles
        std::uint32_t right;             // the second child, the first is the next node; 0: a leaf
    };
    struct Item;

    Bounds sumTriangles(Node& node) const;
    void sumChildren(Node& node, const Node& left, const Node& right, const Bounds& box) const;
    double solidAngles(const Node& node, const glm::dvec3& point) const;
    Estimate expansion(const Node& node, const glm::dvec3& point) const;
    void refine(const Node& node, std::uint32_t at, const glm::dvec3& point, Estimate& sum,
                std::vector<std::uint32_t>& open) const;

    std::vector<Corners> triangles_;
    std::vector<Node> nodes_;
};

/// Signs a narrow band of unsigned distances: a voxel is inside where the mesh's winding number is above a half.
///
/// `grid` holds a distance >= 0 [m] in every voxel nearer to the mesh than some reach, the reach as background and in
/// all other voxels, and no active tile; on return it is a level set of the given widths: active exactly where
/// -interior < distance < exterior, elsewhere +exterior or -interior, in tiles as large as they can be.
///
/// @param closed  true: as many triangles run along every edge one way as the other, hence the number is the same
///                wherever no surface lies between, and few voxels need to be asked. false: it changes across a hole,
///                away from any surface. Then voxels of leaves get the sign at their own centre, and the space between
///                leaves gets one sign for each 8x8x8 block, that of the block's centre.
/// @param progress  polled, unless null
/// The bytes do not depend on the number of threads. Throws std::invalid_argument as validate() does, and Cancelled;
/// the grid is then in between.
void signByWinding(openvdb::FloatGrid& grid, const Mesh& mesh, const BandWidths& widths, bool closed,
                   Progress* progress = nullptr);

}  // namespace bilayer
