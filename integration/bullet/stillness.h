// Bodies at rest that stay where they are.
#pragma once

#include <BulletDynamics/Dynamics/btActionInterface.h>
#include <BulletDynamics/Dynamics/btDynamicsWorld.h>

#include <unordered_set>
#include <vector>

namespace bilayer::bullet {

/// Keeps bodies at rest from wandering. Bullet's solver leaves what lies still some speed in each step, which is
/// rounding and has no direction, but in minutes it takes a body by a tenth of a voxel; then one is no longer held, and
/// part of a heap slides.
///
/// What is slower at the end of a step than a hundredth of the speed that gravity gives in one (at its farthest point;
/// 0.4 mm/s with 240 steps a second) has not moved: it stays at the place where it was, to the bit, and keeps its
/// speed. Contacts then find the same again, the solver comes to an end from step to step, and what nothing holds up
/// falls in the next one. Nothing is held that has no weight, that a constraint, a force or the user moves, that
/// touches such a body or a kinematic one that moves, or is stacked on what does. Only who sets a body's speed in each
/// step, to less than that, will find that it stays.
class Stillness : private btActionInterface {
  public:
    /// Acts at the end of each internal step, as one of the world's actions; the world must outlive this.
    explicit Stillness(btDynamicsWorld& world);
    ~Stillness() override;
    Stillness(const Stillness&) = delete;
    Stillness& operator=(const Stillness&) = delete;

    /// Bodies that stayed where they were in the last step.
    int held() const { return held_; }

  private:
    void updateAction(btCollisionWorld* world, btScalar seconds) override;
    void debugDraw(btIDebugDraw*) override {}
    std::unordered_set<const btCollisionObject*> driven() const;

    /// Where a body was at the end of the last step.
    struct Place {
        const btCollisionObject* body;
        btTransform transform;
    };
    btDynamicsWorld& world_;
    std::vector<Place> places_;  ///< in the world's order
    int held_ = 0;
};

}  // namespace bilayer::bullet
