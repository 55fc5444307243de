// From hundreds of contacts to the few that Bullet's solver needs, and into its manifolds.
#pragma once

#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>

#include <array>
#include <span>
#include <vector>

#include "collider/collider.h"

namespace bilayer::bullet {

/// Contacts with about the same normal: those farthest to four sides, and the deepest.
struct Patch {
    std::array<Contact, MANIFOLD_CACHE_SIZE> contacts;
    int count = 0;
};

/// Divides contacts into patches by their normals and keeps up to four a patch. Deterministic: depends on the contacts,
/// their order and `last` only. The patch of the deepest contact of all comes first if there was none in the last step.
/// `contacts` is left in another order.
/// @param last  the result for the same pair in the last step, or nothing: while the bodies hardly move, patches keep
/// their places, and of contacts
///              that are nearly as good, those that were kept then are kept again
std::vector<Patch> reduce(std::vector<Contact>& contacts, std::span<const Patch> last = {});

/// The manifolds of one pair of bodies, one for each patch. Contacts are written anew each step, since Bullet refreshes
/// the positions of old ones but not their normals; impulses are handed on to the new contacts nearest the old ones,
/// and so the solver starts warm.
class Manifolds {
  public:
    explicit Manifolds(btDispatcher& dispatcher) : dispatcher_(dispatcher) {}
    ~Manifolds();
    Manifolds(const Manifolds&) = delete;
    Manifolds& operator=(const Manifolds&) = delete;

    /// Replaces all contacts. Goes through btManifoldResult::addContactPoint, so that friction, restitution, callbacks
    /// and contact tests work as for Bullet's own shapes.
    /// @param a, b  the bodies A and B of the patches; `result` may hold them in either order, as within a compound
    /// @param sameWithin  an old and a new contact nearer than this on either body are the same [m]
    void write(std::span<const Patch> patches, const btCollisionObject& a, const btCollisionObject& b, float sameWithin,
               btManifoldResult& result);

    std::span<btPersistentManifold* const> all() const { return manifolds_; }

  private:
    void emit(const Contact& contact, bool aIsFirst, float sameWithin, btManifoldResult& result);
    void inherit(btManifoldPoint& point, float sameWithin);

    btDispatcher& dispatcher_;
    std::vector<btPersistentManifold*> manifolds_;
    std::vector<btManifoldPoint> old_;  ///< points of the last step that no new one has inherited from yet
};

}  // namespace bilayer::bullet
