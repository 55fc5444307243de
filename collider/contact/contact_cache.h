// What the search for contacts between two bodies keeps from one step to the next.
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <vector>

namespace bilayer::detail {

/// The surface points of two bodies that could touch the other one, as long as the bodies have not moved farther than a
/// part of a voxel since they were listed (a list of neighbours: L. Verlet, "Computer experiments on classical fluids",
/// Physical Review 159 (1967)). One for each pair of bodies: collide() finds the same contacts with it as without, but
/// bodies that rest on each other cost little more than the contacts that they have, and those that rest beside each
/// other next to nothing.
struct CandidateLists {
    /// Where the points of one body are in the coordinates of the other.
    struct Place {
        std::uint64_t body = 0, other = 0;  ///< Collider::id()
        float reach = 0;                    ///< up to which contacts are made [m, in the other body's size]
        glm::mat3 linear{0};
        glm::vec3 shift{0};
    };

    /// The points of one body in the other's field.
    class List {
      public:
        /// Whether the points that can touch are among those listed.
        /// @param centre, radius  of a ball around the body, in its own coordinates [m]
        /// @param voxel           of the other body's field [m]
        /// @param maxSlack       that a list may have [m]
        bool holds(const Place& now, const glm::vec3& centre, float radius, float voxel, float maxSlack);

        /// How far the bodies may move until a new list no longer holds [m]; 0: they move too fast for one. Asked for
        /// after holds() has said no.
        float slack() const { return slack_; }
        const std::vector<std::uint32_t>& points() const { return points_; }
        void add(std::uint32_t point) { points_.push_back(point); }

      private:
        std::vector<std::uint32_t> points_;
        Place listed_, last_;
        float slack_ = 0;
    };

    List ofA, ofB;
};

}  // namespace bilayer::detail
