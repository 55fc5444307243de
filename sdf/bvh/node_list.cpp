// SPDX-License-Identifier: Apache-2.0
// Highway compiles the part between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once for each instruction set.
#include "sdf/bvh/node_list.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/bvh/node_list.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "sdf/bvh/node_narrowing.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace {

void narrowNodes(const WideTree& tree, const NodeList& from, const VoxelBox& voxels, float reach, float largest,
                 NodeList& to) {
    narrowList(tree, from, voxels, reach, largest, to);
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {

HWY_EXPORT(narrowNodes);

void NodeList::makeRoom(std::size_t more) {
    if (count + 2 * more <= nodes.size()) return;
    const std::size_t size = 2 * (count + 2 * more);
    for (int k = 0; k < 3; ++k) lower[k].resize(size), upper[k].resize(size);
    nodes.resize(size);
}

NodeList wholeTree(const WideTree& tree) {
    NodeList list;
    list.makeRoom(treeWidth);
    for (int k = 0; k < 3; ++k) list.lower[k][0] = -1, list.upper[k][0] = float(tree.size[k] + 1);
    list.nodes[0] = tree.root();
    list.count = 1;
    return list;
}

void narrow(const WideTree& tree, const NodeList& from, const VoxelBox& voxels, float reach, float largest,
            NodeList& to) {
    HWY_DYNAMIC_DISPATCH(narrowNodes)(tree, from, voxels, reach, largest, to);
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
