// Bodies at rest that stay where they are.
#pragma once

#include <BulletDynamics/Dynamics/btActionInterface.h>
#include <BulletDynamics/Dynamics/btDynamicsWorld.h>

#include <unordered_set>
#include <vector>

namespace bilayer::bullet {

/// Of a body.
struct Velocities {
    btVector3 linear{0, 0, 0}, angular{0, 0, 0};  ///< [m/s], [rad/s]
};

/// Keeps bodies at rest from wandering. Bullet's solver leaves what lies still some speed in each step, which is
/// rounding and has no direction, but in minutes it takes a body by a tenth of a voxel; then one is no longer held, and
/// part of a heap slides.
///
/// What is slower at the end of a step than 5 % of the speed that gravity gives in one (at its farthest point; 2 mm/s
/// with 240 steps a second, 8 mm/s with 60), and getting no faster, has not moved: it stays at the place where it was,
/// to the bit, and keeps its speed. Contacts then find the same again, the solver comes to an end from step to step,
/// and what nothing holds up falls in the next one: what is held goes on when something pushes it by 5 % at once, which
/// is known when that has lasted for four steps, or when its speed has grown to 15 %; then with as much as it had when
/// it came to be held, and so what swings gets no energy. What wakes up is held until then, too.
///
/// Nothing is held that has no weight, that a constraint or a force moves, that the user puts elsewhere, that touches
/// such a body or a kinematic one that moves, or is stacked on what does. But what lies still and gets less speed than
/// that, by the user or by another body, stays for good, even on ice.
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

    /// Where an object was at the end of the last step, and how it went.
    struct Place {
        const btCollisionObject* object = nullptr;
        btTransform transform = btTransform::getIdentity();
        Velocities last{};  ///< of a body, in the last step
        Velocities calm{};  ///< and before something pushed it, if it is held
        int pushes = 0;     ///< steps since then
        /// Of the farthest point, at that time; of what is held, when it came to be [parts of what gravity gives in a
        /// step].
        float speed = 0;
        bool isHeld = false;
    };
    static bool stays(Place& place, const btRigidBody& body, float seconds);
    static void hold(Place& place, btRigidBody& body, float seconds);

    btDynamicsWorld& world_;
    std::vector<Place> places_;  ///< in the world's order
    int held_ = 0;
};

}  // namespace bilayer::bullet
