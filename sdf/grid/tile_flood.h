// SPDX-License-Identifier: Apache-2.0
// Signs of the tiles between leaves.
// Tested by tests/sdf/tile_flood.cpp.
#pragma once

#include <cstdint>
#include <type_traits>

#include "sdf/base/openvdb.h"

namespace bilayer::detail {

/// Gives each tile of a node of OpenVDB's tree the side of what precedes it along z, else along y, else along x. Tiles
/// before the first child get the side of its first voxel. That is the rule of openvdb::tools::signedFloodFill(), which
/// writes every tile. Here only the tiles inside are written, so that a node with few children costs little.
///
/// All tiles must be outside at first, and the nodes below must have their signs.
/// @param onInside  called with the number of each tile that is set
template <class Node, class OnInside>
void floodTiles(Node& node, float interior, const OnInside& onInside) {
    using Row =
        std::conditional_t<Node::LOG2DIM == 5, std::uint32_t, std::uint16_t>;  // the children along z, one bit each
    static_assert(8 * sizeof(Row) == Node::DIM / Node::ChildNodeType::DIM);
    constexpr openvdb::Index side = 1u << Node::LOG2DIM;
    const auto& children = node.getChildMask();
    const openvdb::Index first = children.findFirstOn();
    if (first == Node::NUM_VALUES) return;
    auto* const table = const_cast<typename Node::UnionType*>(node.getTable());
    const auto endsInside = [&](openvdb::Index n) { return table[n].getChild()->getLastValue() < 0; };
    bool alongX = table[first].getChild()->getFirstValue() < 0;
    for (openvdb::Index x = 0; x < side; ++x) {
        if (children.isOn(x * side * side)) alongX = endsInside(x * side * side);
        bool alongY = alongX;
        for (openvdb::Index row = x * side; row < (x + 1) * side; ++row) {
            const Row below = children.template getWord<Row>(row);
            if (below & 1) alongY = endsInside(row * side);
            if (!below && !alongY) continue;
            bool alongZ = alongY;
            for (openvdb::Index z = 0; z < side; ++z) {
                const openvdb::Index n = row * side + z;
                if (below >> z & 1) {
                    alongZ = endsInside(n);
                } else if (alongZ) {
                    table[n].setValue(interior);
                    onInside(n);
                }
            }
        }
    }
}

}  // namespace bilayer::detail
