// Two bodies one of which is a field, from their shapes to their contacts in Bullet.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>

#include <optional>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/integration/bullet/dispatcher.h>
#include "integration/bullet/detail/convex.h"
#include "integration/bullet/detail/manifolds.h"
#include "integration/bullet/detail/sampled_pairs.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

inline bool isField(const btCollisionShape& shape) {
    return shape.getShapeType() == FAST_CONCAVE_MESH_PROXYTYPE;
}

/// A shape where it stands in the world, and how it moves; for the child of a compound, the child's own.
struct Side {
    const btCollisionShape* shape;
    btTransform transform;
    const btCollisionObject* object;
    float seconds;  ///< until the next step; 0: contacts are asked for as things are

    Side(const btCollisionObjectWrapper& wrap, float seconds)
        : Side(*wrap.getCollisionShape(), wrap.getWorldTransform(), *wrap.getCollisionObject(), seconds) {}
    Side(const btCollisionShape& shape, const btTransform& transform, const btCollisionObject& object, float seconds)
        : shape(&shape), transform(transform), object(&object), seconds(seconds) {}

    /// Of its origin, the forces on the body included.
    Motion motion() const { return motionAt(transform.getOrigin()); }
    Motion motionAt(const btVector3& point) const;
    /// Of a field's.
    Placed placed() const;
};

/// Up to where contacts are made with B, a field [m].
float marginOf(const Side& a, const Side& b);

/// Two overlapping bodies of which B is a field. Collides them without a call that changes anything in Bullet, so that
/// many pairs can do it at once, and hands the contacts over later.
class Pair {
  public:
    Pair(btDispatcher& dispatcher, DispatchStatistics& statistics) : manifolds_(dispatcher), statistics_(statistics) {}

    /// In a step: finds and reduces contacts up to the shapes' margins.
    void collide(const Side& a, const Side& b);

    /// The same for two fields whose points have been sampled, as pair number `index`.
    void collide(const Side& a, const Side& b, const SampledPairs& sampled, std::size_t index);

    /// In a contact test: up to the margins; where there are none, up to twice as far in turns, and then once more, as
    /// far as it takes to be sure of the nearest.
    /// @param asked  contacts up to this distance, or the margin if that is larger [m]
    void test(const Side& a, const Side& b, float asked);

    /// Writes what was found into the manifolds; once.
    /// @param seconds  that the step takes; 0 between steps
    void commit(const btCollisionObject& a, const btCollisionObject& b, float seconds, btManifoldResult& result);

    bool isReady() const { return isReady_; }  ///< to be committed
    void forget() { isReady_ = false; }
    const Manifolds& manifolds() const { return manifolds_; }

  private:
    float nearest() const;
    void find(const Side& a, const Side& b, float margin, bool measured);
    ContactReport collideOther(const Side& a, const Placed& field, float margin, bool measured, const Motion& motion);
    void finish(const Side& a, const Side& b);
    void nameTriangles(const btConcaveShape& mesh, const btTransform& transform, const Placed& field);

    Manifolds manifolds_;
    DispatchStatistics& statistics_;
    std::optional<Convex> convex_;  ///< of A
    ContactCache cache_;            ///< of two fields
    std::vector<Contact> contacts_;
    Choice choice_;
    Continuity continuity_;
    std::vector<ContactDetails> details_;  ///< one for each contact that is kept
    ContactReport report_;
    int found_ = 0, sampled_ = 0;
    bool isReady_ = false;
};

}  // namespace bilayer::bullet::detail
