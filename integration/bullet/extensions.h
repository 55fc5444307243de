// What a Bullet world of fields does at the end of each step, in addition to Bullet's own.
#pragma once

#include <BulletDynamics/Dynamics/btDynamicsWorld.h>

#include <memory>

namespace bilayer::bullet {

struct ExtensionOptions {
    /// No body passes through a field, and no field through anything, however fast and however thin.
    ///
    /// The Dispatcher makes speculative contacts of what a body's motion would meet. But Bullet's solver is iterative,
    /// and an impact throws bodies about: after it they may go elsewhere, by far more than a plate's thickness when
    /// they are fast. So the path of each fast body in a step is looked at once more, with its rotation, against all
    /// that it swept over. Where it would get through a surface, the body stays at the place where it touched, for the
    /// rest of this step; it keeps its velocity, and the contacts that it has there are the next step's. Two bodies
    /// that hold each other back once more then lose the speed at which they approach each other; what cannot move at
    /// all comes to rest.
    ///
    /// Bodies that move less than a margin in a step cost next to nothing. Left alone are shapes with speculative ==
    /// false, pairs without a field, kinematic bodies and btGImpactMeshShape, which the Dispatcher's speculative
    /// contacts serve still, and a body that Bullet's own CCD has stopped in this step. The same bits for any number of
    /// threads.
    bool continuousCollision = true;

    /// Bodies at rest stay where they are. Bullet's solver leaves them some speed in each step, which is rounding and
    /// has no direction, but in minutes it takes a body by a tenth of a voxel; then part of a pile slides.
    ///
    /// A body that is slower at the end of a step than 5 % of the speed that gravity gives in one (at its farthest
    /// point; 2 mm/s with 240 steps a second, 8 mm/s with 60), and gets no faster, stays where it was, to the bit, and
    /// keeps its speed. It is released when its speed changes by 5 % for four steps, or grows to 15 %; then with the
    /// speed that it had when it came to be held, so that what swings gets no energy.
    ///
    /// Never held are bodies without weight, those that a constraint or a force moves, and those that touch such a body
    /// or a kinematic one that moves. But a body that is slower than that for any other reason stays for good, even on
    /// ice: it stops rolling, does not start, and a body that slides by a part e of its weight beyond friction's limit
    /// waits for 0.15 / e steps.
    bool restStabilisation = false;

    /// Bodies on which nothing acts keep their angular momentum, and their energy to second order in the step. Bullet
    /// corrects the angular velocity by a gyroscopic torque to first order: a body that turns over in free flight loses
    /// 10 % of its angular momentum a minute at 240 steps a second.
    ///
    /// Each step turns a body by the angular velocity that it has in the middle of it, found from its angular momentum
    /// (the implicit midpoint rule: J. C. Simo, K. K. Wong, "Unconditionally stable algorithms for rigid body dynamics
    /// that exactly preserve energy and momentum", Int. J. Numer. Meth. Engng. 31 (1991)). What contacts, constraints,
    /// torques and damping do to a body in the step is added to its angular momentum. Bullet's own gyroscopic torque is
    /// switched off, body by body.
    bool gyroscopicIntegration = false;
};

/// Extends a world from its construction on. The world must outlive it. Tick callbacks of the user's keep working,
/// whether they are set before or after: pre-tick callbacks are called first, and others after the extensions.
class WorldExtensions {
  public:
    explicit WorldExtensions(btDynamicsWorld& world, const ExtensionOptions& options = {});
    ~WorldExtensions();
    WorldExtensions(const WorldExtensions&) = delete;
    WorldExtensions& operator=(const WorldExtensions&) = delete;

    int stoppedBodies() const;  ///< that continuous collision has stopped on their paths in the last step
    int restingBodies() const;  ///< that rest stabilisation has kept where they were in the last step

  private:
    class Hook;
    std::unique_ptr<Hook> hook_;
};

}  // namespace bilayer::bullet
