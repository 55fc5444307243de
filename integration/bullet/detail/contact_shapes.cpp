// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/contact_shapes.h"

#include <BulletCollision/CollisionShapes/btBox2dShape.h>
#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConeShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btConvexPointCloudShape.h>
#include <BulletCollision/CollisionShapes/btConvexTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btMultiSphereShape.h>
#include <BulletCollision/CollisionShapes/btPolyhedralConvexShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>
#include <BulletCollision/CollisionShapes/btStridingMeshInterface.h>
#include <BulletCollision/CollisionShapes/btTriangleCallback.h>
#include <LinearMath/btConvexHullComputer.h>

#include <cmath>
#include <glm/gtc/constants.hpp>
#include <utility>
#include <vector>

#include <bilayer/integration/bullet/shape.h>
#include "collider/contact/shapes/shape_data.h"
#include "integration/bullet/detail/convert.h"
#include "sdf/base/access.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Support points on a shape without a closed form here: directions on a spiral, about 12 degrees apart.
constexpr int supportDirections = 256;
/// Support points in directions spread evenly over the sphere (R. Swinbank, R. J. Purser, "Fibonacci grids", 2006).
std::vector<btVector3> supportPoints(const btConvexShape& shape) {
    const float golden = glm::pi<float>() * (3 - std::sqrt(5.f));
    std::vector<btVector3> points;
    for (int i = 0; i < supportDirections; ++i) {
        const float z = 1 - (2 * i + 1.f) / supportDirections, rho = std::sqrt(1 - z * z), angle = golden * i;
        const btVector3 towards(rho * std::cos(angle), rho * std::sin(angle), z);
        points.push_back(shape.localGetSupportingVertexWithoutMargin(towards));
    }
    return points;
}

/// The vertices of such a shape. Bullet uses its support only: the shape reports that it has no vertices.
std::vector<btVector3> verticesOf(const btConvexTriangleMeshShape& shape) {
    struct Vertices : btInternalTriangleIndexCallback {
        std::vector<btVector3> points;
        void internalProcessTriangleIndex(btVector3* triangle, int, int) override {
            points.insert(points.end(), triangle, triangle + 3);
        }
    } vertices;
    const btVector3 all(BT_LARGE_FLOAT, BT_LARGE_FLOAT, BT_LARGE_FLOAT);
    shape.getMeshInterface()->InternalProcessAllTriangles(&vertices, -all, all);
    return vertices.points;
}

std::vector<btVector3> verticesOf(const btPolyhedralConvexShape& shape) {
    if (shape.getShapeType() == CONVEX_TRIANGLEMESH_SHAPE_PROXYTYPE)
        return verticesOf(static_cast<const btConvexTriangleMeshShape&>(shape));
    std::vector<btVector3> points(shape.getNumVertices());
    for (int i = 0; i < shape.getNumVertices(); ++i) shape.getVertex(i, points[i]);
    return points;
}

int vertexCountOf(const btConvexShape& shape) {
    return shape.isPolyhedral() ? static_cast<const btPolyhedralConvexShape&>(shape).getNumVertices() : 0;
}

std::array<btVector3, 2> boundsOf(const btConvexShape& shape) {
    std::array<btVector3, 2> bounds;
    shape.getAabb(btTransform::getIdentity(), bounds[0], bounds[1]);
    return bounds;
}

/// The convex hull of points, which may lie in a plane or on a line.
HullSurface hullOf(const std::vector<btVector3>& points) {
    btConvexHullComputer hull;
    hull.compute(&points.front().x(), sizeof(btVector3), static_cast<int>(points.size()), 0, 0);
    HullSurface surface;
    for (int i = 0; i < hull.vertices.size(); ++i) surface.points.push_back(toGlm(hull.vertices[i]));
    for (int i = 0; i < hull.faces.size(); ++i) {
        const auto* first = &hull.edges[hull.faces[i]];
        std::vector<std::uint32_t>& face = surface.faces.emplace_back();
        const auto* edge = first;
        do {
            face.push_back(static_cast<std::uint32_t>(edge->getSourceVertex()));
            edge = edge->getNextEdgeOfFace();
        } while (edge != first);
    }
    for (int i = 0; i < hull.edges.size(); ++i) {
        const auto from = static_cast<std::uint32_t>(hull.edges[i].getSourceVertex());
        const auto to = static_cast<std::uint32_t>(hull.edges[i].getTargetVertex());
        if (from < to) surface.edges.emplace_back(from, to);
    }
    return surface;
}

Convex hullOf(const btConvexShape& shape) {
    const auto points =
        shape.isPolyhedral() ? verticesOf(static_cast<const btPolyhedralConvexShape&>(shape)) : supportPoints(shape);
    return Convex::hull(hullOf(points), shape.getMargin());
}

Convex cylinderOf(const btCylinderShape& shape) {
    const int axis = shape.getUpAxis();
    const btVector3 half = shape.getHalfExtentsWithMargin();
    const float rim = half[axis == 0 ? 1 : 0];
    return Convex::revolution(axis, half[axis], rim, rim, 0);
}

Convex spheresOf(const btMultiSphereShape& shape) {
    const btVector3& scaling = shape.getLocalScaling();
    std::vector<SphereOfHull> spheres;
    for (int i = 0; i < shape.getSphereCount(); ++i)
        spheres.push_back({toGlm(scaling * shape.getSpherePosition(i)), scaling.x() * shape.getSphereRadius(i)});
    return Convex::spheres(std::move(spheres));
}

/// Numbers the triangles by part and index. The two triangles of a height field's cell arrive in succession with the
/// same numbers.
class Passing : public btTriangleCallback {
  public:
    explicit Passing(const OpenSurface::Visitor& visitor) : visitor_(visitor) {}

    void processTriangle(btVector3* corners, int part, int index) override {
        const bool isSecond = part == lastPart_ && index == lastIndex_;
        lastPart_ = isSecond ? -1 : part;
        lastIndex_ = index;
        const auto number = (std::uint64_t(std::uint32_t(part)) << 32 | std::uint32_t(index)) << 1;
        visitor_({toGlm(corners[0]), toGlm(corners[1]), toGlm(corners[2])}, number | std::uint64_t(isSecond));
    }

  private:
    const OpenSurface::Visitor& visitor_;
    int lastPart_ = -1, lastIndex_ = -1;
};

}  // namespace

Convex convexOf(const btConvexShape& shape) {
    switch (shape.getShapeType()) {
        case SPHERE_SHAPE_PROXYTYPE:
            return Convex::segment(1, 0, static_cast<const btSphereShape&>(shape).getRadius());
        case CAPSULE_SHAPE_PROXYTYPE: {
            const auto& capsule = static_cast<const btCapsuleShape&>(shape);
            return Convex::segment(capsule.getUpAxis(), capsule.getHalfHeight(), capsule.getRadius());
        }
        case BOX_SHAPE_PROXYTYPE:
            return Convex::box(toGlm(static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin()));
        case BOX_2D_SHAPE_PROXYTYPE:
            return Convex::box(toGlm(static_cast<const btBox2dShape&>(shape).getHalfExtentsWithMargin()));
        case CYLINDER_SHAPE_PROXYTYPE:
            return cylinderOf(static_cast<const btCylinderShape&>(shape));
        case CONE_SHAPE_PROXYTYPE: {
            const auto& cone = static_cast<const btConeShape&>(shape);
            return Convex::revolution(cone.getConeUpIndex(), 0.5f * cone.getHeight(), cone.getRadius(), 0,
                                      shape.getMargin());
        }
        case MULTI_SPHERE_SHAPE_PROXYTYPE: {
            // With different scale factors it is no hull of spheres, but is defined by its support function.
            const btVector3& scaling = shape.getLocalScaling();
            if (scaling.x() != scaling.y() || scaling.x() != scaling.z()) return hullOf(shape);
            return spheresOf(static_cast<const btMultiSphereShape&>(shape));
        }
        default:
            return hullOf(shape);
    }
}

OpenSurface openSurfaceOf(const btConcaveShape& shape) {
    return {[&shape](const Bounds& box, const OpenSurface::Visitor& visitor) {
        Passing passing(visitor);
        shape.processAllTriangles(&passing, toBullet(box.lower), toBullet(box.upper));
    }};
}

ContactShape contactShapeOf(const btCollisionShape& shape) {
    const int type = shape.getShapeType();
    if (type == FAST_CONCAVE_MESH_PROXYTYPE) return ContactShape(static_cast<const Shape&>(shape).collider());
    if (shape.isConvex())
        return makeOf<ContactShape>(ContactShapeData{convexOf(static_cast<const btConvexShape&>(shape))});
    if (type == STATIC_PLANE_PROXYTYPE) {
        const auto& plane = static_cast<const btStaticPlaneShape&>(shape);
        return makeOf<ContactShape>(
            ContactShapeData{HalfSpace{toGlm(plane.getPlaneNormal()), plane.getPlaneConstant()}});
    }
    return ContactShape::triangles(openSurfaceOf(static_cast<const btConcaveShape&>(shape)));
}

ConvexShape::ConvexShape(const btConvexShape& shape)
    : shape_(&shape),
      scaling_(shape.getLocalScaling()),
      margin_(shape.getMargin()),
      vertexCount_(vertexCountOf(shape)),
      bounds_(boundsOf(shape)),
      contactShape_(makeOf<ContactShape>(ContactShapeData{convexOf(shape)})) {}

bool ConvexShape::represents(const btConvexShape& shape) const {
    return shape_ == &shape && scaling_ == shape.getLocalScaling() && margin_ == shape.getMargin() &&
           vertexCount_ == vertexCountOf(shape) && bounds_ == boundsOf(shape);
}

}  // namespace bilayer::bullet::detail
