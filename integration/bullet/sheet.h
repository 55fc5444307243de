// Triangles as Bullet hands them over: sheets, each by itself, whose sides belong together where their ends are the
// same; internal.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>

#include <array>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace bilayer::bullet {

using Triangle = std::array<glm::vec3, 3>;

/// From one of its sides, from that corner to the next, into a triangle, of unit length; zero if it has no area.
glm::vec3 wingOf(const Triangle& triangle, int side);

/// The ends of a side in one order.
using SideKey = std::array<float, 6>;
SideKey keyOf(const Triangle& triangle, int side);

/// What is sharp of a sheet: its border, and where it is folded by more than 30 degrees.
struct SharpSheet {
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
SharpSheet sharpOf(std::span<const Triangle> triangles);

/// The triangles of a mesh or a height field that a ball may touch on a way from place to place, each once.
std::vector<Triangle> trianglesAlong(const btConcaveShape& mesh, std::span<const glm::vec3> way, float radius);

}  // namespace bilayer::bullet
