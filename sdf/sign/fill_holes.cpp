// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/fill_holes.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "sdf/base/openvdb.h"
#include "sdf/bvh/winding_number.h"
#include "sdf/mesh/boundary_loops.h"
#include "sdf/mesh/topology.h"

namespace bilayer::detail {
namespace {

// Longer loops take seconds to triangulate.
constexpr std::size_t maxEdges = 1000;
// Maximum deviation from one half of the winding number on a fill ("lid"). The fill lies halfway between outside (0)
// and inside (1), except for the influence of other holes.
constexpr double maxDeviation = 0.25;
// Distance from a fill triangle at which winding numbers are evaluated, on both sides [sqrt of its area].
constexpr double sampleOffset = 1e-3;

using Loop = BoundaryLoops::Loop;
using Lid = std::vector<glm::uvec3>;

// Of the edges at the end of a path, the one that turns back the most: it leads to the opposite side of a crack.
std::size_t backMost(const Mesh& mesh, const Loop& path, const Loop& ends) {
    if (path.size() < 2) return 0;
    const auto directionTo = [&](unsigned to) {
        return glm::normalize(glm::dvec3(mesh.points[to]) - glm::dvec3(mesh.points[path.back()]));
    };
    const glm::dvec3 back = directionTo(path[path.size() - 2]);
    const auto cosine = [&](unsigned to) { return glm::dot(directionTo(to), back); };
    const auto best =
        std::max_element(ends.begin(), ends.end(), [&](unsigned a, unsigned b) { return cosine(a) < cosine(b); });
    return std::size_t(best - ends.begin());
}

// Merges vertices with equal coordinates, and boundary vertices that are closer together than the crack width. Keeps
// the vertices of one triangle separate.
Mesh withJoinedRims(const Mesh& mesh, std::vector<unsigned> rim, double crack) {
    std::vector<unsigned> first(mesh.points.size());
    std::iota(first.begin(), first.end(), 0u);
    const auto at = [&](unsigned v) { return glm::dvec3(mesh.points[v]); };
    std::stable_sort(rim.begin(), rim.end(), [&](unsigned a, unsigned b) { return at(a).x < at(b).x; });
    for (std::size_t i = 0; i < rim.size(); ++i)
        for (std::size_t k = i + 1; k < rim.size() && at(rim[k]).x - at(rim[i]).x <= crack; ++k)
            if (first[rim[i]] == rim[i] && first[rim[k]] == rim[k] && glm::distance(at(rim[i]), at(rim[k])) <= crack)
                first[rim[k]] = rim[i];
    Mesh joined{mesh.points, Topology(mesh).triangles, mesh.origin};
    for (const glm::uvec3& t : joined.triangles)
        for (int i = 0; i < 3; ++i)
            if (const unsigned a = t[i], b = t[(i + 1) % 3]; a != b && first[a] == first[b]) first[a] = a, first[b] = b;
    for (glm::uvec3& t : joined.triangles) t = {first[t.x], first[t.y], first[t.z]};
    return joined;
}

glm::dvec3 areaOf(const Mesh& mesh, const glm::uvec3& t) {
    const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
    return 0.5 * glm::cross(b - a, c - a);
}

// The minimum-area triangulation of a loop.
class MinArea {
  public:
    MinArea(const Mesh& mesh, const Loop& loop)
        : loop_(loop), size_(loop.size()), areas_(size_ * size_, 0), middles_(size_ * size_, 0) {
        for (std::size_t span = 2; span < size_; ++span)
            for (std::size_t first = 0; first + span < size_; ++first) {
                double& smallest = areas_[first * size_ + first + span];
                smallest = std::numeric_limits<double>::max();
                for (std::size_t middle = first + 1; middle < first + span; ++middle) {
                    const double area = areas_[first * size_ + middle] + areas_[middle * size_ + first + span] +
                                        glm::length(areaOf(mesh, triangle(first, middle, first + span)));
                    if (!(area < smallest)) continue;
                    smallest = area;
                    middles_[first * size_ + first + span] = unsigned(middle);
                }
            }
        add(0, size_ - 1);
    }

    double area() const { return areas_[size_ - 1]; }
    const Lid& lid() const { return lid_; }

  private:
    glm::uvec3 triangle(std::size_t a, std::size_t b, std::size_t c) const { return {loop_[a], loop_[b], loop_[c]}; }

    void add(std::size_t first, std::size_t last) {
        std::vector<std::pair<std::size_t, std::size_t>> open{{first, last}};
        while (!open.empty()) {
            const auto [from, to] = open.back();
            open.pop_back();
            if (to - from < 2) continue;
            const std::size_t middle = middles_[from * size_ + to];
            lid_.push_back(triangle(from, middle, to));
            open.emplace_back(from, middle);
            open.emplace_back(middle, to);
        }
    }

    const Loop& loop_;
    std::size_t size_;
    std::vector<double> areas_;  // of the part of the loop between two of its vertices
    std::vector<unsigned> middles_;
    Lid lid_;
};

double lengthOf(const Mesh& mesh, const Loop& loop) {
    double length = 0;
    for (std::size_t i = 0; i < loop.size(); ++i)
        length += glm::distance(glm::dvec3(mesh.points[loop[i]]), glm::dvec3(mesh.points[loop[(i + 1) % loop.size()]]));
    return length;
}

// Returns whether most of a fill separates inside from outside. Also requires that no triangle of the mesh is there
// already, since winding numbers would jump across it.
bool isBorder(const Mesh& mesh, const Lid& lid, const WindingNumber& winding) {
    double area = 0, border = 0;
    for (const glm::uvec3& t : lid) {
        const glm::dvec3 middle =
            (glm::dvec3(mesh.points[t.x]) + glm::dvec3(mesh.points[t.y]) + glm::dvec3(mesh.points[t.z])) / 3.0;
        const glm::dvec3 vector = areaOf(mesh, t);
        const double its = glm::length(vector);
        if (!(its > 0)) continue;
        const glm::dvec3 step = sampleOffset / std::sqrt(its) * vector;
        const auto isHalf = [&](const glm::dvec3& place) {
            return std::abs(winding.estimate(place, 0.1).value - 0.5) < maxDeviation;
        };
        area += its;
        if (isHalf(middle + step) && isHalf(middle - step)) border += its;
    }
    return 2 * border > area;
}

// A crack does not change winding numbers.
std::optional<Lid> lidOf(const Mesh& mesh, const Loop& loop, double crack, const WindingNumber& winding) {
    if (loop.size() < 3 || loop.size() > maxEdges) return std::nullopt;
    const MinArea smallest(mesh, loop);
    const bool isCrack = 2 * smallest.area() <= crack * lengthOf(mesh, loop);
    if (!isCrack && !isBorder(mesh, smallest.lid(), winding)) return std::nullopt;
    return smallest.lid();
}

// Removes fill triangles of almost no area ("caps"), such as between an edge and the vertices on it across a crack. An
// edge flip replaces the longest edge of such a triangle by the other diagonal of the triangle and its neighbour.
class CapRemoval {
  public:
    /// @param first   index of the first triangle that may be removed
    /// @param crack   maximum height of such triangles [m]
    CapRemoval(Mesh& mesh, std::size_t first, double crack) : mesh_(mesh), first_(unsigned(first)), crack_(crack) {
        for (unsigned t = 0; t < mesh.triangles.size(); ++t) enter(t);
    }

    // Each flip between two caps shortens their longest edges.
    void run() {
        std::vector<unsigned> caps;
        for (unsigned t = first_; t < mesh_.triangles.size(); ++t) caps.push_back(t);
        const std::size_t rounds = caps.size();  // a row of caps loses at least one per round
        for (std::size_t round = 0; round < rounds && !caps.empty(); ++round) {
            for (const unsigned t : caps) exchange(t);
            std::erase_if(caps, [&](unsigned t) { return longestOfCap(t) < 0; });
        }
    }

  private:
    static std::uint64_t keyOf(unsigned from, unsigned to) { return std::uint64_t(from) << 32 | to; }
    glm::dvec3 at(unsigned vertex) const { return glm::dvec3(mesh_.points[vertex]); }

    void enter(unsigned t) {
        const glm::uvec3& v = mesh_.triangles[t];
        for (int i = 0; i < 3; ++i) triangles_[keyOf(v[i], v[(i + 1) % 3])] = t;
    }

    // Returns the first corner of the longest edge if the third corner lies close to the edge and between its ends;
    // else -1.
    int longestOfCap(unsigned t) const {
        const glm::uvec3& v = mesh_.triangles[t];
        const auto length = [&](int i) { return glm::distance(at(v[i]), at(v[(i + 1) % 3])); };
        const int i = length(0) >= length(1) && length(0) >= length(2) ? 0 : length(1) >= length(2) ? 1 : 2;
        const glm::dvec3 along = at(v[(i + 1) % 3]) - at(v[i]), to = at(v[(i + 2) % 3]) - at(v[i]);
        const double base = glm::length(along), place = glm::dot(to, along) / base;
        const bool isCap =
            glm::length(glm::cross(along, to)) <= crack_ * base && place > crack_ && place < base - crack_;
        return isCap ? i : -1;
    }

    // If the neighbour is also a cap, the edge must be its longest too.
    void exchange(unsigned cap) {
        const int i = longestOfCap(cap);
        if (i < 0) return;
        const glm::uvec3 v = mesh_.triangles[cap];
        const unsigned from = v[i], to = v[(i + 1) % 3], on = v[(i + 2) % 3];
        const auto found = triangles_.find(keyOf(to, from));
        if (found == triangles_.end()) return;
        const unsigned other = found->second;
        const glm::uvec3& o = mesh_.triangles[other];
        const int its = longestOfCap(other);
        if (its >= 0 && o[its] != to) return;
        const unsigned opposite = o.x ^ o.y ^ o.z ^ from ^ to;
        if (opposite == on) return;
        triangles_.erase(found);
        triangles_.erase(keyOf(from, to));
        mesh_.triangles[cap] = {on, from, opposite};
        mesh_.triangles[other] = {on, opposite, to};
        enter(cap);
        enter(other);
    }

    Mesh& mesh_;
    unsigned first_;
    double crack_;
    std::unordered_map<std::uint64_t, unsigned> triangles_;  // keyed by their directed edges
};

}  // namespace

FilledMesh fillHoles(Mesh mesh, double crack) {
    const std::vector<unsigned> rim = BoundaryLoops(mesh).vertices();
    if (rim.empty()) return {std::move(mesh)};
    Mesh joined = withJoinedRims(mesh, rim, crack);
    const std::vector<Loop> loops = BoundaryLoops(joined).takeLoops(
        [&](const Loop& path, const Loop& ends) { return backMost(joined, path, ends); });
    const WindingNumber winding(joined);
    const std::size_t given = joined.triangles.size();
    FilledMesh filled;
    Lid lids;
    for (const Loop& loop : loops)
        if (const auto lid = lidOf(joined, loop, crack, winding))
            lids.insert(lids.end(), lid->begin(), lid->end());
        else
            ++filled.openLoops;
    filled.loops = loops.size() - filled.openLoops;
    joined.triangles.insert(joined.triangles.end(), lids.begin(), lids.end());
    CapRemoval(joined, given, crack).run();
    filled.changed = filled.loops > 0 || BoundaryLoops(joined).vertices().size() < rim.size();
    filled.mesh = filled.changed ? std::move(joined) : std::move(mesh);
    return filled;
}

}  // namespace bilayer::detail
