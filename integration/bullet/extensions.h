// SPDX-License-Identifier: Apache-2.0
// Work at the end of each step of a Bullet world with fields, in addition to Bullet's own: continuous collision, rest
// stabilisation, smooth ground and gyroscopic integration.
// Tested by tests/bullet/gyroscopic_integrator.cpp.
#pragma once

#include <BulletDynamics/Dynamics/btDynamicsWorld.h>

#include <memory>

namespace bilayer::bullet {

/// Options of WorldExtensions.
struct ExtensionOptions {
    /// Tunnelling prevention: no body passes through a field, and no field through anything, at any speed and any
    /// thickness.
    ///
    /// The Dispatcher makes speculative contacts along each body's motion. But Bullet's solver is iterative, and an
    /// impact can send a fast body along a different path, by far more than the thickness of a plate. So the path of
    /// each fast body in a step, rotation included, is checked at the end of the step against everything that it swept
    /// over. Where it would cross a surface, the body stays at the point of impact for the rest of the step, in which
    /// its weight adds no speed. It keeps its velocity, and its contacts there belong to the next step. If two bodies
    /// hold each other back in two successive steps, they lose their approach velocity. Bodies that cannot move at all
    /// come to rest.
    ///
    /// Bodies that move less than a margin in a step cost almost nothing. The results are the same bits for any number
    /// of threads. Not handled are:
    /// - shapes with speculative == false, pairs without a field, and kinematic bodies;
    /// - btGImpactMeshShape, which still gets the Dispatcher's speculative contacts.
    bool continuousCollision = true;

    /// Rest stabilisation: bodies at rest keep their positions. Rounding in Bullet's solver leaves them a small random
    /// velocity in each step. In minutes it moves a body by 0.1 voxels, and then part of a pile slides.
    ///
    /// Speeds are those of a body's farthest point, in percent of the speed that gravity adds in one step. A body is
    /// held if its speed at the end of a step is below 5 % and does not grow: 2 mm/s at 240 steps a second, 8 mm/s
    /// at 60. A held body keeps its position to the bit, and keeps its velocity. It is released when its speed changes
    /// by 5 % for four steps, or grows to 15 %. It then gets the velocity that it had when it was first held, so that
    /// an oscillating body gains no energy.
    ///
    /// Never held are bodies without weight, bodies that a constraint or a force moves, and bodies in contact with one
    /// of these or with a moving kinematic body.
    ///
    /// A body below the limit for any other reason is held for good, even on ice: it stops rolling, and does not start.
    /// A body that slides because the load exceeds the friction limit by a fraction e of its weight starts only after
    /// 0.15 / e steps.
    bool restStabilisation = false;

    /// Smooth ground: bodies with a field keep their energy when they slide or roll over the shallow edges of static
    /// triangle meshes and height fields, as over the smooth surface that the triangles stand for. At each edge whose
    /// faces differ by an angle t, an impact without a bounce takes the fraction sin^2(t) of a body's kinetic energy: a
    /// block that slides over waves of 0.1 m on cells of its own size loses up to 71 % of its speed in 3 s. At the end
    /// of each step, the linear velocity gets back what the step's impulses have taken.
    ///
    /// - Edges whose faces differ by less than 20 degrees count. Let a be the sum of three angles: that of the sharpest
    ///   edge of the ground below or just behind; that of the sharpest edge of the body's own triangle at the contact;
    ///   and, if the body has such an edge, the body's rotation in a step.
    /// - Impacts get back up to eight times the energy that an edge of the angle a can take at the body's speed, and up
    ///   to the energy that a body takes to tip over such an edge. So a drop on the ground is an impact as usual, and a
    ///   flat floor gives nothing back to a box.
    /// - A body that rolls also gets back what friction takes at such impacts, if its contact point slips by at most
    ///   tan^2(a) of the speed. Friction that brakes a sliding body counts as usual.
    /// - A body that is slower along the ground than gravity accelerates it in two steps gets nothing.
    /// - The kinetic energy of a body changes by half in a step at most.
    /// - Contacts, normals and positions of the step stay as they are.
    ///
    /// Not handled are fields, planes and boxes as ground, compounds that hold one of these, ground that moves, and
    /// bodies without a field.
    ///
    /// Leave `m_splitImpulsePenetrationThreshold` of the world's solver at minus half a voxel or below, such as
    /// Bullet's default of -4 cm. Bullet lifts bodies out of deeper penetrations without taking the height from their
    /// speed: with -1 mm and voxels of 1.25 cm, bodies gain energy on high waves at 60 steps a second.
    bool smoothGround = true;

    /// Gyroscopic integrator: bodies without external forces keep their angular momentum, and their energy to second
    /// order in the step. Bullet corrects the angular velocity by a gyroscopic torque to first order. A body that
    /// tumbles in free flight loses 10 % of its angular momentum a minute at 240 steps a second.
    ///
    /// Each step rotates a body by its angular velocity in the middle of the step, found from its angular momentum (the
    /// implicit midpoint rule: J. C. Simo, K. K. Wong, "Unconditionally stable algorithms for rigid body dynamics that
    /// exactly preserve energy and momentum", Int. J. Numer. Meth. Engng. 31 (1991)). The changes by contacts,
    /// constraints, torques and damping are added to the angular momentum. Bullet's own gyroscopic torque is switched
    /// off, body by body. A world takes one integrator only: see WorldExtensions.
    bool gyroscopicIntegration = false;
};

/// Extends a world from its construction on. The world must outlive it.
///
/// The user's own tick callbacks keep working, whether they are set before or after: pre-tick callbacks run before the
/// extensions, others after them. Set a pre-tick callback once, not before each step: smooth ground and gyroscopic
/// integration skip the first step after it is set.
///
/// A world may have several of these; smooth ground acts once. Only one of them may have
/// ExtensionOptions::gyroscopicIntegration, since each integrator takes over the rotation of all bodies: the
/// constructor of a second one throws std::invalid_argument and leaves the world as it was.
class WorldExtensions {
  public:
    /// Acts at the end of each step of the world, which must outlive this object.
    explicit WorldExtensions(btDynamicsWorld& world, const ExtensionOptions& options = {});
    ~WorldExtensions();
    WorldExtensions(const WorldExtensions&) = delete;
    WorldExtensions& operator=(const WorldExtensions&) = delete;

    int stoppedBodies() const;  ///< bodies that continuous collision stopped on their paths in the last step
    int restingBodies() const;  ///< bodies that rest stabilisation held in the last step

  private:
    class Hook;
    std::unique_ptr<Hook> hook_;
};

}  // namespace bilayer::bullet
