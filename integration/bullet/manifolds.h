// From hundreds of contacts to the few that Bullet's solver needs, and into its manifolds.
#pragma once

#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "collider/collider.h"

namespace bilayer::bullet {

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
    float lost = 0;
    /// As long as the bodies have moved past each other by no more than this, the same contacts would do [m].
    float slack = 0;
};

/// Divides contacts by their normals and keeps of each such patch those that any small motion of the bodies (a press,
/// tilts about all axes along the patch, shifts and twists) meets first, up to twelve: the gap of a contact changes by
/// the product of its wrench and the motion, so that these bear the same loads as all of them, but for what `lost`
/// tells. Deterministic: depends on the contacts, their order and `last` only. The patch of the deepest contact of all
/// comes first if there was none in the last step. `contacts` is left in another order.
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

/// A contact of bodies that turn as it is going to be at the end of the step, in the coordinates of a world that goes
/// along with either body's centre, and what is left of the gap but for the ways that the solver sees (Turning).
struct Ahead {
    btVector3 onA, onB;  ///< its places on the bodies [m]
    btVector3 normal;    ///< from B to A
    float distance;      ///< [m]
};

/// How contacts go on from step to step.
struct Continuity {
    float sameWithin = 0;       ///< an old and a new contact nearer than this on either body are the same [m]
    float restingFriction = 1;  ///< as in ShapeOptions
    bool isSwept = false;       ///< there are contacts with all that is met in the step, not only with what is near now
};

/// The manifolds of one pair of bodies, one for each patch. Contacts are written anew each step, since Bullet refreshes
/// the positions of old ones but not their normals; impulses are handed on to the new contacts nearest the old ones,
/// and so the solver starts warm. Contacts that friction holds are anchored: what they drift along the surface in spite
/// of it, they are pulled back by btContactSolverInfo::m_frictionERP (0: not at all), so that heaps do not creep.
class Manifolds {
  public:
    explicit Manifolds(btDispatcher& dispatcher) : dispatcher_(dispatcher) {}
    ~Manifolds();
    Manifolds(const Manifolds&) = delete;
    Manifolds& operator=(const Manifolds&) = delete;

    /// Replaces all contacts. Goes through btManifoldResult::addContactPoint, so that friction, restitution, callbacks
    /// and contact tests work as for Bullet's own shapes.
    /// @param ahead    one for each contact of the patches, of those that turn
    /// @param a, b     the bodies A and B of the patches; `result` may hold them in either order, as within a compound
    /// @param seconds  that the step takes; 0 between steps
    void write(std::span<const Patch> patches, std::span<const std::optional<Ahead>> ahead, const btCollisionObject& a,
               const btCollisionObject& b, float seconds, const Continuity& continuity, btManifoldResult& result);

    std::span<btPersistentManifold* const> all() const { return manifolds_; }

  private:
    void emit(const Contact& contact, bool aIsFirst, btManifoldResult& result);
    /// A contact as it went into a manifold: within compounds, Bullet moves contacts on and about before we see them.
    struct Written {
        btVector3 ofA{0, 0, 0}, ofB{0, 0, 0};  ///< its place on either body
        btVector3 drift{0, 0, 0};              ///< along the surface, that it is to be pulled back
        float rest = 0;                        ///< how far it has come to rest: 1 when it bears all that it may
    };
    Written writtenAs(const btManifoldPoint& point, std::size_t manifold) const;
    Written inherit(btPersistentManifold& manifold, int index, const Continuity& continuity);
    static void letGo(const btPersistentManifold& manifold, btManifoldPoint& point, Written& written);

    /// A point of the last step.
    struct Old {
        btManifoldPoint point;
        Written written;
    };
    btDispatcher& dispatcher_;
    std::vector<btPersistentManifold*> manifolds_;
    std::vector<std::array<Written, MANIFOLD_CACHE_SIZE>> written_;  ///< what they hold
    std::vector<Old> old_;                                           ///< those that no new one has inherited from yet
};

}  // namespace bilayer::bullet
