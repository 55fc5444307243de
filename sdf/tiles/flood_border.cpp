// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/flood_border.h"

#include <algorithm>
#include <fstream>
#include <tuple>
#include <utility>

#include "sdf/sign/octree_cells.h"
#include "sdf/tiles/hashed_record.h"

namespace bilayer::detail {
namespace {

bool isBefore(const glm::ivec3& a, const glm::ivec3& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
}

}  // namespace

std::optional<std::uint32_t> FloodBorder::spaceAt(const glm::ivec3& block) const {
    if (isEmpty) return 0;
    auto row = std::upper_bound(space.begin(), space.end(), block,
                                [](const glm::ivec3& at, const SpaceRow& r) { return isBefore(at, r.first); });
    if (row == space.begin()) return std::nullopt;
    --row;
    const bool isWithin = row->first.x == block.x && row->first.y == block.y &&
                          std::int64_t(block.z) - row->first.z < std::int64_t(row->blocks) * blockSide;
    return isWithin ? std::optional(row->region) : std::nullopt;
}

const BorderLeaf* FloodBorder::leafAt(const glm::ivec3& block) const {
    const auto leaf = std::lower_bound(leaves.begin(), leaves.end(), block,
                                       [](const BorderLeaf& l, const glm::ivec3& at) { return isBefore(l.first, at); });
    return leaf != leaves.end() && leaf->first == block ? &*leaf : nullptr;
}

FloodBorder emptyBorder(const BlockBox& own) {
    bool open = false;
    for (int axis = 0; axis < 3; ++axis) open |= own.first[axis] <= -unbounded || own.end[axis] >= unbounded;
    return {own, {std::uint8_t(open)}, {}, {}, true};
}

BlockMask borderVoxels(const BlockBox& own, const glm::ivec3& block) {
    BlockMask all;
    all.fill(~0ull);
    BlockMask mask{};
    for (int axis = 0; axis < 3; ++axis)
        for (int side = 0; side < 2; ++side) {
            const bool isAtBorder =
                side == 0 ? block[axis] == own.first[axis] : block[axis] + blockSide == own.end[axis];
            if (!isAtBorder) continue;
            // the voxels of the opposite face of the next block, moved to this one
            const BlockMask face = across(all, axis, 1 - side);
            for (std::size_t x = 0; x < blockSide; ++x) mask[x] |= face[x];
        }
    return mask;
}

void writeBorder(const std::filesystem::path& path, const FloodBorder& border, const std::string& distancesHash) {
    HashedRecordWriter record;
    record.add(std::vector<char>(distancesHash.begin(), distancesHash.end()));
    record.add(border.own);
    record.add(border.open);
    record.add(border.space);
    record.add(border.isEmpty);
    record.add(std::uint64_t(border.leaves.size()));
    for (const BorderLeaf& leaf : border.leaves) {
        record.add(leaf.first);
        record.add(leaf.parts);
        record.add(leaf.distances);
    }
    record.write(path);
}

FloodBorder readBorder(const std::filesystem::path& path, std::string* distancesHash) {
    HashedRecordReader record(path);
    const auto hash = record.values<char>();
    if (distancesHash) distancesHash->assign(hash.begin(), hash.end());
    FloodBorder border;
    border.own = record.value<BlockBox>();
    border.open = record.values<std::uint8_t>();
    border.space = record.values<SpaceRow>();
    border.isEmpty = record.value<bool>();
    const auto count = record.value<std::uint64_t>();
    for (std::uint64_t i = 0; i < count; ++i) {
        BorderLeaf leaf{record.value<glm::ivec3>(), {}, {}};
        leaf.parts = record.values<BorderLeaf::Part>();
        leaf.distances = record.values<float>();
        border.leaves.push_back(std::move(leaf));
    }
    return border;
}

void writeArrivals(const std::filesystem::path& path, const BorderArrivals& arrivals) {
    HashedRecordWriter record;
    record.add(arrivals.round);
    record.add(arrivals.all);
    record.write(path);
}

std::uint32_t readRound(const std::filesystem::path& path) {
    std::uint32_t round = 0;
    std::ifstream(path, std::ios::binary).read(reinterpret_cast<char*>(&round), sizeof round);
    return round;
}

BorderArrivals readArrivals(const std::filesystem::path& path) {
    HashedRecordReader record(path);
    BorderArrivals arrivals;
    arrivals.round = record.value<std::uint32_t>();
    arrivals.all = record.values<BorderArrival>();
    return arrivals;
}

}  // namespace bilayer::detail
