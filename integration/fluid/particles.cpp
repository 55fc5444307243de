// Jittered sampling: each voxel draws its positions from a counter-based generator keyed by the seed, the voxel and the
// particle, so that neither the order of the voxels nor the number of threads matters.
#include "integration/fluid/particles.h"

#include <openvdb/points/PointConversion.h>
#include <openvdb/tools/Interpolation.h>
#include <tbb/parallel_for.h>

#include <stdexcept>

namespace bilayer::fluid {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;

constexpr int blockSide = 8;  // [voxels] a task: a leaf
constexpr int maxPerVoxel = 1000;
constexpr double farOutside = 1;  // [voxels] of distance at a centre beyond which no part of the voxel is inside
constexpr int jitterBits = 21;    // a coordinate: three fit into one hash

// S. Vigna's splitmix64: every bit of the output depends on every bit of the input.
std::uint64_t mix(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

std::uint64_t voxelKey(std::uint64_t seed, const Coord& voxel) {
    std::uint64_t key = mix(seed);
    for (int axis = 0; axis < 3; ++axis) key = mix(key ^ std::uint32_t(voxel[axis]));
    return key;
}

// A point of the cube of one voxel around the origin.
Vec3d jitter(std::uint64_t bits) {
    const auto part = [&](int axis) {
        const std::uint64_t mask = (1u << jitterBits) - 1;
        return (double((bits >> (axis * jitterBits)) & mask) + 0.5) / (1u << jitterBits) - 0.5;
    };
    return {part(0), part(1), part(2)};
}

void require(const FloatGrid& liquid, const ParticleOptions& options) {
    if (liquid.getGridClass() != openvdb::GRID_LEVEL_SET)
        throw std::invalid_argument("particles: the liquid's grid is no level set");
    if (!liquid.transform().isLinear() || !liquid.hasUniformVoxels())
        throw std::invalid_argument("particles: the liquid's voxels are no cubes");
    if (options.perVoxel < 1 || options.perVoxel > maxPerVoxel)
        throw std::invalid_argument("particles: perVoxel must be in 1..1000");
}

// The blocks that may hold liquid: leaves, then the interior tiles cut into pieces of a leaf's size.
std::vector<Coord> blocks(const FloatGrid& liquid) {
    std::vector<Coord> origins;
    for (auto leaf = liquid.tree().cbeginLeaf(); leaf; ++leaf) origins.push_back(leaf->origin());
    auto tile = liquid.tree().cbeginValueAll();
    tile.setMaxDepth(openvdb::FloatTree::DEPTH - 2);
    for (; tile; ++tile) {
        if (!(tile.getValue() < 0)) continue;
        const CoordBBox box = tile.getBoundingBox();
        for (int x = box.min().x(); x <= box.max().x(); x += blockSide)
            for (int y = box.min().y(); y <= box.max().y(); y += blockSide)
                for (int z = box.min().z(); z <= box.max().z(); z += blockSide) origins.emplace_back(x, y, z);
    }
    return origins;
}

void fillVoxel(const FloatGrid& liquid, const FloatGrid::ConstAccessor& values, const Coord& voxel,
               const ParticleOptions& options, std::vector<glm::vec3>& found) {
    const std::uint64_t key = voxelKey(options.seed, voxel);
    for (int i = 0; i < options.perVoxel; ++i) {
        const Vec3d point = voxel.asVec3d() + jitter(mix(key + std::uint64_t(i)));
        if (!(openvdb::tools::BoxSampler::sample(values, point) < 0)) continue;
        const Vec3d world = liquid.indexToWorld(point);
        found.emplace_back(float(world.x()), float(world.y()), float(world.z()));
    }
}

void fillBlock(const FloatGrid& liquid, const Coord& origin, const ParticleOptions& options,
               std::vector<glm::vec3>& found) {
    const auto values = liquid.getConstAccessor();
    const double limit = farOutside * liquid.voxelSize()[0];
    for (const Coord& voxel : CoordBBox::createCube(origin, blockSide))
        if (values.getValue(voxel) < limit) fillVoxel(liquid, values, voxel, options, found);
}

}  // namespace

std::vector<glm::vec3> particles(const FloatGrid& liquid, const ParticleOptions& options) {
    require(liquid, options);
    const std::vector<Coord> origins = blocks(liquid);
    std::vector<std::vector<glm::vec3>> parts(origins.size());
    tbb::parallel_for(std::size_t(0), origins.size(),
                      [&](std::size_t i) { fillBlock(liquid, origins[i], options, parts[i]); });
    std::size_t count = 0;
    for (const auto& part : parts) count += part.size();
    std::vector<glm::vec3> all;
    all.reserve(count);
    for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
    return all;
}

openvdb::points::PointDataGrid::Ptr particleGrid(const FloatGrid& liquid, const ParticleOptions& options) {
    namespace points = openvdb::points;
    openvdb::initialize();
    std::vector<openvdb::Vec3f> positions;
    for (const glm::vec3& p : particles(liquid, options)) positions.emplace_back(p.x, p.y, p.z);
    const auto grid =
        points::createPointDataGrid<points::NullCodec, points::PointDataGrid>(positions, liquid.transform());
    grid->setName("particles");
    return grid;
}

}  // namespace bilayer::fluid
