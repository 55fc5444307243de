// SPDX-License-Identifier: Apache-2.0
#include "collider/field/layout/leaf_block.h"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/vec3.hpp>

#include "collider/field/layout/field_layout.h"

namespace bilayer::detail {

void copyBlock(const openvdb::FloatGrid::ConstAccessor& tree, const openvdb::Coord& origin, float* block) {
    constexpr int side = FieldFrame::side, stride = FieldFrame::stride;
    for (int part = 0; part < 8; ++part) {
        const glm::ivec3 first = side * glm::ivec3(part >> 2, part >> 1 & 1, part & 1);
        const glm::ivec3 count = glm::min(glm::ivec3(side), stride - first);
        const openvdb::Coord corner = origin.offsetBy(first.x, first.y, first.z);
        const auto* leaf = tree.probeConstLeaf(corner);
        const float* values = leaf ? leaf->buffer().data() : nullptr;
        const float tile = leaf ? 0.f : tree.getValue(corner);
        for (int x = 0; x < count.x; ++x)
            for (int y = 0; y < count.y; ++y) {
                float* row = block + ((first.x + x) * stride + first.y + y) * stride + first.z;
                if (values)
                    std::copy_n(values + (x * side + y) * side, count.z, row);
                else
                    std::fill_n(row, count.z, tile);
            }
    }
}

}  // namespace bilayer::detail
