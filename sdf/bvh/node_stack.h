// SPDX-License-Identifier: Apache-2.0
// The traversal of a tree from a node down, nearest nodes first. Highway includes this file once for each instruction
// set: only between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/collider/mesh_rays.cpp through MeshTree.
#if defined(BILAYER_SDF_NODE_STACK_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_NODE_STACK_H
#undef BILAYER_SDF_NODE_STACK_H
#else
#define BILAYER_SDF_NODE_STACK_H
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstddef>
#include <cstdint>

#include "sdf/bvh/box_tree.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {

// The nodes that are still to visit, each with a key. The last one is visited next.
struct NodeStack {
    std::size_t count = 0;
    float keys[maxOpenNodes];
    std::uint32_t nodes[maxOpenNodes];

    void push(float key, std::uint32_t node) { keys[count] = key, nodes[count++] = node; }

    // Pushes the children of a group whose bits are set, the one with the smallest key last.
    void pushChildren(unsigned bits, const float* childKeys, std::uint32_t firstChild) {
        const std::size_t first = count;
        for (; bits != 0; bits &= bits - 1) {
            const auto lane = std::size_t(std::countr_zero(bits));
            std::size_t place = count++;
            for (; place > first && keys[place - 1] < childKeys[lane]; --place) {
                keys[place] = keys[place - 1];
                nodes[place] = nodes[place - 1];
            }
            keys[place] = childKeys[lane];
            nodes[place] = firstChild + std::uint32_t(lane);
        }
    }
};

// Visits a node and all nodes below it, except skipped ones. Returns true as soon as a visit of a leaf does.
//   skip(key)           whether the node with this key and all nodes below it are irrelevant
//   open(group, stack)  pushes the relevant children of the group with this index
//   visit(leaf)         whether the traversal ends with the leaf of this index
template <class Skip, class Open, class Visit>
inline bool descend(const BoxTree& tree, std::uint32_t from, Skip skip, Open open, Visit visit) {
    NodeStack stack;
    stack.push(0, from);
    while (stack.count > 0) {
        --stack.count;
        if (skip(stack.keys[stack.count])) continue;
        const std::uint32_t node = stack.nodes[stack.count];
        if (!tree.isLeaf(node))
            open(node - tree.leafCount, stack);
        else if (visit(node))
            return true;
    }
    return false;
}

}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
