// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/triangle_ids.h"

#include <BulletCollision/CollisionShapes/btTriangleCallback.h>
#include <LinearMath/btAabbUtil2.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "collider/contact/shapes/nearest_on_triangle.h"
#include "integration/bullet/detail/convert.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

/// The search for the triangle of one point, in the mesh's coordinates.
class Search {
  public:
    Search(const glm::vec3& place, const glm::vec3& normal, float reach, float tolerance)
        : place_(place), normal_(normal), minDistance_(reach), tolerance_(tolerance) {}

    void offer(const btVector3* corners, TriangleId id) {
        const float reach = minDistance_ + tolerance_;
        const btVector3 place = toBullet(place_), by(reach, reach, reach);
        if (!TestTriangleAgainstAabb2(corners, place - by, place + by)) return;
        const glm::vec3 a = toGlm(corners[0]), b = toGlm(corners[1]), c = toGlm(corners[2]);
        const float distance = glm::distance(place_, nearestOnTriangle(place_, a, b, c));
        if (!(distance <= reach)) return;
        const glm::vec3 across = glm::cross(b - a, c - a);
        const float length = glm::length(across);
        const float cosine = length > 0 ? std::abs(glm::dot(across, normal_)) / length : 0;
        const bool isNearer = distance < distance_ - tolerance_;
        minDistance_ = std::min(minDistance_, distance);
        if (found_ && !isNearer && cosine <= found_->cosine) return;
        found_ = {id, cosine};
        distance_ = distance;
    }
    std::optional<NearTriangle> found() const { return found_; }

  private:
    glm::vec3 place_, normal_;
    float minDistance_, tolerance_;
    std::optional<NearTriangle> found_;
    float distance_ = 0;  ///< of the result
};

struct Searches : btTriangleCallback {
    std::vector<Search> all;

    void processTriangle(btVector3* corners, int part, int index) override {
        for (Search& search : all) search.offer(corners, {part, index});
    }
};

}  // namespace

std::vector<std::optional<NearTriangle>> trianglesAt(const btConcaveShape& mesh, const btTransform& transform,
                                                     std::span<const MeshPlace> places, float reach, float tolerance) {
    if (places.empty()) return {};
    Searches searches;
    const btTransform inMesh = transform.inverse();
    btVector3 lower = inMesh * places.front().position, upper = lower;
    for (const MeshPlace& place : places) {
        const btVector3 position = inMesh * place.position;
        lower.setMin(position);
        upper.setMax(position);
        searches.all.emplace_back(toGlm(position), toGlm(inMesh.getBasis() * place.normal), reach, tolerance);
    }
    const btVector3 by(reach, reach, reach);
    mesh.processAllTriangles(&searches, lower - by, upper + by);
    std::vector<std::optional<NearTriangle>> near;
    for (const Search& search : searches.all) near.push_back(search.found());
    return near;
}

}  // namespace bilayer::bullet::detail
