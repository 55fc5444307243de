// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/convex.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>
#include <map>
#include <numeric>

namespace bilayer::detail {

namespace {

// Chords of a rim. Each lies within 0.5 % of the radius from its arc, before its points are projected onto the arc.
constexpr std::uint32_t rimChords = 32;

}  // namespace

Convex Convex::segment(int axis, float halfHeight, float radius) {
    Convex convex(Core::segment, radius);
    convex.axis_ = axis;
    convex.halfHeight_ = halfHeight;
    convex.mesh_.points = {-halfHeight * direction(axis)};
    if (halfHeight > 0) {
        convex.mesh_.points.push_back(halfHeight * direction(axis));
        convex.edges_ = {{0, 1, 0}};
    }
    convex.measure();
    return convex;
}

Convex Convex::box(const glm::vec3& halfExtents) {
    Convex convex(Core::box, 0);
    convex.halfExtents_ = halfExtents;
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
        const glm::vec3 side(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
        convex.mesh_.points.push_back(side * halfExtents);
        for (int axis = 0; axis < 3; ++axis) {
            const int next = (axis + 1) % 3, last = (axis + 2) % 3;
            const Conormals conormals{-side[next] * direction(next), -side[last] * direction(last)};
            if (side[axis] < 0) convex.edges_.push_back({corner, corner | 1u << axis, 0, conormals});
        }
    }
    convex.measure();
    return convex;
}

Convex Convex::revolution(int axis, float halfHeight, float lowerRadius, float upperRadius, float radius) {
    Convex convex(Core::revolution, radius);
    convex.axis_ = axis;
    convex.halfHeight_ = halfHeight;
    convex.lowerRadius_ = lowerRadius;
    convex.upperRadius_ = upperRadius;
    convex.addRim(-halfHeight, lowerRadius);
    convex.addRim(halfHeight, upperRadius);
    convex.measure();
    return convex;
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

Convex Convex::hull(const HullSurface& surface, float radius) {
    Convex convex(Core::hull, radius);
    convex.mesh_.points = surface.points;
    convex.measure();
    convex.addFaces(surface);
    convex.addHullEdges(surface);
    convex.listFacesAround();
    const auto& faces = convex.faces_;
    convex.isFlat_ =
        !faces.empty() && std::all_of(surface.points.begin(), surface.points.end(), [&](const auto& point) {
            return std::abs(faces.front().height(point)) <= flatness * convex.size_;
        });
    return convex;
}

void Convex::addFaces(const HullSurface& surface) {
    for (const std::vector<std::uint32_t>& polygon : surface.faces) {
        const glm::vec3 apex = mesh_.points[polygon[0]];
        glm::vec3 area(0);
        const std::size_t begin = mesh_.triangles.size();
        for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
            const glm::uvec3 triangle(polygon[0], polygon[i], polygon[i + 1]);
            area += glm::cross(mesh_.points[triangle.y] - apex, mesh_.points[triangle.z] - apex);
            mesh_.triangles.push_back(triangle);
        }
        const float length = glm::length(area);
        if (!(length > 0)) continue;
        const glm::vec3 normal = area / length;
        faces_.push_back({normal, glm::dot(normal, apex), begin, mesh_.triangles.size()});
    }
}

void Convex::addHullEdges(const HullSurface& surface) {
    // the conormal of the face on the left of an edge
    std::map<std::pair<std::uint32_t, std::uint32_t>, glm::vec3> conormals;
    for (const HullFace& face : faces_)
        for (std::size_t i = face.begin; i < face.end; ++i)
            for (int k = 0; k < 3; ++k) {
                const std::uint32_t from = mesh_.triangles[i][k], to = mesh_.triangles[i][(k + 1) % 3];
                const glm::vec3 across = glm::cross(face.normal, mesh_.points[to] - mesh_.points[from]);
                conormals[{from, to}] = glm::normalize(across);
            }
    for (const auto& [from, to] : surface.edges) {
        edges_.push_back({from, to, 0});
        const auto left = conormals.find({from, to}), right = conormals.find({to, from});
        if (left != conormals.end() && right != conormals.end())
            edges_.back().conormals = Conormals{left->second, right->second};
    }
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

Convex Convex::spheres(std::vector<SphereOfHull> spheres) {
    Convex convex(Core::spheres, 0);
    convex.sphereHull_ = MultisphereHull(std::move(spheres));
    for (const SphereOfHull& sphere : convex.sphereHull_.spheres()) {
        convex.mesh_.points.push_back(sphere.centre);
        convex.radii_.push_back(sphere.radius);
        convex.radius_ = std::max(convex.radius_, sphere.radius);
    }
    for (const auto& [from, to] : convex.sphereHull_.pairs()) convex.edges_.push_back({from, to, 0});
    convex.measure();
    return convex;
}

void Convex::measure() {
    Bounds box;
    for (std::uint32_t i = 0; i < mesh_.points.size(); ++i) {
        box.add(mesh_.points[i] - radius(i));
        box.add(mesh_.points[i] + radius(i));
    }
    size_ = glm::length(box.size());
}

glm::vec3 Convex::support(const glm::vec3& direction) const {
    const float length = glm::length(direction);
    if (core_ == Core::revolution) {
        glm::vec3 out = direction;
        out[axis_] = 0;
        if (const float across = glm::length(out); across > 0) out /= across;
        const glm::vec3 up = halfHeight_ * Convex::direction(axis_);
        const glm::vec3 lower = lowerRadius_ * out - up, upper = upperRadius_ * out + up;
        return glm::dot(direction, upper - lower) > 0 ? upper : lower;
    }
    std::uint32_t farthest = 0;
    float height = std::numeric_limits<float>::lowest();
    for (std::uint32_t i = 0; i < mesh_.points.size(); ++i)
        if (const float h = glm::dot(direction, mesh_.points[i]) + length * radius(i); h > height)
            height = h, farthest = i;
    const glm::vec3& point = mesh_.points[farthest];
    return radii_.empty() || !(length > 0) ? point : point + radii_[farthest] / length * direction;
}

}  // namespace bilayer::detail
