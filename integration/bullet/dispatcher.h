// Bullet's dispatcher with every pair that a field takes part in.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>

#include <memory>

#include "integration/bullet/shape.h"

namespace bilayer::bullet {

/// What the last step's narrow phase did.
struct DispatchStatistics {
    int pairs = 0;              ///< pairs with a field in them
    int contactsFound = 0;      ///< before reduction
    int contactsKept = 0;       ///< handed to the solver
    int beyondBand = 0;         ///< points too deep for the band (see ContactReport)
    double seconds = 0;         ///< for all of these pairs
};

/// Use it in place of btCollisionDispatcher. All pairs of a step in which both shapes are fields are collided as one TBB
/// batch, and their contacts are handed to Bullet in order: the same bits for any number of threads.
class Dispatcher : public btCollisionDispatcher {
  public:
    explicit Dispatcher(btCollisionConfiguration* configuration);
    ~Dispatcher() override;

    void dispatchAllCollisionPairs(btOverlappingPairCache* pairs, const btDispatcherInfo& info,
                                   btDispatcher* dispatcher) override;

    const DispatchStatistics& statistics() const;

  private:
    struct Batch;
    std::unique_ptr<Batch> batch_;
};

/// Owns what Bullet calls to make the algorithms of field pairs; must outlive the dispatcher it is registered on.
class Algorithms {
  public:
    Algorithms();
    ~Algorithms();
    /// Fills both dispatch tables: fields against every convex shape, planes, triangle meshes, height fields and fields,
    /// in either order. Call it after btGImpactCollisionAlgorithm::registerAlgorithm, which overwrites rows.
    void registerOn(btCollisionDispatcher& dispatcher);

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace bilayer::bullet
