// Contacts go into Bullet's manifolds, and on from step to step.
#pragma once

#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <bilayer/collider/contact.h>

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "integration/bullet/detail/contact_reduction.h"
#include "integration/bullet/detail/triangle_ids.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// A contact of bodies that turn as it is going to be at the end of the step, in the coordinates of a world that goes
/// along with either body's centre, and what is left of the gap but for the ways that the solver sees (Turning).
struct PredictedContact {
    btVector3 onA, onB;  ///< its places on the bodies [m]
    btVector3 normal;    ///< from B to A
    float distance;      ///< [m]
};

/// What goes into a manifold besides a contact itself.
struct ContactDetails {
    std::optional<PredictedContact> ahead;  ///< of one that turns
    std::optional<TriangleId> triangle;     ///< of A
};

/// How contacts go on from step to step.
struct Continuity {
    float sameWithin = 0;       ///< an old and a new contact nearer than this on either body are the same [m]
    float restingFriction = 1;  ///< as in ShapeOptions
    bool isSwept = false;       ///< there are contacts with all that is met in the step, not only with what is near now
};

/// Whether a user has made the result, as contact tests do: he takes contacts as he likes.
bool isOfUser(const btManifoldResult& result);

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

    /// Replaces all contacts. Friction, restitution and callbacks are those of Bullet's own shapes, and so are
    /// identifiers: part and index name the triangle of a mesh, else the child of a compound with part -1. For all else
    /// the part is 0, and the index is the contact's feature, or -1 where that is the other body's. A user's result
    /// gets each contact by btManifoldResult::addContactPoint().
    /// @param details  one for each contact of the patches
    /// @param a, b     the bodies A and B of the patches; `result` may hold them in either order, as within a compound
    /// @param seconds  that the step takes; 0 between steps
    void write(std::span<const Patch> patches, std::span<const ContactDetails> details, const btCollisionObject& a,
               const btCollisionObject& b, float seconds, const Continuity& continuity, btManifoldResult& result);

    std::span<btPersistentManifold* const> all() const { return manifolds_; }

  private:
    /// The bodies in the step that follows.
    struct Step;
    void takeOld();
    /// Writes manifold m.
    void fill(std::size_t m, std::span<const Contact> contacts, std::span<const ContactDetails> details,
              const Step& step);
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

}  // namespace bilayer::bullet::detail
