// SPDX-License-Identifier: Apache-2.0
// Jittered sampling. Each voxel draws its positions from a counter-based generator keyed by the seed, the voxel and the
// particle. The result is independent of the order of the voxels and the number of threads.
#include <bilayer/integration/fluid/particles.h>

#include <fmt/format.h>
#include <openvdb/points/PointAttribute.h>
#include <openvdb/points/PointConversion.h>
#include <openvdb/tools/Interpolation.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "collider/field/layout/interpolant.h"
#include "integration/fluid/detail/placement.h"
#include "integration/fluid/detail/regrid.h"
#include "sdf/base/hash.h"
#include "sdf/base/openvdb_points.h"
#include "sdf/base/progress.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::fluid {

using namespace detail;
using namespace bilayer::detail;

namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;

constexpr int maxPerVoxel = 1000;
constexpr double farOutside = 1;       // distance at a voxel's centre beyond which no part of it is inside [voxels]
constexpr int jitterBits = 21;         // bits of a coordinate: three fit into one hash
constexpr double maxBlocks = 1 << 28;  // of a body's box in a solver's voxels

std::uint64_t voxelKey(std::uint64_t seed, const Coord& voxel) {
    std::uint64_t key = splitMix64(seed);
    for (int axis = 0; axis < 3; ++axis) key = splitMix64(key ^ std::uint32_t(voxel[axis]));
    return key;
}

// A point in the unit cube around the origin.
Vec3d randomOffset(std::uint64_t bits) {
    const auto part = [&](int axis) {
        const std::uint64_t mask = (1u << jitterBits) - 1;
        return (double((bits >> (axis * jitterBits)) & mask) + 0.5) / (1u << jitterBits) - 0.5;
    };
    return {part(0), part(1), part(2)};
}

void require(const openvdb::math::Transform& voxels, const ParticleOptions& options) {
    if (!voxels.isLinear() || !voxels.hasUniformScale()) throw std::invalid_argument("the voxels must be cubes");
    if (options.perVoxel < 1 || options.perVoxel > maxPerVoxel)
        throw std::invalid_argument(fmt::format("perVoxel must be in 1..{}, not {}", maxPerVoxel, options.perVoxel));
}

// The leaves that may hold liquid, and the interior tiles cut into blocks of a leaf's size.
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

// Calls visit(point) for the positions of a voxel's particles, in voxels.
template <class Visit>
void visitVoxel(const Coord& voxel, const ParticleOptions& options, Visit&& visit) {
    const std::uint64_t key = voxelKey(options.seed, voxel);
    for (int i = 0; i < options.perVoxel; ++i)
        visit(voxel.asVec3d() + randomOffset(splitMix64(key + std::uint64_t(i))));
}

// Rounds to single precision. Not inlined: GCC 12 would leave out the rounding in values computed from it (x and y at
// once, as a vector of two).
[[gnu::noinline]] glm::vec3 toWorld(const openvdb::math::Transform& voxels, const Vec3d& point) {
    const Vec3d world = voxels.indexToWorld(point);
    return {float(world.x()), float(world.y()), float(world.z())};
}

// Collects the results of fill(origin, positions) for each block, in block order.
template <class Fill>
Particles gather(const std::vector<Coord>& origins, const ParticleOptions& options, Fill&& fill) {
    std::vector<std::vector<glm::vec3>> parts(origins.size());
    Progress progress(options.progress);
    progress.begin(origins.size());
    tbb::parallel_for(std::size_t(0), origins.size(), [&](std::size_t i) {
        fill(origins[i], parts[i]);
        progress.advance();
    });
    progress.finish();
    std::size_t count = 0;
    for (const auto& part : parts) count += part.size();
    Particles all;
    all.positions.reserve(count);
    for (const auto& part : parts) all.positions.insert(all.positions.end(), part.begin(), part.end());
    if (!options.velocity) return all;
    all.velocities.resize(count);
    tbb::parallel_for(std::size_t(0), count,
                      [&](std::size_t i) { all.velocities[i] = options.velocity(all.positions[i]); });
    return all;
}

// A body in a solver's voxels.
class Body {
  public:
    Body(const Field& field, const Placement& placement, const openvdb::math::Transform& voxels)
        : field_(field),
          placement_(placement),
          voxels_(voxels),
          inverseRotation_(glm::conjugate(glm::normalize(placement.pose.rotation))),
          // maximum distance of a voxel's points from its centre, in the body's own coordinates
          reach_(0.5f * std::sqrt(3.f) * float(voxels.voxelSize()[0]) /
                 std::min({placement.scale.x, placement.scale.y, placement.scale.z})),
          error_(maxInterpolationError * field.voxelSize()) {}

    // The blocks of voxels that overlap the body's box.
    std::vector<Coord> blocks() const {
        Vec3d lower(std::numeric_limits<double>::max()), upper(-lower);
        const Bounds& box = field_.bounds();
        for (int corner = 0; corner < 8; ++corner) {
            const glm::dvec3 p =
                placement_.toWorld({corner & 4 ? box.upper.x : box.lower.x, corner & 2 ? box.upper.y : box.lower.y,
                                    corner & 1 ? box.upper.z : box.lower.z});
            const Vec3d index = voxels_.worldToIndex({p.x, p.y, p.z});
            lower = openvdb::math::minComponent(lower, index);
            upper = openvdb::math::maxComponent(upper, index);
        }
        const Vec3d size = (upper - lower) / double(blockSide) + Vec3d(2);
        if (!(size.x() * size.y() * size.z() <= maxBlocks && std::max(upper.length(), lower.length()) < maxIndex))
            throw std::invalid_argument("the body is out of range of these voxels");
        const Coord from = Coord::floor(lower - Vec3d(1)) & ~(blockSide - 1), to = Coord::ceil(upper + Vec3d(1));
        std::vector<Coord> origins;
        for (int x = from.x(); x <= to.x(); x += blockSide)
            for (int y = from.y(); y <= to.y(); y += blockSide)
                for (int z = from.z(); z <= to.z(); z += blockSide)
                    if (reaches({x, y, z}, blockSide)) origins.emplace_back(x, y, z);
        return origins;
    }

    // Whether a cube of voxels may hold a point of the body.
    bool reaches(const Coord& origin, int side) const {
        const Vec3d centre = origin.asVec3d() + Vec3d(0.5 * (side - 1));
        const Vec3d world = voxels_.indexToWorld(centre);
        const float distance = field_.distance(toBody({world.x(), world.y(), world.z()}));
        const float reach = float(side) * reach_;
        // with a mesh, the inside is the mesh's, and the samples may differ from it; without one it is that of the
        // samples
        return distance <= (field_.mesh() ? reach + error_ : maxInterpolantSlope * reach);
    }

    bool contains(const glm::vec3& point) const { return field_.inside(toBody(point)); }

  private:
    glm::vec3 toBody(const glm::dvec3& point) const {
        const glm::dvec3 offset = point - glm::dvec3(placement_.pose.position);
        return glm::vec3((inverseRotation_ * offset) / glm::dvec3(placement_.scale));
    }

    const Field& field_;
    const Placement& placement_;
    const openvdb::math::Transform& voxels_;
    glm::dquat inverseRotation_;
    float reach_, error_;
};

}  // namespace

Particles particles(const FloatGrid& liquid, const ParticleOptions& options) {
    if (liquid.getGridClass() != openvdb::GRID_LEVEL_SET)
        throw std::invalid_argument("the liquid's grid is no level set");
    require(liquid.transform(), options);
    const double limit = farOutside * liquid.voxelSize()[0];
    return gather(blocks(liquid), options, [&](const Coord& origin, std::vector<glm::vec3>& found) {
        const auto values = liquid.getConstAccessor();
        for (const Coord& voxel : CoordBBox::createCube(origin, blockSide)) {
            if (!(values.getValue(voxel) < limit)) continue;
            visitVoxel(voxel, options, [&](const Vec3d& point) {
                const glm::vec3 p = toWorld(liquid.transform(), point);
                if (openvdb::tools::BoxSampler::sample(values, liquid.worldToIndex({p.x, p.y, p.z})) < 0)
                    found.push_back(p);
            });
        }
    });
}

Particles particles(const Field& field, const Placement& placement, const openvdb::math::Transform& voxels,
                    const ParticleOptions& options) {
    checkPlacement(placement);
    require(voxels, options);
    const Body body(field, placement, voxels);
    return gather(body.blocks(), options, [&](const Coord& origin, std::vector<glm::vec3>& found) {
        for (const Coord& voxel : CoordBBox::createCube(origin, blockSide)) {
            if (!body.reaches(voxel, 1)) continue;
            visitVoxel(voxel, options, [&](const Vec3d& point) {
                if (const glm::vec3 p = toWorld(voxels, point); body.contains(p)) found.push_back(p);
            });
        }
    });
}

openvdb::points::PointDataGrid::Ptr particleGrid(const Particles& particles, const openvdb::math::Transform& voxels) {
    namespace points = openvdb::points;
    openvdb::initialize();
    std::vector<openvdb::Vec3f> positions, velocities;
    for (const glm::vec3& p : particles.positions) positions.emplace_back(p.x, p.y, p.z);
    for (const glm::vec3& v : particles.velocities) velocities.emplace_back(v.x, v.y, v.z);
    const points::PointAttributeVector<openvdb::Vec3f> wrapped(positions);
    const auto index = openvdb::tools::createPointIndexGrid<openvdb::tools::PointIndexGrid>(wrapped, voxels);
    const auto grid = points::createPointDataGrid<points::NullCodec, points::PointDataGrid>(*index, wrapped, voxels);
    if (!velocities.empty()) {
        points::appendAttribute<openvdb::Vec3f>(grid->tree(), "v");
        points::populateAttribute(grid->tree(), index->tree(), "v",
                                  points::PointAttributeVector<openvdb::Vec3f>(velocities));
    }
    grid->setName("particles");
    return grid;
}

}  // namespace bilayer::fluid
