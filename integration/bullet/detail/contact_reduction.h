// From hundreds of contacts to the few that Bullet's solver needs.
#pragma once

#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include <array>
#include <span>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// Contacts with about the same normal, as many as one manifold holds.
struct Patch {
    std::array<Contact, MANIFOLD_CACHE_SIZE> contacts;
    int count = 0;
    bool goesOn = false;  ///< with the contacts of the patch before, which was full
};

/// What is left of a pair's contacts.
struct Reduced {
    std::vector<Patch> patches;
    /// How deep a contact that was left out could come in a small motion of the bodies before one that was kept is met
    /// [m]: the worst over tilts of 1/32 rad and shifts of 1/32 of a patch's extent, in directions between those that
    /// contacts were chosen for.
    float reductionError = 0;
    /// As long as the bodies have moved past each other by no more than this, the same contacts would do [m].
    float slack = 0;
};

/// Divides contacts by their normals and keeps of each such patch those that any small motion of the bodies (a press,
/// tilts about all axes along the patch, shifts and twists) meets first, up to twelve: the gap of a contact changes by
/// the product of its wrench and the motion, so that these bear the same loads as all of them, but for what
/// `reductionError` tells. Deterministic: depends on the contacts, their order and `last` only. The patch of the
/// deepest contact of all comes first if there was none in the last step. `contacts` is left in another order.
/// @param last  the patches of the same pair in the last step, or nothing: while the bodies hardly move, patches keep
///              their places, and of contacts that are nearly as good, those that were kept then are kept again
Reduced reduce(std::vector<Contact>& contacts, std::span<const Patch> last = {});

/// The reduced contacts of one pair of bodies from step to step: chosen anew only when the bodies have moved past each
/// other since contacts were chosen last, which bodies at rest do once in many steps.
class Choice {
  public:
    /// Reduces this step's contacts. `contacts` is left in another order.
    /// @param a, b  where the bodies are
    void update(std::vector<Contact>& contacts, const btTransform& a, const btTransform& b);

    const Reduced& reduced() const { return reduced_; }

  private:
    struct Kept {
        std::uint32_t feature;
        btVector3 ofA, ofB;  ///< its place when it was chosen, in either body's coordinates
    };
    bool holds(const btTransform& a, const btTransform& b) const;
    bool takeAgain(const std::vector<Contact>& contacts);

    Reduced reduced_;
    std::vector<Kept> kept_;                ///< of all patches, one after the other
    std::vector<std::uint32_t> byFeature_;  ///< their indices in ascending order of features
};

}  // namespace bilayer::bullet::detail
