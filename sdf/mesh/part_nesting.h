// SPDX-License-Identifier: Apache-2.0
// Finds which parts of a mesh lie within others.
//
// A part in a nest of n others has n containers, so that lists of all containers would have a length of n^2. Instead,
// each part names its innermost container, and how its other containers differ from those of that one.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/mesh/mesh_parts.h"
#include "sdf/mesh/part_boxes.h"

namespace bilayer::detail {

class Progress;

/// The containers of all parts. A part contains another if lines from three triangles of the other cross it an odd
/// number of times, and if its box contains the other's box. Orientation does not matter.
class PartNesting {
  public:
    /// @param tree      of the mesh
    /// @param partOf    the part of each triangle; `noPart` for triangles to ignore
    /// @param progress  polled, unless null
    PartNesting(const Mesh& mesh, const TriangleTree& tree, std::span<const unsigned> partOf, std::size_t parts,
                Progress* progress = nullptr);

    /// Returns all parts, by the diagonals of their boxes. A part's containers come before it, unless boxes are equal.
    std::span<const unsigned> largestFirst() const { return order_; }

    /// Returns the sum of a value over the containers of a part. Call it for all parts, the largest first.
    /// @param inherited  keeps sums between the calls; as many as parts
    /// @param valueOf    called with containers
    template <class Value, class ValueOf>
    Value sum(unsigned part, std::vector<Value>& inherited, const ValueOf& valueOf) const {
        const Containers& c = containers_[part];
        Value total(0);
        if (c.innermost != noPart) {
            total = inherited[c.innermost];
            total += valueOf(c.innermost);
        }
        for (const unsigned outer : c.added) total += valueOf(outer);
        for (const unsigned outer : c.removed) total -= valueOf(outer);
        inherited[part] = total;
        for (const unsigned outer : c.own) total += valueOf(outer);
        return total;
    }

  private:
    /// The containers of a part: the innermost one and its containers, with differences.
    struct Containers {
        unsigned innermost = noPart;
        std::vector<unsigned> added, removed;  ///< to and from those of the innermost one
        std::vector<unsigned> own;             ///< more, which parts within this one do not inherit
    };
    /// What the parts within a part inherit from it.
    struct Heritage {
        bool isInherited = false;        // whether they inherit its containers
        std::vector<unsigned> touching;  // larger parts that touch it: parts within it must test these themselves
    };

    bool findInnermost(unsigned part, Containers& containers) const;
    void findAll(unsigned part, const TriangleTree& tree, Containers& containers) const;
    unsigned clearContainer(unsigned part, std::vector<unsigned>& touching) const;
    bool findTouching(unsigned part, std::vector<unsigned>& touching) const;
    void correct(unsigned part, Containers& containers) const;
    static PartBoxes boxesOf(const MeshParts& parts, std::span<const unsigned> order, bool separating);

    MeshParts parts_;
    std::vector<unsigned> order_, rank_;  // by size; the place of each part in this order
    PartBoxes separating_, others_;
    std::vector<Containers> containers_;
    std::vector<Heritage> heritage_;
};

}  // namespace bilayer::detail
