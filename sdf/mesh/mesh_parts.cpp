// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/mesh_parts.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <utility>

#include "sdf/base/progress.h"
#include "sdf/base/triangle_corners.h"
#include "sdf/mesh/part_boxes.h"
#include "sdf/mesh/topology.h"

namespace bilayer::detail {
namespace {

/// Surfaces closer than this count as touching, relative to the max coordinate: far above the rounding of doubles.
constexpr double touchingDistance = 1e-12;

// Returns whether two triangles are more than `slack` apart along a direction of any length.
bool separatedAlong(const glm::dvec3& axis, const TriangleCorners& a, const TriangleCorners& b, double slack) {
    const auto at = [&](const glm::dvec3& p) { return glm::dot(axis, p - a[0]); };
    const auto [lowA, highA] = std::minmax({0.0, at(a[1]), at(a[2])});
    const auto [lowB, highB] = std::minmax({at(b[0]), at(b[1]), at(b[2])});
    return std::max(lowB - highA, lowA - highB) > slack * glm::length(axis);
}

// Tests all directions that can separate two triangles that do not lie in one plane: the normals, and those across two
// edges.
bool separated(const TriangleCorners& a, const TriangleCorners& b, double slack) {
    const auto edge = [](const TriangleCorners& t, std::size_t k) { return t[(k + 1) % 3] - t[k]; };
    for (const TriangleCorners* t : {&a, &b})
        if (separatedAlong(glm::cross(edge(*t, 0), edge(*t, 1)), a, b, slack)) return true;
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k)
            if (separatedAlong(glm::cross(edge(a, i), edge(b, k)), a, b, slack)) return true;
    return false;
}

// Returns whether triangles are connected by shared vertices.
bool isConnected(std::size_t triangles, std::vector<std::pair<std::uint64_t, unsigned>> corners) {
    std::sort(corners.begin(), corners.end());
    DisjointSets sets(triangles);
    for (std::size_t i = 1; i < corners.size(); ++i)
        if (corners[i].first == corners[i - 1].first) sets.join(corners[i].second, corners[i - 1].second);
    for (unsigned i = 1; i < triangles; ++i)
        if (sets.root(i) != 0) return false;
    return true;
}

}  // namespace

MeshParts::MeshParts(const Mesh& mesh, std::span<const unsigned> partOf, std::size_t parts, Progress* progress)
    : mesh_(mesh),
      partOf_(partOf),
      directions_(spreadDirections(votes)),
      first_(parts + 1, 0),
      boxes_(parts),
      separates_(parts, 0),
      once_(parts),
      trees_(parts) {
    for (const unsigned i : Polled(partOf.size(), progress)) {
        if (partOf[i] == noPart) continue;
        ++first_[partOf[i] + 1];
        for (int k = 0; k < 3; ++k) boxes_[partOf[i]].add(mesh.points[mesh.triangles[i][k]]);
    }
    for (std::size_t part = 0; part < parts; ++part) first_[part + 1] += first_[part];
    members_.resize(first_[parts]);
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    for (const unsigned i : Polled(partOf.size(), progress))
        if (partOf[i] != noPart) members_[next[partOf[i]]++] = i;
    double largest = 0;
    for (const Bounds& box : boxes_)
        for (int k = 0; k < 3 && !box.empty(); ++k)
            largest = std::max({largest, std::abs(double(box.lower[k])), std::abs(double(box.upper[k]))});
    slack_ = touchingDistance * largest;
    findSeparating(progress);
}

// The exclusive or over all edges is zero if each occurs an even number of times. Vertices of equal coordinates are
// one.
void MeshParts::findSeparating(Progress* progress) {
    const std::vector<std::uint64_t> vertices = hashVertices(mesh_, progress);
    tbb::parallel_for(std::size_t(0), count(), [&](std::size_t part) {
        poll(progress);
        std::uint64_t edges = 0;
        std::vector<std::pair<std::uint64_t, unsigned>>
            corners;  // hash of the vertex, index of the triangle in its part
        const std::span triangles = members(unsigned(part));
        corners.reserve(3 * triangles.size());
        for (unsigned i = 0; i < triangles.size(); ++i) {
            const glm::uvec3& t = mesh_.triangles[triangles[i]];
            for (int k = 0; k < 3; ++k) {
                const std::uint64_t from = vertices[t[k]], to = vertices[t[(k + 1) % 3]];
                edges ^= std::min(hashEdge(from, to), hashEdge(to, from));
                corners.emplace_back(from, i);
            }
        }
        separates_[part] = !triangles.empty() && edges == 0 && isConnected(triangles.size(), std::move(corners));
    });
}

const TriangleTree& MeshParts::treeOf(unsigned part) const {
    // building runs tasks, which must not wait for a tree themselves
    std::call_once(once_[part], [&] {
        tbb::this_task_arena::isolate(
            [&] { trees_[part] = std::make_unique<const TriangleTree>(mesh_, members(part)); });
    });
    return *trees_[part];
}

// Returns the centroid of a triangle.
glm::dvec3 MeshParts::start(unsigned part, std::size_t vote) const {
    const std::span triangles = members(part);
    const TriangleCorners t = cornersOf(mesh_, triangles[vote * triangles.size() / votes]);
    return (t[0] + t[1] + t[2]) / 3.0;
}

// Returns the part of each triangle of a hierarchy that a line from a part crosses.
std::vector<unsigned> MeshParts::crossedBy(unsigned part, std::size_t vote, const TriangleTree& tree) const {
    thread_local std::vector<Crossing> found;
    tree.crossings(start(part, vote), directions_[vote], found, 0);
    std::vector<unsigned> parts;
    for (const Crossing& crossing : found)
        if (partOf_[crossing.triangle] != noPart) parts.push_back(partOf_[crossing.triangle]);
    return parts;
}

bool MeshParts::contains(unsigned outer, unsigned inner) const {
    if (outer == inner || !holds(box(outer), box(inner))) return false;
    for (std::size_t vote = 0; vote < votes; ++vote)
        if (crossedBy(inner, vote, treeOf(outer)).size() % 2 == 0) return false;
    return true;
}

std::vector<unsigned> MeshParts::containersOf(unsigned inner, const TriangleTree& tree) const {
    std::array<std::vector<unsigned>, votes> crossed;
    for (std::size_t vote = 0; vote < votes; ++vote) crossed[vote] = crossedBy(inner, vote, tree);
    std::vector<unsigned> containers;
    containers.reserve(crossed[0].size());
    // by part: the votes whose lines cross it an odd number of times. Zero between calls
    thread_local std::vector<std::uint8_t> odd;
    if (odd.size() < count()) odd.resize(count());
    for (std::size_t vote = 0; vote < votes; ++vote)
        for (const unsigned outer : crossed[vote]) odd[outer] ^= std::uint8_t(1u << vote);
    for (const std::vector<unsigned>& parts : crossed)
        for (const unsigned outer : parts) {
            const bool within = odd[outer] == (1u << votes) - 1 && outer != inner && holds(box(outer), box(inner));
            if (within) containers.push_back(outer);
            odd[outer] = 0;
        }
    std::sort(containers.begin(), containers.end());
    return containers;
}

bool MeshParts::intersect(unsigned a, unsigned b) const {
    if (members(a).size() > members(b).size()) std::swap(a, b);
    if (!overlap(box(a), box(b))) return false;
    const TriangleTree& tree = treeOf(b);
    bool found = false;
    for (const unsigned triangle : members(a)) {
        const TriangleCorners corners = cornersOf(mesh_, triangle);
        const Bounds own = tree.boxOf(triangle);
        tree.descend([&](const Bounds& other) { return !found && overlap(own, other); },
                     [&](unsigned other) { found = found || !separated(corners, cornersOf(mesh_, other), slack_); });
        if (found) return true;
    }
    return false;
}

}  // namespace bilayer::detail
