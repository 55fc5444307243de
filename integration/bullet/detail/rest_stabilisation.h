// Bodies at rest that stay where they are.
#pragma once

#include <BulletDynamics/Dynamics/btDynamicsWorld.h>

#include <unordered_set>
#include <vector>

namespace bilayer::bullet::detail {

/// Of a body.
struct Velocities {
    btVector3 linear{0, 0, 0}, angular{0, 0, 0};  ///< [m/s], [rad/s]
};

/// Keeps bodies at rest where they are: ExtensionOptions::restStabilisation.
class RestStabilisation {
  public:
    explicit RestStabilisation(btDynamicsWorld& world) : world_(world) {}

    void afterStep(float seconds);
    int restingBodies() const { return held_; }  ///< in the last step

  private:
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

}  // namespace bilayer::bullet::detail
