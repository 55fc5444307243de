// A body of any concave shape in Bullet: a collision shape that collides by its signed distance field.
//
// Written for Bullet 3.24 as packaged: single precision, no patches. docs/contacts.md tells the pipeline.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>

#include <memory>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/integration/bullet/dispatcher.h>

namespace bilayer::bullet {

struct ShapeOptions {
    /// Where the collider sits in the body: collider coordinates x become frame.toWorld(x). Bullet takes the body's
    /// origin for the centre of mass and its axes for the principal ones: centreOfMassFrame() makes that true for a
    /// mesh modelled about any other point.
    Pose frame{};
    /// Contacts are made up to this distance between the surfaces, and the bodies' boxes grow by it [m, before
    /// scaling]. It keeps resting contacts alive; bodies still rest surface on surface. Negative: the collider's own.
    float margin = -1;
    /// Whether bodies that move farther than the margin in a step are followed on their way: contacts are then made of
    /// what a step would meet, and the solver lets bodies come that far. Surface points follow straight ways, and the
    /// solver is iterative: what goes by more than the thickness of a wall in a step may still pass it, unless
    /// continuous collision (extensions.h) looks after the world.
    bool speculative = true;
    /// How many times as much friction contacts bear that have not slipped for 120 steps; 1: no more. It comes by and
    /// by, and goes with the slip: all of it in a tenth of a voxel. Heaps come to rest with friction at its limit in
    /// many contacts, and there any rounding lets a body slip on that is kept awake. Of two fields the larger one
    /// counts. Real bodies rest more firmly too: J. H. Dieterich, "Time-dependent friction in rocks", J. Geophys. Res.
    /// 77 (1972) 3690-3697.
    float restingFriction = 1;
};

/// The frame in which the body's origin is the mesh's centre of mass and its axes are the principal ones.
Pose centreOfMassFrame(const Collider& collider);

/// Needs a bilayer::bullet::Dispatcher, or FieldAlgorithms with a dispatcher of Bullet's own: without either, Bullet
/// falls back to the triangles of the mesh against convex bodies, and to nothing against concave ones (other fields,
/// planes, triangle meshes, height fields), which it passes through. Bullet never calls the shapes of such a pair, so
/// this is warned of only where boxes tell: once in a process, on the standard error output, when the box of a dynamic
/// body of a field meets another field's while the process has no Dispatcher and no FieldAlgorithms at all. Not seen
/// are dynamic compounds, worlds without getDispatchInfo().m_useContinuous, and all worlds of a process that has a
/// Dispatcher for one of them. The warning is wrong where collision filters keep the two fields apart.
/// Like all shapes, it may serve any number of bodies.
class Shape : public btConcaveShape {
  public:
    explicit Shape(std::shared_ptr<const Collider> collider, const ShapeOptions& options = {});
    ~Shape() override;

    const Collider& collider() const { return *collider_; }
    const Pose& frame() const { return frame_; }
    /// The collider in the world, for a body's transform.
    Placed placed(const btTransform& bodyTransform) const;
    bool speculative() const { return speculative_; }
    float restingFriction() const { return restingFriction_; }
    /// The voxels' edge after scaling [m].
    float voxelSize() const { return scale() * collider_->field().voxelSize(); }

    /// Positive uniform scales only; others throw std::invalid_argument.
    void setLocalScaling(const btVector3& scaling) override;
    const btVector3& getLocalScaling() const override { return scaling_; }
    float scale() const { return scaling_.x(); }

    /// As in ShapeOptions, but after scaling [m].
    void setMargin(btScalar margin) override;
    btScalar getMargin() const override { return m_collisionMargin; }

    void getAabb(const btTransform& transform, btVector3& lower, btVector3& upper) const override;
    /// From the mesh, about the body's origin. Throws std::invalid_argument for a mesh without volume.
    void calculateLocalInertia(btScalar mass, btVector3& inertia) const override;
    /// Serves rays, swept spheres and other casts as the mesh would answer, debug drawing and soft bodies with the
    /// triangles that meet the box. Of a body without a mesh the field answers rays from outside, and swept spheres
    /// that are narrower than the band less sqrt(3) voxels; all else is served with the triangles of the field's zero
    /// set.
    void processAllTriangles(btTriangleCallback* callback, const btVector3& lower,
                             const btVector3& upper) const override;
    /// In voxels, not in parts of the body's size as Bullet's default, which merges contacts on fine features.
    btScalar getContactBreakingThreshold(btScalar defaultFactor) const override;
    const char* getName() const override { return "bilayer"; }

  private:
    class Triangles;
    void boxOf(const btTransform& transform, btVector3& lower, btVector3& upper) const;

    std::shared_ptr<const Collider> collider_;
    Pose frame_;
    bool speculative_;
    float restingFriction_;
    btVector3 scaling_{1, 1, 1};
    std::unique_ptr<Triangles> triangles_;
};

}  // namespace bilayer::bullet
