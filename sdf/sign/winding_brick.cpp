// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/winding_brick.h"

namespace bilayer::detail {

WindingBrick::WindingBrick(std::span<const OctreeCell> cells) : cells_(cells), origin_(cells.front().origin) {
    if (cells.size() == 1) return;  // one empty cell, which may be larger than a brick
    int empties = 0;
    for (const OctreeCell& cell : cells) {
        const int number = cell.leaf ? -1 : empties++;
        const openvdb::Coord o = cell.origin - origin_;
        const int blocks = cell.side / blockSide;
        for (int x = 0; x < blocks; ++x)
            for (int y = 0; y < blocks; ++y)
                for (int z = 0; z < blocks; ++z)
                    numbers_[std::size_t(((o.x() / 8 + x) * 8 + o.y() / 8 + y) * 8 + o.z() / 8 + z)] =
                        std::int16_t(number);
    }
}

}  // namespace bilayer::detail
