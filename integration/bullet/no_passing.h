// Bodies that stop at what a step would take them through.
#pragma once

#include <BulletDynamics/Dynamics/btActionInterface.h>
#include <BulletDynamics/Dynamics/btDynamicsWorld.h>

#include <utility>
#include <vector>

namespace bilayer::bullet {

/// Lets no body of a world pass through a field, nor a field through anything, however fast and however thin.
///
/// The Dispatcher makes contacts of what a body's motion would meet. But Bullet's solver is iterative, and an impact
/// throws bodies about: after it they may go elsewhere, by far more than a plate's thickness when they are fast. So the
/// way that each fast body has gone in a step is looked at once more, with its turn, against all that it swept over:
/// every surface point goes along its way through the other, and corners and edges of the other through the field, of
/// triangles those that are sharp. Where one would get through the surface, the body stays at the place where it
/// touched, for the rest of this step; it keeps its velocity, and the contacts that it has there are the next step's.
/// Two bodies that hold each other back once more then, since those have not stopped them, lose the speed at which they
/// go for each other there; what cannot move at all comes to rest.
///
/// Bodies that go less than a margin in a step cost next to nothing. Left alone are shapes with sweeps == false, pairs
/// without a field, pairs that the Dispatcher foresees still: bodies that the user moves (kinematic ones), and
/// btGImpactMeshShape; and where a body has got to that Bullet's own CCD has stopped in this step. The same bits for
/// any number of threads.
class NoPassing : private btActionInterface {
  public:
    /// Acts at the end of each internal step, as one of the world's actions; the world must outlive this.
    explicit NoPassing(btDynamicsWorld& world);
    ~NoPassing() override;
    NoPassing(const NoPassing&) = delete;
    NoPassing& operator=(const NoPassing&) = delete;

    /// Bodies that were held back in the last step.
    int held() const { return held_; }

  private:
    void updateAction(btCollisionWorld* world, btScalar seconds) override;
    void debugDraw(btIDebugDraw*) override {}

    btDynamicsWorld& world_;
    std::vector<std::pair<const btCollisionObject*, const btCollisionObject*>> heldPairs_;  ///< in the last step
    int held_ = 0;
};

}  // namespace bilayer::bullet
