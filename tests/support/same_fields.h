// SPDX-License-Identifier: Apache-2.0
// Whether two fields are equal: every value, every tile, and the metadata.
#pragma once

#include <cstring>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/level_set.h>
#include "sdf/base/openvdb.h"

namespace bilayer::test {

template <class Grid>
bool sameTrees(const Grid& a, const Grid& b) {
    if (!a.tree().hasSameTopology(b.tree()) || a.background() != b.background()) return false;
    auto other = b.tree().cbeginLeaf();
    for (auto leaf = a.tree().cbeginLeaf(); leaf; ++leaf, ++other)
        if (leaf->origin() != other->origin() ||
            std::memcmp(leaf->buffer().data(), other->buffer().data(), 512 * sizeof(typename Grid::ValueType)) != 0)
            return false;
    auto tile = b.cbeginValueAll();
    for (auto value = a.cbeginValueAll(); value; ++value, ++tile)
        if (value.getValue() != tile.getValue() || value.getCoord() != tile.getCoord() ||
            value.getLevel() != tile.getLevel())
            return false;
    return true;
}

inline bool sameMetadata(const openvdb::GridBase& a, const openvdb::GridBase& b) {
    if (a.metaCount() != b.metaCount()) return false;
    auto other = b.beginMeta();
    for (auto entry = a.beginMeta(); entry != a.endMeta(); ++entry, ++other)
        if (entry->first != other->first || *entry->second != *other->second) return false;
    return a.transform() == b.transform();
}

inline bool sameFields(const LevelSet& a, const LevelSet& b) {
    const Grids &p = a.grids(), &q = b.grids();
    if (bool(p.triangle) != bool(q.triangle)) return false;
    return sameTrees(*p.distance, *q.distance) && sameMetadata(*p.distance, *q.distance) &&
           (!p.triangle || (sameTrees(*p.triangle, *q.triangle) && p.triangle->transform() == q.triangle->transform()));
}

}  // namespace bilayer::test
