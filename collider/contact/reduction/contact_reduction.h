// SPDX-License-Identifier: Apache-2.0
// Contact reduction: from hundreds of contacts to the few that a solver needs.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>

namespace bilayer::detail {

/// Contacts of a patch, which is as many as one of Bullet's manifolds holds.
inline constexpr std::size_t patchSize = 4;

/// A contact patch: contacts with similar normals.
struct ContactPatch {
    std::array<Contact, patchSize> contacts;
    int count = 0;
    bool continuesPrevious = false;  ///< the previous patch, which was full
};

/// Result of the reduction of a pair's contacts.
struct ReducedContacts {
    std::vector<ContactPatch> patches;
    /// Maximum depth that a discarded contact could reach in a small motion of the bodies before a kept contact touches
    /// [m]. The maximum is over tilts of 1/32 rad and shifts of 1/32 of a patch's extent, in directions between those
    /// that the contacts were chosen for.
    float reductionError = 0;
    /// The same contacts stay valid while the relative displacement of the bodies is below this [m]. Zero if no
    /// patch had more contacts than are kept, or if a contact approaches: the contacts were then chosen for the motion
    /// of that step.
    float slack = 0;
};

/// Divides contacts into patches by their normals and keeps up to twelve in each patch: those that any small motion of
/// the bodies meets first. The motions are a press, tilts about all axes along the patch, shifts and twists. The
/// separation of a contact changes by the product of its wrench and the motion, so the kept contacts bear the same
/// loads as all of them, up to `reductionError`.
///
/// Deterministic: depends only on the contacts, their order and `last`. If the last step had no patches, the patch of
/// the deepest contact comes first. Reorders `contacts`.
/// @param last      the patches of the same pair in the last step, or nothing. While the bodies hardly move, patches
///                  keep their places; among contacts that are nearly as good, those of the last step are kept again
/// @param rotation  angle by which the bodies rotate relative to each other in the step [rad]
ReducedContacts reduce(std::vector<Contact>& contacts, std::span<const ContactPatch> last = {}, float rotation = 0);

/// The reduced contacts of one pair of bodies from step to step. They are chosen again only when the bodies have moved
/// relative to each other since the last choice, which resting bodies rarely do.
class ContactReduction {
  public:
    /// Reduces this step's contacts. Reorders `contacts`.
    /// @param a, b      poses of the bodies
    /// @param rotation  angle by which the bodies rotate relative to each other in the step [rad]
    void update(std::vector<Contact>& contacts, const Pose& a, const Pose& b, float rotation);

    const ReducedContacts& reduced() const { return reduced_; }

  private:
    struct Kept {
        std::uint32_t feature;
        glm::vec3 ofA, ofB;  ///< its position when it was chosen, in the coordinates of each body
    };
    bool holds(const Pose& a, const Pose& b) const;
    bool reuse(const std::vector<Contact>& contacts);

    ReducedContacts reduced_;
    std::vector<Kept> kept_;                ///< of all patches, concatenated
    std::vector<std::uint32_t> byFeature_;  ///< indices into `kept_`, in ascending order of features
};

/// The angle by which two bodies rotate relative to each other in a step [rad].
inline float relativeRotation(const Motion& a, const Motion& b) {
    return glm::length(a.rotation - b.rotation);
}

/// Replaces the contacts from number `first` on by the reduced ones (ContactOptions::reduced).
/// @param a, b      poses of the bodies
/// @param rotation  angle by which the bodies rotate relative to each other in the step [rad]
/// @param cache     null, or that of the pair
void reduceFrom(std::size_t first, std::vector<Contact>& contacts, const Pose& a, const Pose& b, float rotation,
                ContactCache* cache);

}  // namespace bilayer::detail
