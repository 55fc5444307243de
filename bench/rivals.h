// SPDX-License-Identifier: Apache-2.0
// Collision shapes that meshes may have in Bullet: our fields, and the alternatives of Bullet's users.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionConfiguration.h>
#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionShapes/btCollisionShape.h>

#include <memory>
#include <string>

#include <bilayer/collider/contact.h>
#include <bilayer/sdf/mesh.h>
#include "collider/contact/body/body.h"
#include "collider/contact/search/sampled_points.h"

namespace bilayer::bench {

/// A collision shape of a mesh, and the dispatcher that supports it.
class Rival {
  public:
    virtual ~Rival() = default;
    virtual std::string name() const = 0;
    virtual btCollisionShape& shape() = 0;
    /// Creates a dispatcher. The configuration must outlive it.
    virtual std::unique_ptr<btCollisionDispatcher> dispatcher(btCollisionConfiguration& configuration) const;

    double seconds = 0;  ///< time to create the shape
};

/// Our field.
/// @param voxels   along the longest side
/// @param sampler  samples the contact points; none: the CPU samples them as usual
std::unique_ptr<Rival> makeField(const Mesh& mesh, float voxels, const PointSampler& sampler = {},
                                 ContactAccuracy accuracy = ContactAccuracy::exactNearFeatures);

/// btGImpactMeshShape.
/// @param margin  added to the surface [m]
std::unique_ptr<Rival> makeGImpact(const Mesh& mesh, float margin);

/// A compound of convex hulls, by the approximate convex decomposition that Debian packages with Bullet: HACD (K.
/// Mamou, F. Ghorbel, "A simple and efficient approach for 3D mesh approximate convex decomposition", ICIP 2009). Its
/// time grows with the square of the triangle count.
/// @param margin  added to the hulls [m]
std::unique_ptr<Rival> makeHulls(const Mesh& mesh, int hulls, float margin);

/// btBvhTriangleMeshShape, for static bodies.
std::unique_ptr<Rival> makeTriangles(const Mesh& mesh, float margin);

/// btSdfCollisionShape, for static bodies. It collides only with spheres, boxes and hulls, by their vertices. Its nodes
/// hold exact distances.
/// @param cells  of 32 nodes each, along the longest side
std::unique_ptr<Rival> makeBulletSdf(const Mesh& mesh, int cells);

}  // namespace bilayer::bench
