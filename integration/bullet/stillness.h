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
/// Nothing is held that has no weight, that a constraint or a force moves, or that touches such a body that moves, a
/// kinematic one that moves, or what lies on these. What the user puts elsewhere is left there. But what is slower than
/// that for any other reason stays for good, even on ice: what rolls on ends so, what gets less speed than that by the
/// user or by another body does not start, and what slides by a little more than friction holds, by a part e of its
/// weight, waits for 0.15 / e steps.
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
        bool sleeps = false;  ///< or was woken since Bullet has given weight to bodies
    };
    static bool isDriven(const Place& place, const btCollisionObject& object);
    static bool stays(Place& place, const btRigidBody& body, float seconds);
    static void hold(Place& place, btRigidBody& body, float seconds);

    btDynamicsWorld& world_;
    std::vector<Place> places_;  ///< in the world's order
    int held_ = 0;
};

}  // namespace bilayer::bullet
