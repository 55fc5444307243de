// SPDX-License-Identifier: Apache-2.0
// A pair of bodies, one of them a field: from their shapes to contacts in Bullet.
// Tested by tests/bullet/pairs.cpp through bullet::Shape.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>

#include <optional>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/integration/bullet/dispatcher.h>
#include "integration/bullet/detail/contact_shapes.h"
#include "integration/bullet/detail/manifolds.h"
#include "integration/bullet/detail/sampled_pairs.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

inline bool isField(const btCollisionShape& shape) {
    return shape.getShapeType() == FAST_CONCAVE_MESH_PROXYTYPE;
}

/// A shape with its world transform and its motion. For a child of a compound, the transform is the child's own.
struct Side {
    const btCollisionShape* shape;
    btTransform transform;
    const btCollisionObject* object;
    float seconds;  ///< until the next step; 0: contacts are for the current poses only

    Side(const btCollisionObjectWrapper& wrap, float seconds)
        : Side(*wrap.getCollisionShape(), wrap.getWorldTransform(), *wrap.getCollisionObject(), seconds) {}
    Side(const btCollisionShape& shape, const btTransform& transform, const btCollisionObject& object, float seconds)
        : shape(&shape), transform(transform), object(&object), seconds(seconds) {}

    /// Motion of its origin, including the forces on the body.
    Motion motion() const { return motionAt(transform.getOrigin()); }
    Motion motionAt(const btVector3& point) const;
    /// For a field.
    Placed placed() const;
};

/// Maximum separation of contacts with the field B [m].
float marginOf(const Side& a, const Side& b);

/// Two overlapping bodies A and B; B is a field. Colliding them changes nothing in Bullet, so many pairs can be
/// collided in parallel. The contacts are handed over later.
class Pair {
  public:
    Pair(btDispatcher& dispatcher, DispatchStatistics& statistics) : manifolds_(dispatcher), statistics_(statistics) {}

    /// In a step: finds and reduces contacts up to the shapes' margins.
    void collide(const Side& a, const Side& b);

    /// The same for two fields whose points have been sampled as pair number `index`.
    void collide(const Side& a, const Side& b, const SampledPairs& sampled, std::size_t index);

    /// In a contact test: finds contacts up to the margins. If there are none, it doubles the distance until there are,
    /// and repeats the search once more as far as needed to guarantee the nearest one.
    /// @param asked  contacts up to this distance, or the margin if that is larger [m]
    void test(const Side& a, const Side& b, float asked);

    /// Writes the contacts into the manifolds, once.
    /// @param seconds  duration of the step [s]; 0 between steps
    void commit(const btCollisionObject& a, const btCollisionObject& b, float seconds, btManifoldResult& result);

    bool isReady() const { return isReady_; }  ///< contacts are ready for commit()
    void forget() { isReady_ = false; }
    const Manifolds& manifolds() const { return manifolds_; }

  private:
    float nearest() const;
    void find(const Side& a, const Side& b, float margin, bool exact);
    ContactShape otherShape(const btCollisionShape& shape);
    void finish(const Side& a, const Side& b);
    /// Names the triangles of the contacts, and drops predictions that leave them.
    void useTriangles(const btConcaveShape& mesh, const btTransform& transform, const Placed& field);

    Manifolds manifolds_;
    DispatchStatistics& statistics_;
    std::optional<ConvexShape> convex_;  ///< of A, if it is convex
    ContactCache cache_;                 ///< of two fields
    std::vector<Contact> contacts_;
    ContactReduction reduction_;
    Continuity continuity_;
    std::vector<ContactDetails> details_;  ///< one for each kept contact
    ContactReport report_;
    int found_ = 0, sampled_ = 0;
    bool isReady_ = false;
};

}  // namespace bilayer::bullet::detail
