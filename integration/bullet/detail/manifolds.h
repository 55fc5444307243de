// SPDX-License-Identifier: Apache-2.0
// Writes contacts into Bullet's manifolds, and carries impulses and friction anchors from step to step.
// Tested by tests/bullet/manifolds.cpp through bullet::Dispatcher.
#pragma once

#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <bilayer/collider/contact.h>

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "collider/contact/reduction/contact_reduction.h"
#include "collider/contact/search/predicted_contacts.h"
#include "integration/bullet/detail/triangle_ids.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// Data that a manifold gets in addition to the contact itself.
struct ContactDetails {
    std::optional<PredictedContact> prediction;  ///< if the contact point rotates with its body
    std::optional<TriangleId> triangle;          ///< the triangle of A
};

/// Parameters of the transfer of contacts from step to step.
struct Continuity {
    float sameWithin = 0;        ///< an old and a new contact closer than this on either body are the same [m]
    float restingFriction = 1;   ///< as in ShapeOptions
    bool isSpeculative = false;  ///< speculative contacts cover the whole motion of the step, not only the margin
};

/// Whether the result is the user's own, as in contact tests. It then gets every contact.
bool isOfUser(const btManifoldResult& result);

/// The manifolds of one pair of bodies, one for each contact patch. All contacts are rewritten in each step, since
/// Bullet refreshes the positions of old contacts but not their normals. Each new contact inherits the impulse of the
/// nearest old one, for warm starting.
///
/// Sticking contacts have friction anchors: btContactSolverInfo::m_frictionERP pulls back their drift along the surface
/// (0: not at all), which keeps piles in place.
class Manifolds {
  public:
    explicit Manifolds(btDispatcher& dispatcher) : dispatcher_(dispatcher) {}
    ~Manifolds();
    Manifolds(const Manifolds&) = delete;
    Manifolds& operator=(const Manifolds&) = delete;

    /// Replaces all contacts. Friction, restitution and callbacks are those of Bullet's own shapes, and so are the
    /// identifiers. Part and index name the triangle of a mesh, or the child of a compound with part -1. Otherwise the
    /// part is 0, and the index is the contact's feature, or -1 if the feature is the other body's. A user's result
    /// gets each contact by btManifoldResult::addContactPoint().
    /// @param details  one for each contact of the patches
    /// @param a, b     the bodies A and B of the patches; `result` may hold them in either order, as within a compound
    /// @param seconds  duration of the step [s]; 0 between steps
    void write(std::span<const ContactPatch> patches, std::span<const ContactDetails> details,
               const btCollisionObject& a, const btCollisionObject& b, float seconds, const Continuity& continuity,
               btManifoldResult& result);

    std::span<btPersistentManifold* const> all() const { return manifolds_; }

  private:
    /// The bodies and parameters of the coming step.
    struct Step;
    void takeOldPoints();
    /// Writes manifold m.
    void fill(std::size_t m, std::span<const Contact> contacts, std::span<const ContactDetails> details,
              const Step& step);
    /// A contact as it was written into a manifold. Within compounds, Bullet moves and reorders contacts before we read
    /// them back.
    struct Written {
        btVector3 ofA{0, 0, 0}, ofB{0, 0, 0};  ///< its position on each body
        btVector3 drift{0, 0, 0};              ///< displacement along the surface that friction has to pull back
        float rest = 0;                        ///< state of resting friction: 1 for the full increase
    };
    Written writtenAs(const btManifoldPoint& point, std::size_t manifold) const;
    Written inherit(btPersistentManifold& manifold, int index, const Continuity& continuity);
    static void releaseAnchor(const btPersistentManifold& manifold, btManifoldPoint& point, Written& written);

    /// A manifold point of the last step.
    struct OldPoint {
        btManifoldPoint point;
        Written written;
    };
    btDispatcher& dispatcher_;
    std::vector<btPersistentManifold*> manifolds_;
    std::vector<std::array<Written, MANIFOLD_CACHE_SIZE>> written_;  ///< the contents of the manifolds
    std::vector<OldPoint> old_;  ///< those that no new contact has inherited from yet
};

}  // namespace bilayer::bullet::detail
