// SPDX-License-Identifier: Apache-2.0
// Shapes of bodies that collide with colliders: round bodies, boxes, convex hulls, planes and triangles.
#pragma once

#include <bilayer/collider/collider.h>
#include <bilayer/sdf/mesh.h>

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <span>

namespace bilayer {

namespace detail {
struct Access;
struct ContactShapeData;
}  // namespace detail

/// The corners of a triangle [m].
using Triangle = std::array<glm::vec3, 3>;

/// The triangles of a height field, or of a mesh of another library, as they are asked for. They are an open surface:
/// both sides of a triangle are outside, and nothing is inside. Triangles that share an edge or a vertex have equal
/// coordinates there, to the bit. A triangle with a corner that is not finite touches nothing.
struct OpenSurface {
    /// @param id  a number of the triangle that no other has, the same at each call
    using Visitor = std::function<void(const Triangle& triangle, std::uint64_t id)>;
    /// Passes at least the triangles that meet a box, each once. Called from the threads that collide the shape, also
    /// from several at a time.
    std::function<void(const Bounds& box, const Visitor& visitor)> visit;
};

/// A sphere for ContactShape::spheres().
struct SphereOfHull {
    glm::vec3 centre{0};  ///< [m]
    float radius = 0;     ///< not negative [m]
};

/// The shape of a body in a contact search. Immutable: share it between bodies and threads; copies share their data.
/// All lengths are in metres, in the coordinates of the body. Solids of revolution have the y axis.
///
/// All functions that make a shape throw std::invalid_argument for a length that is not finite, negative, or zero where
/// the shape would have no volume; the message names it.
class ContactShape {
  public:
    /// A concave body.
    explicit ContactShape(Collider collider);

    /// A sphere around the origin.
    static ContactShape sphere(float radius);
    /// A box around the origin.
    static ContactShape box(const glm::vec3& halfExtents);
    /// A cylinder with two half spheres.
    /// @param halfHeight  from the middle to the centre of either end's sphere; 0: a sphere
    static ContactShape capsule(float radius, float halfHeight);
    /// A cylinder around the origin.
    static ContactShape cylinder(float radius, float halfHeight);
    /// A cone. The base lies at -halfHeight, the apex at +halfHeight.
    static ContactShape cone(float radius, float halfHeight);
    /// The convex hull of points, grown by a radius. Throws std::invalid_argument if the points lie in one plane.
    static ContactShape hull(std::span<const glm::vec3> points, float radius = 0);
    /// The convex hull of spheres. At least one has a radius above 0.
    static ContactShape spheres(std::span<const SphereOfHull> spheres);
    /// The half-space of all x with dot(normal, x) <= offset.
    /// @param normal  of any length above 0; `offset` is for its unit vector
    static ContactShape plane(const glm::vec3& normal, float offset);
    /// Throws std::invalid_argument if the surface has no function.
    static ContactShape triangles(OpenSurface openSurface);

    /// The collider, if the shape was made of one; null otherwise.
    const Collider* collider() const;

  private:
    friend struct detail::Access;
    explicit ContactShape(detail::ContactShapeData data);

    std::shared_ptr<const detail::ContactShapeData> data_;
};

}  // namespace bilayer
