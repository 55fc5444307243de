// SPDX-License-Identifier: Apache-2.0
// The data that the contact search of a pair of bodies keeps between steps.
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "collider/contact/reduction/contact_reduction.h"

namespace bilayer::detail {

/// Candidate lists: the surface points of two bodies that may touch the other body. A list is valid until the bodies
/// have moved by its slack, a fraction of a voxel (a Verlet list: L. Verlet, "Computer experiments on classical
/// fluids", Physical Review 159 (1967)). Use one per pair of bodies. collide() finds the same contacts with it as
/// without. The cost of resting bodies is then little more than that of their contacts, and close to zero without
/// contacts.
struct CandidateLists {
    /// The transform from the coordinates of one body to those of the other.
    struct RelativePose {
        std::uint64_t body = 0, other = 0;  ///< Collider::id()
        float reach = 0;                    ///< max separation of contacts [m, at the other body's scale]
        glm::mat3 linear{0};
        glm::vec3 shift{0};
    };

    /// The candidate points of one body in the field of the other.
    class List {
      public:
        /// Whether the list contains all points that can touch. If not, clears the list and chooses a new slack.
        /// @param centre, radius  of a bounding sphere of the body, in its own coordinates [m]
        /// @param voxel           of the other body's field [m]
        /// @param maxSlack        upper limit of the slack [m]
        bool keepOrReset(const RelativePose& pose, const glm::vec3& centre, float radius, float voxel, float maxSlack);

        /// How far the bodies may move before a new list is invalid [m]. 0: they move too fast for a list. Call it
        /// after keepOrReset() has returned false.
        float slack() const { return slack_; }
        const std::vector<std::uint32_t>& points() const { return points_; }
        void add(std::uint32_t point) { points_.push_back(point); }

      private:
        std::vector<std::uint32_t> points_;
        RelativePose listed_, last_;
        float slack_ = 0;
    };

    List ofA, ofB;
};

/// What a ContactCache holds.
struct ContactMemory {
    CandidateLists candidates;
    ContactReduction reduction;
};

}  // namespace bilayer::detail
