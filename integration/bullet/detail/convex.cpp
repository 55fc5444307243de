// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/convex.h"

#include <BulletCollision/CollisionShapes/btBox2dShape.h>
#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConeShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btConvexPointCloudShape.h>
#include <BulletCollision/CollisionShapes/btConvexTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btPolyhedralConvexShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletCollision/CollisionShapes/btStridingMeshInterface.h>
#include <LinearMath/btConvexHullComputer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/vec2.hpp>
#include <map>
#include <numeric>
#include <utility>

#include "integration/bullet/detail/convert.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Chords of a rim. Each lies within 0.5 % of the radius from its arc, before its points are projected onto the arc.
constexpr std::uint32_t rimChords = 32;
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

}  // namespace

Convex::Convex(const btConvexShape& shape)
    : shape_(&shape),
      scaling_(shape.getLocalScaling()),
      margin_(shape.getMargin()),
      vertexCount_(vertexCountOf(shape)),
      bounds_(boundsOf(shape)) {
    switch (shape.getShapeType()) {
        case SPHERE_SHAPE_PROXYTYPE:
            core_ = Core::segment;
            radius_ = static_cast<const btSphereShape&>(shape).getRadius();
            mesh_.points = {glm::vec3(0)};
            break;
        case CAPSULE_SHAPE_PROXYTYPE: {
            const auto& capsule = static_cast<const btCapsuleShape&>(shape);
            core_ = Core::segment;
            radius_ = capsule.getRadius();
            axis_ = capsule.getUpAxis();
            halfHeight_ = capsule.getHalfHeight();
            mesh_.points = {-halfHeight_ * direction(axis_), halfHeight_ * direction(axis_)};
            edges_ = {{0, 1, 0}};
            break;
        }
        case BOX_SHAPE_PROXYTYPE:
            makeBox(toGlm(static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin()));
            break;
        case BOX_2D_SHAPE_PROXYTYPE:
            makeBox(toGlm(static_cast<const btBox2dShape&>(shape).getHalfExtentsWithMargin()));
            break;
        case CYLINDER_SHAPE_PROXYTYPE: {
            const auto& cylinder = static_cast<const btCylinderShape&>(shape);
            const int axis = cylinder.getUpAxis();
            const btVector3 half = cylinder.getHalfExtentsWithMargin();
            const float rim = half[axis == 0 ? 1 : 0];
            makeRevolution(axis, half[axis], rim, rim);
            break;
        }
        case CONE_SHAPE_PROXYTYPE: {
            const auto& cone = static_cast<const btConeShape&>(shape);
            radius_ = margin_;
            makeRevolution(cone.getConeUpIndex(), 0.5f * cone.getHeight(), cone.getRadius(), 0);
            break;
        }
        case MULTI_SPHERE_SHAPE_PROXYTYPE:
            // With different scale factors it is no hull of spheres, but is defined by its support function.
            if (scaling_.x() == scaling_.y() && scaling_.x() == scaling_.z()) {
                makeSpheres(static_cast<const btMultiSphereShape&>(shape));
                break;
            }
            [[fallthrough]];
        default:
            radius_ = margin_;
            makeHull(shape.isPolyhedral() ? verticesOf(static_cast<const btPolyhedralConvexShape&>(shape))
                                          : supportPoints(shape));
    }
}

bool Convex::represents(const btConvexShape& shape) const {
    return shape_ == &shape && scaling_ == shape.getLocalScaling() && margin_ == shape.getMargin() &&
           vertexCount_ == vertexCountOf(shape) && bounds_ == boundsOf(shape);
}

void Convex::makeBox(const glm::vec3& halfExtents) {
    core_ = Core::box;
    halfExtents_ = halfExtents;
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
        const glm::vec3 side(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
        mesh_.points.push_back(side * halfExtents);
        for (int axis = 0; axis < 3; ++axis) {
            const int next = (axis + 1) % 3, last = (axis + 2) % 3;
            const Conormals conormals{-side[next] * direction(next), -side[last] * direction(last)};
            if (side[axis] < 0) edges_.push_back({corner, corner | 1u << axis, 0, conormals});
        }
    }
}

void Convex::makeRevolution(int axis, float halfHeight, float lowerRadius, float upperRadius) {
    core_ = Core::revolution;
    axis_ = axis;
    halfHeight_ = halfHeight;
    lowerRadius_ = lowerRadius;
    upperRadius_ = upperRadius;
    addRim(-halfHeight, lowerRadius);
    addRim(halfHeight, upperRadius);
}

void Convex::addRim(float height, float rim) {
    const auto first = static_cast<std::uint32_t>(mesh_.points.size());
    if (!(rim > 0)) {
        mesh_.points.push_back(height * direction(axis_));
        return;
    }
    for (std::uint32_t i = 0; i < rimChords; ++i) {
        const float angle = 2 * glm::pi<float>() * i / rimChords;
        glm::vec3 point = height * direction(axis_);
        point[(axis_ + 1) % 3] = rim * std::cos(angle);
        point[(axis_ + 2) % 3] = rim * std::sin(angle);
        mesh_.points.push_back(point);
        edges_.push_back({first + i, first + (i + 1) % rimChords, rim});
    }
}

void Convex::makeHull(const std::vector<btVector3>& points) {
    core_ = Core::hull;
    btConvexHullComputer hull;
    hull.compute(&points.front().x(), sizeof(btVector3), static_cast<int>(points.size()), 0, 0);
    for (int i = 0; i < hull.vertices.size(); ++i) mesh_.points.push_back(toGlm(hull.vertices[i]));
    // conormal of the face on the left of an edge
    std::map<std::pair<std::uint32_t, std::uint32_t>, glm::vec3> conormals;
    for (int i = 0; i < hull.faces.size(); ++i) {
        const auto* first = &hull.edges[hull.faces[i]];
        const auto apex = static_cast<std::uint32_t>(first->getSourceVertex());
        glm::vec3 area(0);
        const std::size_t begin = mesh_.triangles.size();
        for (const auto* edge = first->getNextEdgeOfFace(); edge != first; edge = edge->getNextEdgeOfFace()) {
            const glm::uvec3 triangle(apex, edge->getSourceVertex(), edge->getTargetVertex());
            if (triangle.z == apex) continue;
            const glm::vec3 a = mesh_.points[triangle.x];
            area += glm::cross(mesh_.points[triangle.y] - a, mesh_.points[triangle.z] - a);
            mesh_.triangles.push_back(triangle);
        }
        const float length = glm::length(area);
        if (!(length > 0)) continue;
        const glm::vec3 normal = area / length;
        faces_.push_back({normal, glm::dot(normal, mesh_.points[apex]), begin, mesh_.triangles.size()});
        const auto* edge = first;
        do {
            const auto from = static_cast<std::uint32_t>(edge->getSourceVertex());
            const auto to = static_cast<std::uint32_t>(edge->getTargetVertex());
            conormals[{from, to}] = glm::normalize(glm::cross(normal, mesh_.points[to] - mesh_.points[from]));
            edge = edge->getNextEdgeOfFace();
        } while (edge != first);
    }
    for (int i = 0; i < hull.edges.size(); ++i) {
        const auto from = static_cast<std::uint32_t>(hull.edges[i].getSourceVertex());
        const auto to = static_cast<std::uint32_t>(hull.edges[i].getTargetVertex());
        if (from > to) continue;
        edges_.push_back({from, to, 0});
        const auto left = conormals.find({from, to}), right = conormals.find({to, from});
        if (left != conormals.end() && right != conormals.end())
            edges_.back().conormals = Conormals{left->second, right->second};
    }
    listFacesAround();
    isFlat_ = !faces_.empty() && std::all_of(mesh_.points.begin(), mesh_.points.end(), [&](const glm::vec3& point) {
        return std::abs(faces_.front().height(point)) <= flatness * size();
    });
}

void Convex::listFacesAround() {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> around;  // vertex, plane
    for (std::uint32_t p = 0; p < faces_.size(); ++p)
        for (std::size_t i = faces_[p].begin; i < faces_[p].end; ++i)
            for (int k = 0; k < 3; ++k) around.emplace_back(mesh_.triangles[i][k], p);
    std::sort(around.begin(), around.end());
    around.erase(std::unique(around.begin(), around.end()), around.end());
    firstAround_.assign(mesh_.points.size() + 1, 0);
    for (const auto& [corner, plane] : around) {
        ++firstAround_[corner + 1];
        facesAround_.push_back(plane);
    }
    std::partial_sum(firstAround_.begin(), firstAround_.end(), firstAround_.begin());
}

void Convex::makeSpheres(const btMultiSphereShape& shape) {
    core_ = Core::spheres;
    std::vector<MultisphereHull::Sphere> spheres;
    for (int i = 0; i < shape.getSphereCount(); ++i)
        spheres.push_back({toGlm(scaling_ * shape.getSpherePosition(i)), scaling_.x() * shape.getSphereRadius(i)});
    sphereHull_ = MultisphereHull(std::move(spheres));
    for (const MultisphereHull::Sphere& sphere : sphereHull_.spheres()) {
        mesh_.points.push_back(sphere.centre);
        radii_.push_back(sphere.radius);
        radius_ = std::max(radius_, sphere.radius);
    }
    for (const auto& [from, to] : sphereHull_.pairs()) edges_.push_back({from, to, 0});
}

}  // namespace bilayer::bullet::detail
