// A level set laid out for queries: each leaf becomes a block of 9^3 floats, so that all eight voxels around a point
// lie in one block, and a dense directory over the blocks' box tells which block a point is in, or on which side.
// Beside the band, distances are bounded from below by a coarse exact distance transform of where the surface can be.
#include "collider/field.h"

#include <oneapi/tbb/parallel_for.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>

#include "sdf/grids.h"

namespace bilayer {
namespace {

using openvdb::Coord;
using openvdb::FloatTree;
using Accessor = openvdb::FloatGrid::ConstAccessor;

constexpr int side = 8;           // voxels along a block: an OpenVDB leaf
constexpr int stride = side + 1;  // with the apron that completes the last cells
constexpr int blockFloats = stride * stride * stride;
constexpr std::int64_t mostBlocks = 1 << 26;  // of the box: 4.3 GiB at 68 bytes each
constexpr int partSide = Clearance::partSide;
constexpr int mostParts = 16;                       // away from the surface: farther away, bounds grow no more
constexpr float cellDiagonal = 1.7320508f;          // [voxels]; also the Lipschitz bound of the trilinear interpolant
constexpr float nearSurface = 0.5f * cellDiagonal;  // some voxel of a cell that the surface meets is as near [voxels]
constexpr double smallestStep = 0.1;   // of a ray [voxels]: bounds the steps of rays that graze the surface
constexpr double rayTolerance = 1e-5;  // [voxels]
constexpr float infinity = std::numeric_limits<float>::infinity();

// Entries of the directory for blocks that lie beside the band altogether.
constexpr std::int32_t emptyOutside = -1, emptyInside = -2;

// The eight voxels around a point, the last axis fastest, and where the point lies between them.
struct Cell {
    std::array<float, 8> values;
    glm::vec3 fraction;
};

float mix(float a, float b, float t) {
    return a + t * (b - a);
}

float interpolate(const Cell& cell) {
    const auto& [v, f] = cell;
    const float low = mix(mix(v[0], v[1], f.z), mix(v[2], v[3], f.z), f.y);
    const float high = mix(mix(v[4], v[5], f.z), mix(v[6], v[7], f.z), f.y);
    return mix(low, high, f.x);
}

// The gradient of interpolate() [distance a voxel].
glm::vec3 interpolantGradient(const Cell& cell) {
    const auto& [v, f] = cell;
    const float x0y0 = mix(v[0], v[1], f.z), x0y1 = mix(v[2], v[3], f.z);
    const float x1y0 = mix(v[4], v[5], f.z), x1y1 = mix(v[6], v[7], f.z);
    return {mix(x1y0, x1y1, f.y) - mix(x0y0, x0y1, f.y), mix(x0y1 - x0y0, x1y1 - x1y0, f.x),
            mix(mix(v[1] - v[0], v[3] - v[2], f.y), mix(v[5] - v[4], v[7] - v[6], f.y), f.x)};
}

// What the interpolant of values that go no faster than the distance itself may be off by: the mean way to the eight
// voxels, by their weights, which is at most the root of its mean square [voxels].
float interpolationError(const glm::vec3& fraction) {
    const glm::vec3 spread = fraction * (1.f - fraction);
    return std::sqrt(spread.x + spread.y + spread.z);
}

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

}  // namespace

struct Field::Data {
    glm::dvec3 origin;  // of the directory: its first voxel [m]
    glm::ivec3 blocks;  // of the directory, along each axis
    std::vector<std::int32_t> directory;
    std::vector<Clearance::Part> clearances;
    std::unique_ptr<float[]> values;
    std::size_t stored = 0;
    double voxel;     // its edge [m], unrounded: far from the origin it counts
    double perMetre;  // voxels
    float voxelSize, exteriorWidth, interiorWidth;
    Bounds bounds;

    explicit Data(const LevelSet& levelSet);

    void layOut(const FloatTree& tree, const std::vector<Coord>& origins, const Coord& first);
    void measureClearances();

    // Points are in voxels from the directory's first one, in double: exact enough however far the mesh is from the
    // origin.
    glm::dvec3 toLocal(const glm::vec3& point) const { return (glm::dvec3(point) - origin) * perMetre; }
    glm::vec3 toWorld(const glm::dvec3& local) const { return glm::vec3(local * voxel + origin); }
    glm::dvec3 extent() const { return double(side) * glm::dvec3(blocks); }

    glm::ivec3 parts() const { return side / partSide * blocks; }

    Sample sample(const glm::dvec3& local, float gradientReach) const;
    float distance(const glm::dvec3& local) const { return sample(local, -infinity).distance; }
    float boundOutside(const glm::dvec3& local) const;
    float boundInEmptyBlock(bool inside, const glm::dvec3& local, const glm::ivec3& block) const;
    Clearance clearance() const { return {clearances.data(), parts()}; }
    // [voxels]
    float clearanceAt(const glm::dvec3& local) const {
        return float(partSide) * clearance().around(glm::vec3(local) / float(partSide));
    }
    double crossing(const glm::dvec3& start, const glm::dvec3& direction, double outside, double inside) const;
    std::optional<double> trace(const glm::dvec3& start, const glm::dvec3& direction, double length) const;
};

Field::Data::Data(const LevelSet& levelSet)
    : voxel(levelSet.grids().distance->voxelSize()[0]),
      perMetre(1 / voxel),
      voxelSize(levelSet.voxelSize()),
      exteriorWidth(levelSet.exteriorWidth()),
      interiorWidth(levelSet.interiorWidth()) {
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
    const double count = double(blocks.x) * blocks.y * blocks.z;
    if (count > double(mostBlocks))
        throw std::invalid_argument("field: the bounds hold more than 2^26 blocks of 8^3 voxels: take larger voxels");
    layOut(grid.tree(), origins, first);
    measureClearances();

    const auto world = [&](const Coord& voxel) {
        const openvdb::Vec3d p = grid.indexToWorld(voxel);
        return glm::dvec3(p.x(), p.y(), p.z());
    };
    origin = world(first);
    const openvdb::CoordBBox active = grid.evalActiveVoxelBoundingBox();
    bounds = {glm::vec3(world(active.min())), glm::vec3(world(active.max()))};
}

void Field::Data::layOut(const FloatTree& tree, const std::vector<Coord>& origins, const Coord& first) {
    const auto entryOf = [&](const Coord& voxel) -> std::int32_t& {
        const Coord block = (voxel - first) >> 3;
        return directory[(std::size_t(block.x()) * blocks.y + block.y()) * blocks.z + block.z()];
    };
    directory.resize(std::size_t(blocks.x) * blocks.y * blocks.z);
    tbb::parallel_for(0, blocks.x, [&](int x) {
        const Accessor accessor(tree);
        for (int y = 0; y < blocks.y; ++y)
            for (int z = 0; z < blocks.z; ++z) {
                const Coord block = first.offsetBy(side * x, side * y, side * z);
                entryOf(block) = accessor.getValue(block) < 0 ? emptyInside : emptyOutside;
            }
    });

    stored = origins.size();
    values = std::make_unique_for_overwrite<float[]>(stored * blockFloats);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, stored), [&](const auto& range) {
        const Accessor accessor(tree);
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            entryOf(origins[i]) = std::int32_t(i);
            copyBlock(accessor, origins[i], values.get() + i * blockFloats);
        }
    });
}

void Field::Data::measureClearances() {
    // a narrower band does not tell where the surface is
    const bool known = std::min(exteriorWidth, interiorWidth) >= nearSurface * voxelSize;
    const float far = known ? float(mostParts * mostParts) : 0.f;
    const glm::ivec3 size = parts();
    clearances.resize(std::size_t(size.x) * size.y * size.z);
    const auto partsOf = [&](const glm::ivec3& block, auto&& measure) {
        for (int i = 0; i < 8; ++i) {
            const glm::ivec3 inBlock(i >> 2, i >> 1 & 1, i & 1), part = 2 * block + inBlock;
            clearances[(std::size_t(part.x) * size.y + part.y) * size.z + part.z] = measure(partSide * inBlock);
        }
    };
    tbb::parallel_for(0, blocks.x, [&](int x) {
        for (int y = 0; y < blocks.y; ++y)
            for (int z = 0; z < blocks.z; ++z) {
                const std::int32_t entry = directory[(std::size_t(x) * blocks.y + y) * blocks.z + z];
                partsOf({x, y, z}, [&](const glm::ivec3& corner) -> Clearance::Part {
                    if (entry < 0) return {far, entry == emptyInside ? -interiorWidth : exteriorWidth};
                    const auto [least, nearest] = leastOf(values.get() + std::size_t(entry) * blockFloats +
                                                          (corner.x * stride + corner.y) * stride + corner.z);
                    return {nearest <= nearSurface * voxelSize ? 0 : far, least};
                });
            }
    });
    transform(clearances, size);
}

// With the gradient where the distance is no more than some length.
Sample Field::Data::sample(const glm::dvec3& local, float gradientReach) const {
    // compared before any conversion to integers, so that NaN and huge coordinates end here
    const glm::dvec3 size = extent();
    const bool within =
        local.x >= 0 && local.y >= 0 && local.z >= 0 && local.x < size.x && local.y < size.y && local.z < size.z;
    if (!within) return {.distance = boundOutside(local)};

    const glm::ivec3 voxel(local), block = voxel >> 3, inBlock = voxel & 7;
    const std::int32_t entry = directory[(std::size_t(block.x) * blocks.y + block.y) * blocks.z + block.z];
    if (entry < 0) return {.distance = boundInEmptyBlock(entry == emptyInside, local, block)};

    const float* v =
        values.get() + std::size_t(entry) * blockFloats + (inBlock.x * stride + inBlock.y) * stride + inBlock.z;
    constexpr int x = stride * stride, y = stride;
    const Cell cell{{v[0], v[1], v[y], v[y + 1], v[x], v[x + 1], v[x + y], v[x + y + 1]},
                    glm::vec3(local - glm::dvec3(voxel))};
    const float distance = interpolate(cell);
    float low = cell.values[0], high = low;
    for (const float value : cell.values) {
        low = std::min(low, value);
        high = std::max(high, value);
    }
    const bool inBand = low > -interiorWidth && high < exteriorWidth;
    if (!inBand) {
        // one of the voxels is beyond the band
        const float besideBand = (distance < 0 ? interiorWidth : exteriorWidth) - cellDiagonal * voxelSize;
        const float between = std::abs(distance) - voxelSize * interpolationError(cell.fraction);
        const float bound = std::max({0.f, besideBand, between, voxelSize * clearanceAt(local)});
        return {.distance = std::copysign(bound, distance)};
    }
    if (!(distance <= gradientReach)) return {.distance = distance, .inBand = true};
    return {.distance = distance, .gradient = interpolantGradient(cell) * float(perMetre), .inBand = true};
}

// Who comes from outside the directory's box has that way to go, and is then no more than a cell's diagonal from a
// voxel beyond the band.
float Field::Data::boundOutside(const glm::dvec3& local) const {
    const double way = glm::distance(local, glm::clamp(local, glm::dvec3(0), extent()));
    if (!std::isfinite(way)) return infinity;
    return std::max(0.f, float(way - double(cellDiagonal)) * voxelSize + exteriorWidth);
}

// The nearest voxel of the block itself is beyond the band. It is half a cell's diagonal away, or a whole one where the
// cell ends in another block.
float Field::Data::boundInEmptyBlock(bool inside, const glm::dvec3& local, const glm::ivec3& block) const {
    const glm::vec3 inBlock(local - glm::dvec3(side * block));
    const bool ownCell = std::max({inBlock.x, inBlock.y, inBlock.z}) <= float(side - 1);
    const float width = inside ? interiorWidth : exteriorWidth;
    const float besideBand = width - (ownCell ? 0.5f : 1.f) * cellDiagonal * voxelSize;
    const float bound = std::max({0.f, besideBand, voxelSize * clearanceAt(local)});
    return inside ? -bound : bound;
}

// Where between two lengths along a ray the interpolant changes its sign.
double Field::Data::crossing(const glm::dvec3& start, const glm::dvec3& direction, double outside,
                             double inside) const {
    while (inside - outside > rayTolerance) {
        const double middle = 0.5 * (outside + inside);
        (distance(start + middle * direction) < 0 ? inside : outside) = middle;
    }
    return inside;
}

// Sphere tracing along a unit direction [voxels]. In the band the interpolant may be steeper than 1, by sqrt(3) at
// most.
std::optional<double> Field::Data::trace(const glm::dvec3& start, const glm::dvec3& direction, double length) const {
    double outside = 0;
    for (double along = 0;;) {
        const Sample here = sample(start + along * direction, -infinity);
        if (here.distance < 0) return crossing(start, direction, outside, along);
        if (along >= length) return std::nullopt;
        outside = along;
        const double way = here.distance / voxel;
        along = std::min(length, along + std::max(here.inBand ? way / cellDiagonal : way, smallestStep));
    }
}

Field::Field(const LevelSet& levelSet) : data_(std::make_shared<Data>(levelSet)) {}

Sample Field::sample(const glm::vec3& point) const noexcept {
    return data_->sample(data_->toLocal(point), infinity);
}

Clearance Field::clearance() const noexcept {
    return data_->clearance();
}

glm::dvec3 Field::origin() const noexcept {
    return data_->origin;
}

Sample Field::sampleWithin(const glm::vec3& point, float reach) const noexcept {
    return data_->sample(data_->toLocal(point), reach);
}

float Field::distance(const glm::vec3& point) const noexcept {
    return data_->distance(data_->toLocal(point));
}

std::optional<RayHit> Field::raycast(const glm::vec3& origin, const glm::vec3& direction,
                                     float maxDistance) const noexcept {
    const glm::dvec3 from = data_->toLocal(origin);
    const double directionLength = glm::length(glm::dvec3(direction));
    const bool valid = std::isfinite(from.x + from.y + from.z) && std::isfinite(directionLength) &&
                       directionLength > 0 && maxDistance >= 0;
    if (!valid) return std::nullopt;
    const glm::dvec3 unit = glm::dvec3(direction) / directionLength;

    // clipped to the directory's box: no surface lies outside, and the steps are bounded by its size
    const glm::dvec3 size = data_->extent();
    double enter = 0, leave = maxDistance / data_->voxel;
    for (int axis = 0; axis < 3; ++axis) {
        if (unit[axis] == 0 && (from[axis] < 0 || from[axis] > size[axis])) return std::nullopt;
        if (unit[axis] == 0) continue;
        const double low = -from[axis] / unit[axis], high = (size[axis] - from[axis]) / unit[axis];
        enter = std::max(enter, std::min(low, high));
        leave = std::min(leave, std::max(low, high));
    }
    if (enter > leave) return std::nullopt;
    const glm::dvec3 start = glm::clamp(from + enter * unit, glm::dvec3(0), size);
    const auto along = data_->trace(start, unit, std::min(leave - enter, glm::length(size)));
    if (!along) return std::nullopt;

    const glm::dvec3 hit = start + *along * unit;
    const glm::vec3 gradient = data_->sample(hit, infinity).gradient;
    const float steepness = glm::length(gradient);
    return RayHit{.distance = float((enter + *along) * data_->voxel),
                  .position = data_->toWorld(hit),
                  .normal = steepness > 0 ? gradient / steepness : glm::vec3(-unit)};
}

float Field::voxelSize() const noexcept {
    return data_->voxelSize;
}
float Field::exteriorWidth() const noexcept {
    return data_->exteriorWidth;
}
float Field::interiorWidth() const noexcept {
    return data_->interiorWidth;
}
const Bounds& Field::bounds() const noexcept {
    return data_->bounds;
}

std::size_t Field::memoryBytes() const noexcept {
    return sizeof(Data) + data_->directory.size() * sizeof(std::int32_t) +
           data_->clearances.size() * sizeof(Clearance::Part) + data_->stored * blockFloats * sizeof(float);
}

}  // namespace bilayer
