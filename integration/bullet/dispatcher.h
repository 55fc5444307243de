// SPDX-License-Identifier: Apache-2.0
// A Bullet dispatcher that collides fields with all of Bullet's shapes.
// Tested by tests/bullet/pairs.cpp.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>

#include <memory>

#include <bilayer/collider/contact.h>
#include <bilayer/sdf/level_set.h>

namespace bilayer::bullet {

/// Counts and times of the last step's narrow phase.
struct DispatchStatistics {
    int pairs = 0;          ///< pairs with a field that were awake and whose boxes overlapped
    int contactsFound = 0;  ///< before reduction
    int contactsKept = 0;   ///< handed to the solver
    /// Error of the reduction: over all pairs, the maximum depth that a discarded contact could reach before a kept
    /// contact touches [m]
    float reductionError = 0;
    int beyondBand = 0;    ///< points deeper than the band reaches (see ContactReport)
    int sampled = 0;       ///< pairs whose points were sampled by the sampler (see Dispatcher)
    double seconds = 0;    ///< for all of these pairs, including Bullet's own work
    DeviceTimes device{};  ///< of the sampler
};

/// Use it in place of btCollisionDispatcher. Fields then collide with every convex shape, planes, triangle meshes,
/// height fields and other fields, also inside compounds, in contact tests, and in either order.
///
/// All pairs of a step that hold a field, children of compounds included, are collided as one TBB batch. Their contacts
/// are handed to Bullet in order, so the results are the same bits for any number of threads. Runs that add and remove
/// bodies in different orders agree only if btCollisionWorld::getDispatchInfo().m_deterministicOverlappingPairs is set
/// too.
///
/// A sampler, for example `openclPointSampler(device)`, samples the surface points of all pairs of fields in one batch.
/// Pairs whose motion needs speculative contacts are excluded. The contacts are the same bits where the device computes
/// as IEEE 754 specifies. If the sampler fails, the processor takes over within the same step and permanently, and a
/// warning reports it (see setWarningCallback()). DispatchStatistics::sampled is then 0.
class Dispatcher : public btCollisionDispatcher {
  public:
    /// Registers algorithms for fields with every shape of Bullet. The configuration must outlive the dispatcher.
    /// @param sampler  samples surface points on a device, for example openclPointSampler(); empty: on the processor
    explicit Dispatcher(btCollisionConfiguration* configuration, PointSampler sampler = {});
    ~Dispatcher() override;

    /// Fills Bullet's algorithm tables again; the constructor fills them first. Needed after
    /// btGImpactCollisionAlgorithm::registerAlgorithm, which overwrites a row and a column.
    void registerFields();

    /// Finds the contacts of a step, of all pairs with fields as one parallel batch. Bullet calls it.
    void dispatchAllCollisionPairs(btOverlappingPairCache* pairs, const btDispatcherInfo& info,
                                   btDispatcher* dispatcher) override;

    const DispatchStatistics& statistics() const;  ///< of the last step

  private:
    struct Functions;
    std::unique_ptr<Functions> functions_;
};

/// Adds fields to a dispatcher of Bullet's own, or of yours. The dispatcher then collides the same pairs with the same
/// contacts as a Dispatcher, but one pair after another on the thread that steps the world. Not for
/// btCollisionDispatcherMt.
class FieldAlgorithms {
  public:
    /// Fills the dispatcher's algorithm tables. This object must outlive the worlds that the dispatcher serves.
    explicit FieldAlgorithms(btCollisionDispatcher& dispatcher);
    ~FieldAlgorithms();
    FieldAlgorithms(const FieldAlgorithms&) = delete;
    FieldAlgorithms& operator=(const FieldAlgorithms&) = delete;

    /// Fills the tables again, as Dispatcher::registerFields().
    void registerFields();

  private:
    struct Functions;
    btCollisionDispatcher& dispatcher_;
    std::unique_ptr<Functions> functions_;
};

/// Receives a warning, without a line break. It must not throw, and may be called from any thread.
using WarningCallback = void (*)(const char* message);

/// Sets the function that receives the warnings of this library: a missing dispatcher (see Shape), and a sampler that
/// has failed. The default, nullptr, prints each as a line on the standard error output. A warning that comes once
/// comes again after this call. Returns the previous function.
WarningCallback setWarningCallback(WarningCallback callback);

}  // namespace bilayer::bullet
