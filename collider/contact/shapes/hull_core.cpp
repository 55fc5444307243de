// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/shapes/hull_core.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "collider/contact/shapes/nearest_on_triangle.h"

namespace bilayer::detail {

HullCore::HullCore(const HullSurface& surface, float growth) {
    vertices_ = surface.points;
    tolerance_ = tolerance(growth);
    addFaces(surface);
    addEdges(surface);
    listFacesAround();
    isPlanar_ = !faces_.empty() && std::all_of(vertices_.begin(), vertices_.end(), [&](const glm::vec3& point) {
        return std::abs(faces_.front().height(point)) <= tolerance_;
    });
}

void HullCore::addFaces(const HullSurface& surface) {
    for (const std::vector<std::uint32_t>& polygon : surface.faces) {
        const glm::vec3 apex = vertices_[polygon[0]];
        glm::vec3 area(0);
        const std::size_t begin = triangles_.size();
        for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
            const glm::uvec3 triangle(polygon[0], polygon[i], polygon[i + 1]);
            area += glm::cross(vertices_[triangle.y] - apex, vertices_[triangle.z] - apex);
            triangles_.push_back(triangle);
        }
        const float length = glm::length(area);
        if (!(length > 0)) continue;
        const glm::vec3 normal = area / length;
        faces_.push_back({normal, glm::dot(normal, apex), begin, triangles_.size()});
    }
}

void HullCore::addEdges(const HullSurface& surface) {
    // the conormal of the face on the left of an edge
    std::map<std::pair<std::uint32_t, std::uint32_t>, glm::vec3> conormals;
    for (const Face& face : faces_)
        for (std::size_t i = face.begin; i < face.end; ++i)
            for (int k = 0; k < 3; ++k) {
                const std::uint32_t from = triangles_[i][k], to = triangles_[i][(k + 1) % 3];
                const glm::vec3 across = glm::cross(face.normal, vertices_[to] - vertices_[from]);
                conormals[{from, to}] = glm::normalize(across);
            }
    for (const auto& [from, to] : surface.edges) {
        edges_.push_back({from, to, 0});
        const auto left = conormals.find({from, to}), right = conormals.find({to, from});
        if (left != conormals.end() && right != conormals.end())
            edges_.back().conormals = Conormals{left->second, right->second};
    }
}

void HullCore::listFacesAround() {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> around;  // vertex, face
    for (std::uint32_t f = 0; f < faces_.size(); ++f)
        for (std::size_t i = faces_[f].begin; i < faces_[f].end; ++i)
            for (int k = 0; k < 3; ++k) around.emplace_back(triangles_[i][k], f);
    std::sort(around.begin(), around.end());
    around.erase(std::unique(around.begin(), around.end()), around.end());
    firstAround_.assign(vertices_.size() + 1, 0);
    for (const auto& [corner, face] : around) {
        ++firstAround_[corner + 1];
        facesAround_.push_back(face);
    }
    std::partial_sum(firstAround_.begin(), firstAround_.end(), firstAround_.begin());
}

HullCore::Above HullCore::highest(const glm::vec3& point) const {
    Above best{nullptr, -std::numeric_limits<float>::max()};
    for (const Face& face : faces_)
        if (const float height = face.height(point); height > best.height) best = {&face, height};
    return best;
}

// The nearest of the faces, edges or vertices that are considered.
class HullCore::Search {
  public:
    Search(const HullCore& hull, const glm::vec3& point) : hull_(hull), point_(point) {}

    const glm::vec3& core() const { return core_; }
    float distance() const { return std::sqrt(squared_); }

    void considerAllFaces() {
        for (const Face& face : hull_.faces_) consider(face);
    }

    // Only faces that the point is above can be nearest. A face nearer than all its neighbours is the nearest one,
    // since the distance to a convex body has no other minimum.
    void descendFrom(const Above& highest) {
        consider(*highest.face);
        for (const Face* before = nullptr; face_ != before && squared_ > highest.height * highest.height;) {
            before = face_;
            const glm::uvec3 corners = hull_.triangles_[triangle_];
            for (int i = 0; i < 3; ++i)
                for (std::uint32_t k = hull_.firstAround_[corners[i]]; k < hull_.firstAround_[corners[i] + 1]; ++k)
                    if (const Face& next = hull_.faces_[hull_.facesAround_[k]];
                        &next != before && next.height(point_) > 0)
                        consider(next);
        }
    }

    // A hull without faces is a line or a point.
    void considerEdges() {
        const auto& vertices = hull_.vertices_;
        for (const ConvexEdge& edge : hull_.edges_)
            consider(nearestOnTriangle(point_, vertices[edge.from], vertices[edge.to], vertices[edge.to]));
        for (const glm::vec3& vertex : vertices) consider(vertex);
    }

  private:
    bool consider(const glm::vec3& q) {
        const glm::vec3 offset = point_ - q;
        const float squared = glm::dot(offset, offset);
        if (!(squared < squared_)) return false;
        squared_ = squared, core_ = q;
        return true;
    }

    void consider(const Face& face) {
        for (std::size_t i = face.begin; i < face.end; ++i) {
            const glm::uvec3& t = hull_.triangles_[i];
            const auto& vertices = hull_.vertices_;
            if (consider(nearestOnTriangle(point_, vertices[t.x], vertices[t.y], vertices[t.z])))
                face_ = &face, triangle_ = i;
        }
    }

    const HullCore& hull_;
    const glm::vec3& point_;
    float squared_ = std::numeric_limits<float>::max();
    glm::vec3 core_{0};
    const Face* face_ = nullptr;
    std::size_t triangle_ = 0;
};

NearestPoint HullCore::nearest(const glm::vec3& point, float reach) const {
    const Above above = highest(point);
    const auto onFace = [&](float distance, const glm::vec3& core) {
        return NearestPoint{distance, above.face->normal, core, 0};
    };
    // Inside, the nearest face decides; far outside, the bound is enough.
    const bool isInside = above.height <= 0 && !isPlanar_;
    if (above.face && (isInside || above.height > reach))
        return onFace(above.height, point - above.height * above.face->normal);

    Search search(*this, point);
    if (isPlanar_)
        search.considerAllFaces();
    else if (above.face)
        search.descendFrom(above);
    else
        search.considerEdges();
    const glm::vec3 core = search.core(), offset = point - core;
    const float distance = search.distance();
    // Points that almost coincide give a normal of rounding only.
    if (above.face && (!(distance > 0) || glm::distance(offset, above.height * above.face->normal) <= tolerance_))
        return onFace(distance, core);
    return {distance, distance > 0 ? offset / distance : unitAcross(1), core, 0};
}

// On an edge or a vertex of a hull that is grown by a radius: its normal is no face's.
bool HullCore::isRound(const NearestPoint& nearest) const {
    return nearest.radius > 0 && std::none_of(faces_.begin(), faces_.end(), [&](const Face& face) {
               return glm::dot(face.normal, nearest.normal) > sameFaceCosine;
           });
}

}  // namespace bilayer::detail
