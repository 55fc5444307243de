// SPDX-License-Identifier: Apache-2.0
// The convex hull of spheres, which is what Bullet's multispheres are. Its surface consists of spheres, cones tangent
// to two of them, and planes tangent to three.
// Tested by tests/bullet/multisphere.cpp.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/collider/shapes.h>
#include "collider/contact/shapes/convex_core.h"

namespace bilayer::detail {

class MultisphereHull : public ConvexCore {
  public:
    /// Takes at least one sphere. Takes O(n^4) time for n of them.
    explicit MultisphereHull(std::vector<SphereOfHull> spheres);

    /// The nearest point of the surface. Its core point is the centre of a sphere inside the hull that touches the
    /// surface there. Exact up to rounding, outside and inside. Takes O(n^2) outside, O(n^3) inside.
    NearestPoint nearest(const glm::vec3& point, float reach) const override;
    bool isRound(const NearestPoint&) const override { return true; }
    glm::vec3 support(const glm::vec3& direction) const override;
    float radius(std::uint32_t vertex) const override { return spheres_[vertex].radius; }

  private:
    struct TangentPlane {
        glm::dvec3 normal;
        double offset;
        std::uint32_t corners[3];
    };
    // In double precision: where the distances to a sphere and to a cone differ by rounding only, their normals differ
    // by the square root of that.
    struct Candidate {
        double distance;
        glm::dvec3 normal, centre;
        double radius;
    };
    void addPlanes(std::uint32_t i, std::uint32_t j, std::uint32_t k);
    Candidate aroundSphere(const SphereOfHull& sphere, const glm::dvec3& point) const;
    Candidate aroundPair(const SphereOfHull& from, const SphereOfHull& to, const glm::dvec3& point) const;
    Candidate inside(const glm::dvec3& point) const;
    double along(const glm::dvec3& direction, const glm::dvec3& point) const;

    std::vector<SphereOfHull> spheres_;  ///< that no other one contains; the vertices are their centres
    std::vector<TangentPlane> planes_;
    float size_ = 0, minRadius_ = 0;  ///< [m]
};

}  // namespace bilayer::detail
