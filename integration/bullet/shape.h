// SPDX-License-Identifier: Apache-2.0
// A Bullet collision shape for any concave body: it collides by the signed distance field of its mesh.
//
// Written for Bullet 3.24 as packaged: single precision, no patches. docs/contacts/finding.md describes the pipeline.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>

#include <memory>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/integration/bullet/dispatcher.h>

namespace bilayer::bullet {

/// Options of Shape.
struct ShapeOptions {
    /// Pose of the collider in the body: collider coordinates x become frame.toWorld(x). Bullet takes the body's origin
    /// for the centre of mass and its axes for the principal axes. Use centreOfMassFrame() for a mesh that is modelled
    /// about any other point.
    Pose frame{};
    /// Contacts are made up to this separation of the surfaces, and the bodies' bounding boxes grow by it [m, before
    /// scaling]. The margin keeps resting contacts alive; bodies still rest surface on surface. Negative: the
    /// collider's own margin.
    float margin = -1;
    /// Whether to make speculative contacts for bodies that move farther than the margin in a step. The contacts are
    /// those that the motion of the step would meet, and the solver lets the bodies approach that far. Each surface
    /// point is followed along a straight path, and the solver is iterative. A body that moves farther than the
    /// thickness of a wall in a step may therefore still tunnel through it, unless the world has continuous collision
    /// (extensions.h).
    bool speculative = true;
    /// Factor on the friction of contacts that have not slipped for 120 steps; 1: no increase. The friction rises
    /// gradually, and falls again with the slip: a slip of 0.1 voxels removes the whole increase. In a pile, many
    /// contacts come to rest at the friction limit, and there rounding alone makes a body that is kept awake slip on.
    /// For two fields the larger factor applies. The friction of real bodies rises with contact time too: J. H.
    /// Dieterich, "Time-dependent friction in rocks", J. Geophys. Res. 77 (1972) 3690-3697.
    float restingFriction = 1;
};

/// The frame whose origin is the mesh's centre of mass and whose axes are the principal axes of inertia.
Pose centreOfMassFrame(const Collider& collider);

/// A collision shape for a body with a signed distance field. Like all Bullet shapes, it may serve any number of
/// bodies.
///
/// Needs a bilayer::bullet::Dispatcher, or FieldAlgorithms with a dispatcher of Bullet's own. Without either, Bullet
/// collides the triangles of the mesh with convex bodies, and collides nothing with concave ones: the body passes
/// through other fields, planes, triangle meshes and height fields.
///
/// The class warns once (see setWarningCallback()) when the process has no Dispatcher and no FieldAlgorithms at all,
/// and a world moves a dynamic body with a field, or Bullet collides a field's triangles with a convex body. The limits
/// of this warning:
/// - It misses worlds without getDispatchInfo().m_useContinuous, and dynamic compounds, until they meet convex bodies.
/// - It misses all worlds of a process that has a Dispatcher for one of them.
class Shape : public btConcaveShape {
  public:
    /// Throws std::invalid_argument for no collider, a margin that is not finite, and a friction at rest
    /// below 1.
    explicit Shape(std::shared_ptr<const Collider> collider, const ShapeOptions& options = {});
    ~Shape() override;

    /// The field, surface points and mass that it collides with.
    const Collider& collider() const { return *collider_; }
    /// ShapeOptions::frame.
    const Pose& frame() const { return frame_; }
    /// The collider in the world for a body at this transform.
    Placed placed(const btTransform& bodyTransform) const;
    /// ShapeOptions::speculative.
    bool speculative() const { return speculative_; }
    /// ShapeOptions::restingFriction.
    float restingFriction() const { return restingFriction_; }
    /// The edge length of a voxel after scaling [m].
    float voxelSize() const { return scale() * collider_->field().voxelSize(); }

    /// Takes positive uniform scales only. Throws std::invalid_argument for others.
    void setLocalScaling(const btVector3& scaling) override;
    /// The scale along each axis; all three are the same.
    const btVector3& getLocalScaling() const override { return scaling_; }
    /// The uniform scale.
    float scale() const { return scaling_.x(); }

    /// ShapeOptions::margin, but after scaling [m].
    void setMargin(btScalar margin) override;
    /// The margin after scaling [m].
    btScalar getMargin() const override { return m_collisionMargin; }

    /// The bounding box of the body, with its margin [m].
    void getAabb(const btTransform& transform, btVector3& lower, btVector3& upper) const override;
    /// Computed from the mesh, about the body's origin. Throws std::invalid_argument for a mesh without volume.
    void calculateLocalInertia(btScalar mass, btVector3& inertia) const override;
    /// Calls back with the triangles that Bullet needs. Rays, swept spheres and other casts get the mesh's own answer;
    /// debug drawing and soft bodies get the triangles that meet the box.
    ///
    /// Without a mesh, the field answers rays from outside, and swept spheres narrower than the band width less sqrt(3)
    /// voxels. All other callers get the triangles of the field's zero set.
    void processAllTriangles(btTriangleCallback* callback, const btVector3& lower,
                             const btVector3& upper) const override;
    /// The threshold in voxels. Bullet's default is a fraction of the body's size, which merges contacts on fine
    /// features.
    btScalar getContactBreakingThreshold(btScalar defaultFactor) const override;
    /// "bilayer".
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
