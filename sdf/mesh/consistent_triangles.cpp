// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/consistent_triangles.h"

#include <algorithm>
#include <cstdlib>
#include <limits>

namespace bilayer::detail {
namespace {

constexpr unsigned noTriangle = std::numeric_limits<unsigned>::max();

}  // namespace

ConsistentTriangles::ConsistentTriangles(const Mesh& mesh, Progress* progress)
    : mesh_(mesh), progress_(progress), topology_(mesh, progress), sets_(mesh.triangles.size()) {
    findBalanced();
    findDoubled();
    joinNeighbours();
    joinPatches();
}

std::vector<std::uint64_t> ConsistentTriangles::edgeSums() {
    return edgeSums(sets_, [&](unsigned i) { return counts(i); });
}

// Returns for each set, at its root, zero if its triangles, flipped relative to the root as stored, form a closed
// surface.
template <class Takes>
std::vector<std::uint64_t> ConsistentTriangles::edgeSums(DisjointSets& sets, Takes takes) const {
    const std::vector<std::uint64_t> vertices = hashVertices(mesh_, progress_);
    auto sums = vectorOf<std::uint64_t>(mesh_.triangles.size(), progress_);
    for (const unsigned i : eachTriangle()) {
        if (!takes(i)) continue;
        const glm::uvec3& t = mesh_.triangles[i];
        const std::uint64_t a = vertices[t.x], b = vertices[t.y], c = vertices[t.z];
        const std::uint64_t sum = hashEdge(a, b) + hashEdge(b, c) + hashEdge(c, a);
        sums[sets.root(i)] += sets.oppositeToRoot(i) ? 0 - sum : sum;
    }
    return sums;
}

// Finds balanced bodies: triangles connected by edges that are all balanced. However many triangles meet at an edge,
// only the orientation of a whole body can be wrong.
void ConsistentTriangles::findBalanced() {
    DisjointSets bodies(mesh_.triangles.size());
    topology_.forEachEdge([&](std::span<const EdgeUse> uses) {
        for (const EdgeUse& use : uses) bodies.join(uses[0].triangle, use.triangle);
    });
    const std::vector<std::uint64_t> sums = edgeSums(bodies, [](unsigned) { return true; });
    body_.resize(mesh_.triangles.size());
    balanced_.resize(mesh_.triangles.size());
    for (const unsigned i : eachTriangle()) {
        body_[i] = bodies.root(i);
        balanced_[i] = sums[body_[i]] == 0;
    }
}

// Finds balanced bodies in which every face exists twice, back to back. Together the copies enclose nothing, but one
// half of them may enclose a volume.
void ConsistentTriangles::findDoubled() {
    excess_.assign(mesh_.triangles.size(), 0);
    auto copies = vectorOf<unsigned>(mesh_.triangles.size(), progress_);
    for (const unsigned i : eachTriangle()) {
        excess_[topology_.original[i]] += opposite(i) ? -1 : 1;
        ++copies[topology_.original[i]];
    }
    std::vector<bool> doubled = balanced_;
    for (const unsigned i : eachTriangle())
        if (topology_.original[i] == i && topology_.proper(i) && (excess_[i] != 0 || copies[i] != 2))
            doubled[body_[i]] = false;
    doubled_.resize(mesh_.triangles.size());
    for (const unsigned i : eachTriangle()) {
        doubled_[i] = doubled[body_[i]];
        if (doubled_[i]) balanced_[i] = false;
    }
}

bool ConsistentTriangles::opposite(unsigned triangle) const {
    const unsigned original = topology_.original[triangle];
    return original != triangle && topology_.facesOpposite(triangle, original);
}

std::vector<EdgeUse> ConsistentTriangles::countingUses(std::span<const EdgeUse> uses) const {
    std::vector<EdgeUse> some;
    for (const EdgeUse& use : uses)
        if (counts(use.triangle)) some.push_back(use);
    return some;
}

void ConsistentTriangles::joinNeighbours() {
    topology_.forEachEdge([&](std::span<const EdgeUse> all) {
        if (all.size() < 2) return;
        const std::vector<EdgeUse> uses = countingUses(all);
        if (uses.size() != 2) return;
        const bool agree = uses[0].forward != uses[1].forward;
        if (!sets_.join(uses[0].triangle, uses[1].triangle, !agree)) contradictions_.push_back(uses[0].triangle);
    });
    for (const unsigned i : eachTriangle())
        if (!counts(i)) sets_.join(topology_.original[i], i, doubled_[i] && opposite(i));
}

// Joins patches at edges of more than two triangles, if they traverse the edge the same number of times.
void ConsistentTriangles::joinPatches() {
    DisjointSets patches = sets_;
    const std::vector<std::uint64_t> sums = edgeSums(patches, [&](unsigned i) { return counts(i); });
    joinBalanced(patches, sums);
    topology_.forEachEdge([&](std::span<const EdgeUse> all) {
        if (all.size() < 3 || balanced_[all[0].triangle]) return;
        std::vector<std::pair<unsigned, int>> runs;  // open patches and their net count of forward half-edges
        for (const EdgeUse& use : countingUses(all)) {
            const unsigned patch = patches.root(use.triangle);
            if (sums[patch] == 0) continue;
            if (runs.empty() || runs.back().first != patch) runs.emplace_back(patch, 0);
            runs.back().second += patches.oppositeToRoot(use.triangle) ? -use.direction() : use.direction();
        }
        joinAlong(runs);
    });
}

// Joins the open patches of a balanced body, which keep their relative orientation. Closed patches may be flipped
// alone.
void ConsistentTriangles::joinBalanced(DisjointSets& patches, const std::vector<std::uint64_t>& sums) {
    std::vector<unsigned> firstOpen(mesh_.triangles.size(), noTriangle);
    for (const unsigned i : eachTriangle()) {
        if (!balanced_[i] || sums[patches.root(i)] == 0) continue;
        unsigned& first = firstOpen[body_[i]];
        if (first == noTriangle) first = i;
        sets_.join(first, i);
    }
}

void ConsistentTriangles::joinAlong(std::vector<std::pair<unsigned, int>>& runs) {
    std::sort(runs.begin(), runs.end());
    std::vector<std::pair<unsigned, int>> merged;
    int sum = 0;
    for (const auto& [patch, count] : runs) {
        if (merged.empty() || merged.back().first != patch) merged.emplace_back(patch, 0);
        merged.back().second += count;
        sum += count;
    }
    std::erase_if(merged, [](const auto& run) { return run.second == 0; });
    if (merged.size() == 2 && std::abs(merged[0].second) == std::abs(merged[1].second))
        sets_.join(merged[0].first, merged[1].first, merged[0].second == merged[1].second);
    else if (sum == 0)
        for (std::size_t i = 1; i < merged.size(); ++i) sets_.join(merged[0].first, merged[i].first);
}

}  // namespace bilayer::detail
