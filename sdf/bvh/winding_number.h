// The generalized winding number: the part of all directions in which a point sees the inner side of the surface.
//
// A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding numbers",
// ACM TOG 32 (2013); clusters of triangles by their moments: G. Barill, N. Dickson, R. Schmidt, D. Levin, A. Jacobson,
// "Fast winding numbers for soups and clouds", ACM TOG 37 (2018).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

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

/// How fast the winding number can change. Away from the surface its gradient is the field that a current along the
/// boundary of the mesh would have (Biot and Savart): edges that their triangles run both ways equally often count not.
/// Safe from any thread.
class WindingSlope {
  public:
    /// @param progress  polled, unless null
    explicit WindingSlope(const Mesh& mesh, Progress* progress = nullptr);

    /// No less than the gradient's length anywhere in a ball, links of which do not cross the surface [1/m].
    double operator()(const glm::dvec3& centre, double radius) const;

  private:
    struct Edge {
        glm::dvec3 from, to;
        double times;  // how often the edge is run more one way than the other
        glm::vec3 at;  // the middle
        std::uint32_t index;
    };
    struct Node {
        glm::dvec3 centre;
        double radius, length;
        std::size_t begin, end, right;
    };
    static constexpr std::size_t leafEdges = 4;

    void build(std::size_t at, std::size_t begin, std::size_t end, Progress* progress);
    double bound(std::size_t at, const glm::dvec3& centre, double radius) const;
    static double ofEdge(const Edge& edge, const glm::dvec3& centre, double radius);

    std::vector<Edge> edges_;
    std::vector<Node> nodes_;
};

}  // namespace bilayer::detail
