// Beside the band, distances are bounded from below by a coarse exact distance transform of where the surface can be.
#include "sdf/field_layout.h"

#include <oneapi/tbb/parallel_for.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "sdf/grids.h"

namespace bilayer {
namespace {

using openvdb::Coord;
using openvdb::FloatTree;
using Accessor = openvdb::FloatGrid::ConstAccessor;

constexpr int side = FieldLayout::side, stride = FieldLayout::stride;
constexpr std::int64_t mostBlocks = 1 << 26;  // of the box: 4.3 GiB at 68 bytes each
constexpr int partSide = Clearance::partSide;
constexpr int mostParts = 16;                     // away from the surface: farther away, bounds grow no more
constexpr float nearSurface = 0.5f * 1.7320508f;  // some voxel of a cell that the surface meets is as near [voxels]
constexpr float infinity = std::numeric_limits<float>::infinity();

// A leaf needs a block if it has voxels of the band, or lies on both sides of it (where the band is below one voxel).
bool needsBlock(const FloatTree::LeafNodeType& leaf) {
    if (!leaf.getValueMask().isOff()) return true;
    const auto [low, high] = std::minmax_element(leaf.buffer().data(), leaf.buffer().data() + side * side * side);
    return (*low < 0) != (*high < 0);
}

// Copies a leaf, and the first layer of voxels of its seven upper neighbours.
void copyBlock(const Accessor& tree, const Coord& origin, float* block) {
    for (int part = 0; part < 8; ++part) {
        const glm::ivec3 first = side * glm::ivec3(part >> 2, part >> 1 & 1, part & 1);
        const glm::ivec3 count = glm::min(glm::ivec3(side), stride - first);
        const Coord corner = origin.offsetBy(first.x, first.y, first.z);
        const auto* leaf = tree.probeConstLeaf(corner);
        const float tile = leaf ? 0.f : tree.getValue(corner);
        for (int x = 0; x < count.x; ++x)
            for (int y = 0; y < count.y; ++y) {
                float* row = block + ((first.x + x) * stride + first.y + y) * stride + first.z;
                if (leaf)
                    std::copy_n(leaf->buffer().data() + (x * side + y) * side, count.z, row);
                else
                    std::fill_n(row, count.z, tile);
            }
    }
}

// The least value of the voxels around a part's cells, and of their magnitudes.
std::pair<float, float> leastOf(const float* part) {
    float least = infinity, nearest = infinity;
    for (int x = 0; x <= partSide; ++x)
        for (int y = 0; y <= partSide; ++y)
            for (int z = 0; z <= partSide; ++z) {
                const float value = part[(x * stride + y) * stride + z];
                least = std::min(least, value);
                nearest = std::min(nearest, std::abs(value));
            }
    return {least, nearest};
}

// Along one line of parts: the least squared way from each one's centre to a part anywhere on it, plus what that part
// holds already (as P. Felzenszwalb, D. Huttenlocher, "Distance transforms of sampled functions", 2012, but to the
// faces of parts) [parts^2].
void transformLine(Clearance::Part* line, std::size_t step, int count, std::vector<float>& before) {
    before.resize(std::size_t(count));
    for (int i = 0; i < count; ++i) before[i] = line[i * step].centre;
    for (int i = 0; i < count; ++i) {
        float best = before[i];
        const int reach = std::min(mostParts, std::max(i, count - 1 - i));
        for (int d = 1; d <= reach; ++d) {
            const float way = (float(d) - 0.5f) * (float(d) - 0.5f);
            if (way >= best) break;
            if (i >= d) best = std::min(best, way + before[i - d]);
            if (i + d < count) best = std::min(best, way + before[i + d]);
        }
        line[i * step].centre = best;
    }
}

// From 0 for parts that meet the surface, and much for others, to the ways from their centres to the nearest such part:
// axis by axis, since a squared way is a sum over the axes. Negative where all is inside.
void transform(std::vector<Clearance::Part>& parts, const glm::ivec3& size) {
    const std::size_t step[] = {std::size_t(size.y) * size.z, std::size_t(size.z), 1};
    for (int axis = 2; axis >= 0; --axis) {
        const int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
        tbb::parallel_for(0, size[u], [&](int i) {
            std::vector<float> before;
            for (int j = 0; j < size[v]; ++j)
                transformLine(parts.data() + i * step[u] + j * step[v], step[axis], size[axis], before);
        });
    }
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, parts.size()), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i)
            parts[i].centre = std::copysign(std::sqrt(parts[i].centre), parts[i].least);
    });
}

// Fills the directory and the blocks.
void layOut(FieldLayout& field, const FloatTree& tree, const std::vector<Coord>& origins, const Coord& first) {
    const auto entryOf = [&](const Coord& voxel) -> std::int32_t& {
        const Coord block = (voxel - first) >> 3;
        return field.directory[field.entryOf({block.x(), block.y(), block.z()})];
    };
    field.directory.resize(field.entries());
    tbb::parallel_for(0, field.blocks.x, [&](int x) {
        const Accessor accessor(tree);
        for (int y = 0; y < field.blocks.y; ++y)
            for (int z = 0; z < field.blocks.z; ++z) {
                const Coord block = first.offsetBy(side * x, side * y, side * z);
                entryOf(block) = accessor.getValue(block) < 0 ? FieldLayout::emptyInside : FieldLayout::emptyOutside;
            }
    });

    field.stored = origins.size();
    field.values = std::make_unique_for_overwrite<float[]>(field.stored * FieldLayout::blockFloats);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, field.stored), [&](const auto& range) {
        const Accessor accessor(tree);
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            entryOf(origins[i]) = std::int32_t(i);
            copyBlock(accessor, origins[i], field.values.get() + i * FieldLayout::blockFloats);
        }
    });
}

void measureClearances(FieldLayout& field) {
    const float far = field.farthestClearance();
    const glm::ivec3 size = field.parts();
    field.clearances.resize(std::size_t(size.x) * size.y * size.z);
    const auto partsOf = [&](const glm::ivec3& block, auto&& measure) {
        for (int i = 0; i < 8; ++i) {
            const glm::ivec3 inBlock(i >> 2, i >> 1 & 1, i & 1), part = 2 * block + inBlock;
            field.clearances[(std::size_t(part.x) * size.y + part.y) * size.z + part.z] = measure(partSide * inBlock);
        }
    };
    tbb::parallel_for(0, field.blocks.x, [&](int x) {
        for (int y = 0; y < field.blocks.y; ++y)
            for (int z = 0; z < field.blocks.z; ++z) {
                const std::int32_t entry = field.directory[field.entryOf({x, y, z})];
                partsOf({x, y, z}, [&](const glm::ivec3& corner) -> Clearance::Part {
                    if (entry < 0)
                        return {far, entry == FieldLayout::emptyInside ? -field.interiorWidth : field.exteriorWidth};
                    const auto [least, nearest] =
                        leastOf(field.values.get() + std::size_t(entry) * FieldLayout::blockFloats +
                                (corner.x * stride + corner.y) * stride + corner.z);
                    return {nearest <= nearSurface * field.voxelSize ? 0 : far, least};
                });
            }
    });
    transform(field.clearances, size);
}

}  // namespace

void FieldFrame::requireSize() const {
    if (double(blocks.x) * blocks.y * blocks.z > double(mostBlocks))
        throw std::invalid_argument("field: the bounds hold more than 2^26 blocks of 8^3 voxels: take larger voxels");
}

float FieldFrame::farthestClearance() const {
    // a narrower band does not tell where the surface is
    const bool known = std::min(exteriorWidth, interiorWidth) >= nearSurface * voxelSize;
    return known ? float(mostParts * mostParts) : 0.f;
}

FieldLayout::FieldLayout(const LevelSet& levelSet)
    : FieldFrame{.voxel = levelSet.grids().distance->voxelSize()[0],
                 .voxelSize = levelSet.voxelSize(),
                 .exteriorWidth = levelSet.exteriorWidth(),
                 .interiorWidth = levelSet.interiorWidth()} {
    perMetre = 1 / voxel;
    const openvdb::FloatGrid& grid = *levelSet.grids().distance;
    const openvdb::tree::LeafManager<const FloatTree> leaves(grid.tree());
    std::vector<Coord> origins;
    openvdb::CoordBBox box;
    for (std::size_t i = 0; i < leaves.leafCount(); ++i)
        if (needsBlock(leaves.leaf(i))) {
            origins.push_back(leaves.leaf(i).origin());
            box.expand(origins.back());
        }
    if (origins.empty()) throw std::invalid_argument("field: the level set has no voxel in its band");

    const Coord first = box.min();
    blocks = glm::ivec3((box.max() - first).x(), (box.max() - first).y(), (box.max() - first).z()) / side + 1;
    requireSize();
    layOut(*this, grid.tree(), origins, first);
    measureClearances(*this);

    const auto world = [&](const Coord& voxel) {
        const openvdb::Vec3d p = grid.indexToWorld(voxel);
        return glm::dvec3(p.x(), p.y(), p.z());
    };
    origin = world(first);
    const openvdb::CoordBBox active = grid.evalActiveVoxelBoundingBox();
    bounds = {glm::vec3(world(active.min())), glm::vec3(world(active.max()))};
}

}  // namespace bilayer
