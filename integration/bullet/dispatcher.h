// Bullet's dispatcher with every pair that a field takes part in.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>
#include <bilayer/collider/contact.h>

#include <memory>

#include <bilayer/collider/contact.h>

namespace bilayer::bullet {

/// What the last step's narrow phase did.
struct DispatchStatistics {
    int pairs = 0;          ///< pairs with a field in them that were awake and whose boxes overlapped
    int contactsFound = 0;  ///< before reduction
    int contactsKept = 0;   ///< handed to the solver
    /// What that took off the contacts' effect: of all pairs, how deep a contact that was left out could come before
    /// one that was kept is met [m]
    float reductionError = 0;
    int beyondBand = 0;  ///< points too deep for the band (see ContactReport)
    int sampled = 0;     ///< pairs whose points the sampler has sampled, see Dispatcher
    double seconds = 0;  ///< for all of these pairs, Bullet's own included
};

/// Use it in place of btCollisionDispatcher: fields then collide with every convex shape, planes, triangle meshes,
/// height fields and fields, also inside compounds, in contact tests, and in either order.
///
/// All pairs of a step that hold a field, children of compounds included, are collided as one TBB batch, and their
/// contacts are handed to Bullet in order: the same bits for any number of threads. Also set
/// btCollisionWorld::getDispatchInfo().m_deterministicOverlappingPairs where runs that add and remove bodies in another
/// order must agree.
///
/// With a sampler, `openclPointSampler(device)` for example, the points of all pairs of fields are sampled by it, in
/// one batch, but for those whose motion is to be followed; the contacts are the same, bit by bit, where the device
/// computes as IEEE 754 has it. Where the sampler fails, the processor takes over for good, in that very step, and a
/// line on the standard error output says so: DispatchStatistics::sampled is then 0.
class Dispatcher : public btCollisionDispatcher {
  public:
    explicit Dispatcher(btCollisionConfiguration* configuration, PointSampler sampler = {});
    ~Dispatcher() override;

    /// Fills Bullet's tables once more. The constructor has done so; btGImpactCollisionAlgorithm::registerAlgorithm
    /// overwrites a row and a column.
    void registerFields();

    void dispatchAllCollisionPairs(btOverlappingPairCache* pairs, const btDispatcherInfo& info,
                                   btDispatcher* dispatcher) override;

    const DispatchStatistics& statistics() const;

  private:
    struct Functions;
    std::unique_ptr<Functions> functions_;
};

/// Fields for a dispatcher that is Bullet's own, or yours: it then collides them with all that a Dispatcher does, by
/// the same contacts, but pair after pair on the thread that steps the world. Not for btCollisionDispatcherMt.
class FieldAlgorithms {
  public:
    /// Fills the dispatcher's tables. Must outlive the worlds that the dispatcher serves.
    explicit FieldAlgorithms(btCollisionDispatcher& dispatcher);
    ~FieldAlgorithms();
    FieldAlgorithms(const FieldAlgorithms&) = delete;
    FieldAlgorithms& operator=(const FieldAlgorithms&) = delete;

    /// Fills them once more, as Dispatcher::registerFields().
    void registerFields();

  private:
    struct Functions;
    btCollisionDispatcher& dispatcher_;
    std::unique_ptr<Functions> functions_;
};

}  // namespace bilayer::bullet
