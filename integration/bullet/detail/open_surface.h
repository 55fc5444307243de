// Triangles as Bullet hands them over: sheets, each by itself, whose sides belong together where their ends are the
// same; internal.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "collider/contact/sharp_edges.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

using Triangle = std::array<glm::vec3, 3>;

/// From one of its sides, from that corner to the next, into a triangle, of unit length; zero if it has no area.
glm::vec3 wingOf(const Triangle& triangle, int side);

/// Which triangles share an edge or a corner: those that have it at the same coordinates, to the bit. Edge i of a
/// triangle goes from its corner i to the next one.
class Adjacency {
  public:
    struct Member {
        std::uint32_t triangle;
        int index;  ///< of its edge or corner
    };

    /// @param triangles  must outlive this
    explicit Adjacency(std::span<const Triangle> triangles);

    /// The triangles at an edge, that one included, in ascending order.
    std::span<const Member> atEdge(std::uint32_t triangle, int edge) const { return groupOf(edges_, triangle, edge); }
    /// The conormals of an edge that exactly two triangles share.
    std::optional<Conormals> wingsOf(std::uint32_t triangle, int edge) const;
    /// That of the other one of the two.
    std::optional<glm::vec3> neighbourOf(std::uint32_t triangle, int edge) const;

    /// The unit vector nearest to a direction in the normal cone of an edge or a corner: the directions in which it is
    /// the closest point of its triangles. Nothing where none is within 60 degrees.
    std::optional<glm::vec3> edgeNormal(std::uint32_t triangle, int edge, const glm::vec3& direction) const;
    std::optional<glm::vec3> cornerNormal(std::uint32_t triangle, int corner, const glm::vec3& direction) const;

  private:
    /// Edges or corners, those at the same coordinates one after the other.
    struct Groups {
        std::vector<Member> members;
        std::vector<std::uint32_t> first, end;  ///< of the group of each triangle's edges or corners
    };
    std::span<const Member> groupOf(const Groups& groups, std::uint32_t triangle, int index) const {
        const std::size_t at = 3 * std::size_t(triangle) + std::size_t(index);
        return {groups.members.data() + groups.first[at], groups.members.data() + groups.end[at]};
    }
    template <class KeyOf>
    Groups groupBy(KeyOf&& keyOf) const;

    std::span<const Triangle> triangles_;
    Groups edges_, corners_;
};

/// What is sharp of a sheet: its border, and where it is folded by more than 30 degrees.
struct SharpTriangles {
    struct Side {
        glm::vec3 from, to;
        glm::vec3 outward;  ///< away from the sheet, of unit length
    };
    struct Corner {
        glm::vec3 place, outward;
    };
    std::vector<Side> sides;
    std::vector<Corner> corners;
};
SharpTriangles sharpOf(std::span<const Triangle> triangles);

/// The triangles of a mesh or a height field that a ball may touch on a way from place to place, each once.
std::vector<Triangle> trianglesAlong(const btConcaveShape& mesh, std::span<const glm::vec3> way, float radius);

}  // namespace bilayer::bullet::detail
