// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/exact_distance.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <map>
#include <stdexcept>

namespace bilayer::demo {
namespace {

constexpr std::uint32_t leafTriangles = 4;  // fewer test more boxes, more test more triangles; the optimum is flat
constexpr std::uint32_t leafPoints = 8;     // min points per ball: one distance at the centre may exclude them all

enum Feature { face = 0, edge = 1, corner = 4 };  // the first index of each kind in Triangle::normals

struct Closest {
    glm::dvec3 point;
    int feature;  // index in Triangle::normals
};

// Returns the closest point on a segment, as that of the triangle with this segment as edge `index`.
Closest closestOnEdge(const std::array<glm::dvec3, 3>& corners, int index, const glm::dvec3& point) {
    const glm::dvec3 &a = corners[std::size_t(index)], &b = corners[std::size_t((index + 1) % 3)];
    const double t = glm::dot(point - a, b - a) / glm::dot(b - a, b - a);
    if (t <= 0) return {a, corner + index};
    if (t >= 1) return {b, corner + (index + 1) % 3};
    return {a + t * (b - a), edge + index};
}

Closest closestOnTriangle(const std::array<glm::dvec3, 3>& corners, const glm::dvec3& normal, const glm::dvec3& point) {
    // above the face: on the inner side of all three edges
    bool inside = true;
    for (std::size_t i = 0; i < 3; ++i)
        inside = inside && glm::dot(glm::cross(normal, corners[(i + 1) % 3] - corners[i]), point - corners[i]) >= 0;
    if (inside) return {point - normal * (glm::dot(normal, point - corners[0]) / glm::dot(normal, normal)), face};

    Closest best = closestOnEdge(corners, 0, point);
    for (int i = 1; i < 3; ++i) {
        const Closest other = closestOnEdge(corners, i, point);
        if (glm::distance(other.point, point) < glm::distance(best.point, point)) best = other;
    }
    return best;
}

double squaredDistanceToBox(const glm::dvec3& lower, const glm::dvec3& upper, const glm::dvec3& point) {
    const glm::dvec3 gap = glm::max(glm::max(lower - point, point - upper), glm::dvec3(0));
    return glm::dot(gap, gap);
}

std::array<glm::dvec3, 3> cornersOf(const Mesh& mesh, const glm::uvec3& triangle) {
    return {glm::dvec3(mesh.points[triangle.x]), glm::dvec3(mesh.points[triangle.y]),
            glm::dvec3(mesh.points[triangle.z])};
}

double angleAt(const glm::dvec3& apex, const glm::dvec3& a, const glm::dvec3& b) {
    return std::atan2(glm::length(glm::cross(a - apex, b - apex)), glm::dot(a - apex, b - apex));
}

// A rigid transform in double precision. Single precision would blur penetrations of a few micrometres.
struct Motion {
    glm::dquat rotation;
    glm::dvec3 position;

    explicit Motion(const Pose& pose) : rotation(glm::normalize(glm::dquat(pose.rotation))), position(pose.position) {}
    glm::dvec3 toWorld(const glm::dvec3& point) const { return rotation * point + position; }
    glm::dvec3 toBody(const glm::dvec3& point) const { return glm::conjugate(rotation) * (point - position); }
};

// Divides a range into halves by the median along the longest axis of the box.
template <class Iterator, class Position>
void halve(Iterator begin, Iterator middle, Iterator end, const glm::dvec3& size, Position position) {
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    std::nth_element(begin, middle, end,
                     [&](const auto& x, const auto& y) { return position(x)[axis] < position(y)[axis]; });
}

}  // namespace

struct ExactDistance::Nearest {
    double squaredDistance = std::numeric_limits<double>::infinity();
    const Triangle* triangle = nullptr;
    Closest closest{};
};

ExactDistance::ExactDistance(const Mesh& mesh) {
    validate(mesh);
    addTriangles(weld(mesh));
    if (triangles_.empty()) throw std::invalid_argument("the mesh has no triangle with an area");
    nodes_.reserve(2 * triangles_.size());
    addNode(0, std::uint32_t(triangles_.size()));
}

void ExactDistance::addTriangles(const Mesh& mesh) {
    std::vector<glm::dvec3> cornerNormals(mesh.points.size(), glm::dvec3(0));
    std::map<std::pair<unsigned, unsigned>, glm::dvec3> edgeNormals;
    const auto edgeOf = [](const glm::uvec3& t, int i) { return std::minmax(t[i], t[(i + 1) % 3]); };
    const auto unitNormal = [&](const glm::uvec3& t) {
        const auto [a, b, c] = cornersOf(mesh, t);
        const glm::dvec3 normal = glm::cross(b - a, c - a);
        return glm::length(normal) > 0 ? glm::normalize(normal) : glm::dvec3(0);
    };

    for (const auto& t : mesh.triangles) {
        const auto corners = cornersOf(mesh, t);
        const glm::dvec3 normal = unitNormal(t);
        for (int i = 0; i < 3; ++i) {
            const auto at = [&](int k) { return corners[std::size_t((i + k) % 3)]; };
            cornerNormals[t[i]] += angleAt(at(0), at(1), at(2)) * normal;
            edgeNormals.try_emplace(edgeOf(t, i), 0.0).first->second += normal;
        }
    }
    for (const auto& t : mesh.triangles) {
        const glm::dvec3 normal = unitNormal(t);
        if (normal == glm::dvec3(0)) continue;  // its edges also belong to its neighbours
        triangles_.push_back(
            {cornersOf(mesh, t),
             {normal, edgeNormals.at(edgeOf(t, 0)), edgeNormals.at(edgeOf(t, 1)), edgeNormals.at(edgeOf(t, 2)),
              cornerNormals[t.x], cornerNormals[t.y], cornerNormals[t.z]}});
    }
}

void ExactDistance::addNode(std::uint32_t begin, std::uint32_t end) {
    const std::size_t index = nodes_.size();
    Node node{glm::dvec3(std::numeric_limits<double>::max()), glm::dvec3(std::numeric_limits<double>::lowest()), begin,
              end, 0};
    for (std::uint32_t i = begin; i < end; ++i)
        for (const auto& point : triangles_[i].corners) {
            node.lower = glm::min(node.lower, point);
            node.upper = glm::max(node.upper, point);
        }
    nodes_.push_back(node);
    if (end - begin <= leafTriangles) return;

    // median splits along the longest axis keep the tree balanced for any mesh
    const std::uint32_t middle = begin + (end - begin) / 2;
    halve(triangles_.begin() + begin, triangles_.begin() + middle, triangles_.begin() + end, node.upper - node.lower,
          [](const Triangle& t) { return t.corners[0] + t.corners[1] + t.corners[2]; });
    addNode(begin, middle);
    nodes_[index].right = std::uint32_t(nodes_.size());
    addNode(middle, end);
}

void ExactDistance::search(const Node& node, const glm::dvec3& point, Nearest& nearest) const {
    if (node.right == 0) {
        for (std::uint32_t i = node.begin; i < node.end; ++i) {
            const Triangle& triangle = triangles_[i];
            const Closest closest = closestOnTriangle(triangle.corners, triangle.normals[face], point);
            const glm::dvec3 gap = point - closest.point;
            if (glm::dot(gap, gap) < nearest.squaredDistance) nearest = {glm::dot(gap, gap), &triangle, closest};
        }
        return;
    }
    const Node *near = &node + 1, *far = &nodes_[node.right];
    double nearGap = squaredDistanceToBox(near->lower, near->upper, point);
    double farGap = squaredDistanceToBox(far->lower, far->upper, point);
    if (farGap < nearGap) {
        std::swap(near, far);
        std::swap(nearGap, farGap);
    }
    if (nearGap < nearest.squaredDistance) search(*near, point, nearest);
    if (farGap < nearest.squaredDistance) search(*far, point, nearest);
}

double ExactDistance::operator()(const glm::dvec3& point) const {
    Nearest nearest;
    search(nodes_.front(), point, nearest);
    const glm::dvec3& normal = nearest.triangle->normals[std::size_t(nearest.closest.feature)];
    const double distance = std::sqrt(nearest.squaredDistance);
    return glm::dot(normal, point - nearest.closest.point) < 0 ? -distance : distance;
}

Specimen::Specimen(const Mesh& mesh, double spacing) : distance_(mesh) {
    for (const auto& point : mesh.points) points_.push_back(point);
    for (const auto& triangle : mesh.triangles) {
        const auto [a, b, c] = cornersOf(mesh, triangle);
        const double longest = std::max({glm::distance(a, b), glm::distance(b, c), glm::distance(c, a)});
        const int rows = int(std::ceil(longest / spacing));
        for (int i = 0; i <= rows; ++i)
            for (int j = 0; i + j <= rows; ++j) {
                const bool vertex = (i == 0 || i == rows) && (j == 0 || j == rows);
                if (!vertex) points_.push_back(a + (double(i) * (b - a) + double(j) * (c - a)) / double(rows));
            }
    }
    addBall(0, std::uint32_t(points_.size()));
}

void Specimen::addBall(std::uint32_t begin, std::uint32_t end) {
    glm::dvec3 lower = points_[begin], upper = points_[begin];
    for (std::uint32_t i = begin; i < end; ++i) {
        lower = glm::min(lower, points_[i]);
        upper = glm::max(upper, points_[i]);
    }
    Ball ball{0.5 * (lower + upper), 0, begin, end, 0};
    for (std::uint32_t i = begin; i < end; ++i)
        ball.radius = std::max(ball.radius, glm::distance(points_[i], ball.centre));
    const std::size_t index = balls_.size();
    balls_.push_back(ball);
    if (end - begin <= leafPoints) return;

    const std::uint32_t middle = begin + (end - begin) / 2;
    halve(points_.begin() + begin, points_.begin() + middle, points_.begin() + end, upper - lower,
          [](const glm::dvec3& point) { return point; });
    addBall(begin, middle);
    balls_[index].right = std::uint32_t(balls_.size());
    addBall(middle, end);
}

// Branch and bound. The exact distance is 1-Lipschitz, so the depth of a ball's points exceeds that of its centre by at
// most the radius.
struct Specimen::Descent {
    const Specimen& specimen;
    const ExactDistance& other;
    Motion self, otherMotion;
    double deepest;

    double depth(const glm::dvec3& point) const { return -other(otherMotion.toBody(self.toWorld(point))); }

    void descend(const Ball& ball) {
        if (depth(ball.centre) + ball.radius <= deepest) return;
        if (ball.right == 0) {
            for (std::uint32_t i = ball.begin; i < ball.end; ++i)
                deepest = std::max(deepest, depth(specimen.points_[i]));
            return;
        }
        descend(*(&ball + 1));
        descend(specimen.balls_[ball.right]);
    }
};

double Specimen::deepestIn(const ExactDistance& other, const Pose& self, const Pose& otherPose, double least) const {
    Descent descent{*this, other, Motion(self), Motion(otherPose), least};
    descent.descend(balls_.front());
    return descent.deepest;
}

double penetration(const Specimen& a, const Pose& poseA, const Specimen& b, const Pose& poseB, double least) {
    return a.deepestIn(b.distance(), poseA, poseB, b.deepestIn(a.distance(), poseB, poseA, least));
}

}  // namespace bilayer::demo
