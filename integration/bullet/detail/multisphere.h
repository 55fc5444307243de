// The convex hull of balls, which is what Bullet's multispheres are: spheres, cones between two of them, and planes
// that rest on three.
#pragma once

#include <glm/vec3.hpp>
#include <utility>
#include <vector>

namespace bilayer::bullet::detail {

class MultisphereHull {
  public:
    struct Ball {
        glm::vec3 centre;  ///< [m]
        float radius;      ///< not negative [m]
    };

    MultisphereHull() = default;
    /// At least one ball. Takes O(n^4) for n of them.
    explicit MultisphereHull(std::vector<Ball> balls);

    struct Near {
        float distance;    ///< signed, to the surface [m]
        glm::vec3 normal;  ///< of the surface there, outward, of unit length
        Ball ball;         ///< one in the hull that touches its surface there
    };
    /// Exact but for rounding, outside and inside. Takes O(n^2) outside, O(n^3) inside.
    Near nearest(const glm::vec3& point) const;

    /// Those that are in no other.
    const std::vector<Ball>& balls() const { return balls_; }
    /// Balls between which a cone lies, some of them perhaps inside of the hull.
    const std::vector<std::pair<std::uint32_t, std::uint32_t>>& pairs() const { return pairs_; }

  private:
    struct Plane {
        glm::dvec3 normal;
        double offset;
        std::uint32_t corners[3];
    };
    // In double precision: where a ball and a cone are as near but for rounding, their normals differ by its root.
    struct Candidate {
        double distance;
        glm::dvec3 normal, centre;
        double radius;
    };
    void addPlanes(std::uint32_t i, std::uint32_t j, std::uint32_t k);
    Candidate aroundBall(const Ball& ball, const glm::dvec3& point) const;
    Candidate aroundPair(const Ball& from, const Ball& to, const glm::dvec3& point) const;
    Candidate inside(const glm::dvec3& point) const;
    double along(const glm::dvec3& direction, const glm::dvec3& point) const;

    std::vector<Ball> balls_;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_;
    std::vector<Plane> planes_;
    float size_ = 0, minRadius_ = 0;  ///< [m]
};

}  // namespace bilayer::bullet::detail
