// SPDX-License-Identifier: Apache-2.0
// Finds the triangles of a mesh that must keep or change their orientation together, so that neighbours agree.
// Tested by tests/sdf/orient.cpp through orient().
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/mesh/topology.h"

namespace bilayer::detail {

/// Sets of triangles with a common orientation. A set is connected by edges of two triangles, or by edges of more
/// triangles whose half-edges still pair up. The root of a set is its smallest triangle.
class ConsistentTriangles {
  public:
    /// @param progress  polled, unless null
    ConsistentTriangles(const Mesh& mesh, Progress* progress);

    unsigned root(unsigned triangle) { return sets_.root(triangle); }
    /// Returns whether exactly one of a triangle and its root must be flipped.
    bool oppositeToRoot(unsigned triangle) { return sets_.oppositeToRoot(triangle); }

    /// Returns for each set, at its root, zero if its triangles form a closed surface. Those opposite to the root count
    /// as flipped.
    std::vector<std::uint64_t> edgeSums();

    /// Triangles at edges where no flipping makes neighbours agree, as on a Moebius strip.
    const std::vector<unsigned>& contradictions() const { return contradictions_; }

    /// Duplicate triangles would hide that an edge has only two triangles. Except in balanced bodies, they do not count
    /// and follow their originals.
    bool counts(unsigned triangle) const { return balanced_[triangle] || topology_.original[triangle] == triangle; }

    /// Returns whether a triangle bounds a volume. Copies with the same orientation count as one wall. Equal counts of
    /// both orientations cancel out.
    bool encloses(unsigned triangle) const {
        return topology_.original[triangle] == triangle && (!balanced_[triangle] || excess_[triangle] != 0);
    }

    /// Returns the first triangle that is connected with a triangle by edges.
    unsigned body(unsigned triangle) const { return body_[triangle]; }
    /// Returns whether each face of a triangle's body exists twice, back to back.
    bool doubled(unsigned triangle) const { return doubled_[triangle]; }

    const Topology& topology() const { return topology_; }
    Polled eachTriangle() const { return {mesh_.triangles.size(), progress_}; }

  private:
    void findBalanced();
    void findDoubled();
    bool opposite(unsigned triangle) const;
    std::vector<EdgeUse> countingUses(std::span<const EdgeUse> uses) const;
    void joinNeighbours();
    void joinPatches();
    void joinBalanced(DisjointSets& patches, const std::vector<std::uint64_t>& sums);
    void joinAlong(std::vector<std::pair<unsigned, int>>& runs);
    template <class Takes>
    std::vector<std::uint64_t> edgeSums(DisjointSets& sets, Takes takes) const;

    const Mesh& mesh_;
    Progress* progress_;
    Topology topology_;
    DisjointSets sets_;           // opposite members: exactly one of the two must be flipped
    std::vector<unsigned> body_;  // for each triangle
    std::vector<bool> balanced_;  // for each triangle: all edges of its body are balanced
    std::vector<int> excess_;     // for each original: copies with its orientation minus opposite ones
    std::vector<bool> doubled_;   // for each triangle
    std::vector<unsigned> contradictions_;
};

}  // namespace bilayer::detail
