// Seeding in three steps: the field is sampled at the liquid's voxels, the two level sets are combined by OpenVDB's
// CSG, and the result is mended until it is a level set in the sense of openvdb::tools::checkLevelSet. All work is done
// on a copy.
#include "integration/fluid/seed.h"

#include <openvdb/tools/ChangeBackground.h>
#include <openvdb/tools/Composite.h>
#include <openvdb/tools/Diagnostics.h>
#include <openvdb/tools/FastSweeping.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tree/LeafManager.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "integration/fluid/mend.h"
#include "sdf/grids.h"

namespace bilayer::fluid {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::Vec3d;
using Leaf = FloatTree::LeafNodeType;

constexpr float minHalfWidth = 3;       // [voxels], what checkLevelSet asks for
constexpr float rounding = 1e-5f;       // of a half width that is a whole number of voxels but for its last bits
constexpr float unitTolerance = 1e-3f;  // by which a rotation's length may differ from 1: a float product's drift
constexpr float minFieldWidth = 1;  // [field voxels] either side: less does not tell where the surface crosses an edge
constexpr double crossingSlack = 0.25;   // [liquid voxels] that a known voxel may lie beyond the edge that is crossed
constexpr double maxLiquidVoxels = 4e9;  // in one field's band: 16 GB of distances
constexpr double maxIndex = 1 << 29;     // keeps OpenVDB's 32-bit coordinates and sums of two of them in range

[[noreturn]] void refuse(const std::string& why) {
    throw std::invalid_argument("seed: " + why);
}

void requireLiquid(const FloatGrid& liquid) {
    if (liquid.getGridClass() != openvdb::GRID_LEVEL_SET) refuse("the liquid's grid is no level set");
    if (!liquid.transform().isLinear() || !liquid.hasUniformVoxels()) refuse("the liquid's voxels are no cubes");
    if (!(liquid.background() >= minHalfWidth * liquid.voxelSize()[0] * (1 - rounding)))
        refuse("the liquid's band is narrower than 3 voxels");
    if (!std::isfinite(liquid.background())) refuse("the liquid's background is not finite");
    // all of OpenVDB's checks but that of the gradient, which is mended, and of the width, which may lack its last bits
    openvdb::tools::CheckLevelSet<FloatGrid> check(liquid);
    std::string fault = check.checkTiles();
    if (fault.empty()) fault = check.checkFinite();
    if (fault.empty()) fault = check.checkRange();
    if (fault.empty()) fault = check.checkInactiveValues();
    if (!fault.empty()) refuse("the liquid's grid is no level set: " + fault.substr(0, fault.find('\n')));
}

void requirePose(const Pose& pose, double voxelSize) {
    const auto finite = [](float x) { return std::isfinite(x); };
    const glm::vec3& p = pose.position;
    const glm::quat& q = pose.rotation;
    if (!finite(p.x) || !finite(p.y) || !finite(p.z)) refuse("the pose's position is not finite");
    if (std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) > maxIndex * voxelSize)
        refuse("the pose is too far away for the liquid's voxels");
    if (!finite(q.w) || !finite(q.x) || !finite(q.y) || !finite(q.z)) refuse("the pose's rotation is not finite");
    if (!(std::abs(glm::length(q) - 1) <= unitTolerance)) refuse("the pose's rotation is not of unit length");
}

void requireField(const LevelSet& field, const FloatGrid& liquid) {
    const double h = field.voxelSize(), ratio = h / liquid.voxelSize()[0];
    if (std::min(field.exteriorWidth(), field.interiorWidth()) < minFieldWidth * h * (1 - rounding))
        refuse("the field's band is narrower than a voxel");
    if (double(field.activeVoxels()) * ratio * ratio * ratio > maxLiquidVoxels)
        refuse("the liquid's voxels are too small for the field");
}

// The half width that the result has: the caller's, or its last bits more where rounding left it below 3 voxels.
float bandWidth(const FloatGrid& liquid) {
    float width = liquid.background();
    while (width / liquid.voxelSize()[0] < minHalfWidth)
        width = std::nextafter(width, std::numeric_limits<float>::max());
    return width;
}

openvdb::math::Transform::Ptr moved(const openvdb::math::Transform& transform, const Pose& pose) {
    const glm::dmat3 r = glm::mat3_cast(glm::normalize(glm::dquat(pose.rotation)));
    const glm::dvec3 p = pose.position;
    // OpenVDB multiplies row vectors from the left: its rows are the images of the axes, which are GLM's columns
    const openvdb::Mat4d motion(r[0].x, r[0].y, r[0].z, 0., r[1].x, r[1].y, r[1].z, 0., r[2].x, r[2].y, r[2].z, 0., p.x,
                                p.y, p.z, 1.);
    const auto result = transform.copy();
    result->postMult(motion);
    return result;
}

// The field's grid with a band so wide that the voxels at both ends of every crossed edge of the liquid lie within it.
FloatGrid::ConstPtr widened(const LevelSet& field, double liquidVoxel) {
    const double h = field.voxelSize();
    const double needed = (1 + crossingSlack) * liquidVoxel + std::sqrt(3.0) * h;
    const double missing = needed - std::min(field.exteriorWidth(), field.interiorWidth());
    if (missing <= rounding * h) return field.grids().distance;
    return openvdb::tools::dilateSdf(*field.grids().distance, int(std::ceil(missing / h)),
                                     openvdb::tools::NN_FACE_EDGE_VERTEX);
}

// Reads a grid at the index coordinates of another one.
class Sampler {
  public:
    Sampler(const FloatGrid& source, const openvdb::math::Transform& from, const openvdb::math::Transform& to)
        : values_(source.getConstAccessor()), from_(from), to_(to) {}

    // True, and the interpolated value, if all eight voxels around the point are active; else a value of the right
    // sign.
    bool sample(const Coord& at, float& value) const {
        const Vec3d point = from_.worldToIndex(to_.indexToWorld(at));
        const Coord low = Coord::floor(point);
        const Vec3d t = point - low.asVec3d();
        bool known = true;
        double sum = 0;
        for (int corner = 0; corner < 8; ++corner) {
            const int x = corner >> 2, y = corner >> 1 & 1, z = corner & 1;
            float there;
            known &= values_.probeValue(low.offsetBy(x, y, z), there);
            sum += (x ? t.x() : 1 - t.x()) * (y ? t.y() : 1 - t.y()) * (z ? t.z() : 1 - t.z()) * there;
        }
        value = float(sum);
        return known;
    }

  private:
    FloatGrid::ConstAccessor values_;
    const openvdb::math::Transform &from_, &to_;
};

// The smallest box of `to`'s index coordinates around a box of `from`'s.
CoordBBox mapped(const CoordBBox& box, const openvdb::math::Transform& from, const openvdb::math::Transform& to) {
    Vec3d lower(std::numeric_limits<double>::max()), upper(-lower);
    for (int corner = 0; corner < 8; ++corner) {
        const Coord c(corner & 4 ? box.max().x() : box.min().x(), corner & 2 ? box.max().y() : box.min().y(),
                      corner & 1 ? box.max().z() : box.min().z());
        const Vec3d point = to.worldToIndex(from.indexToWorld(c));
        lower = openvdb::math::minComponent(lower, point);
        upper = openvdb::math::maxComponent(upper, point);
    }
    for (int axis = 0; axis < 3; ++axis)
        if (!(lower[axis] > -maxIndex && upper[axis] < maxIndex))
            refuse("the pose is too far away for the liquid's voxels");
    return {Coord::floor(lower), Coord::ceil(upper)};
}

// The origins of the liquid's leaves that the source's band may reach, in ascending order.
std::vector<Coord> leavesNear(const FloatGrid& source, const openvdb::math::Transform& from,
                              const openvdb::math::Transform& to) {
    std::vector<Coord> origins;
    for (auto leaf = source.tree().cbeginLeaf(); leaf; ++leaf) {
        const CoordBBox box = mapped(leaf->getNodeBoundingBox(), from, to);
        const Coord low = box.min() & ~int(Leaf::DIM - 1);
        for (int x = low.x(); x <= box.max().x(); x += Leaf::DIM)
            for (int y = low.y(); y <= box.max().y(); y += Leaf::DIM)
                for (int z = low.z(); z <= box.max().z(); z += Leaf::DIM) origins.emplace_back(x, y, z);
        // neighbours repeat most of them: what is kept must not grow with the square of the resolution
        if (origins.size() > 2 * origins.capacity() / 3) {
            std::sort(origins.begin(), origins.end());
            origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
        }
    }
    std::sort(origins.begin(), origins.end());
    origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
    return origins;
}

// A leaf of the liquid with the field's distances, active where they are known and below `width`; null if none is.
std::unique_ptr<Leaf> sampledLeaf(const Coord& origin, const Sampler& sampler, float width) {
    auto leaf = std::make_unique<Leaf>(origin, width);
    for (openvdb::Index i = 0; i < Leaf::SIZE; ++i) {
        float value;
        const bool known = sampler.sample(leaf->offsetToGlobalCoord(i), value);
        if (known && std::abs(value) < width)
            leaf->setValueOn(i, value);
        else
            leaf->setValueOff(i, std::copysign(width, value));
    }
    return leaf->isEmpty() ? nullptr : std::move(leaf);
}

FloatGrid::Ptr emptyLike(const FloatGrid& liquid, float width) {
    const auto grid = FloatGrid::create(width);
    grid->setTransform(liquid.transform().copy());
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    return grid;
}

// Where the source's band is narrower than the liquid's, the rest is swept from what is known.
FloatGrid::Ptr completed(const FloatGrid& sampled, double knownWidth, float width) {
    const double missing = (width - knownWidth) / sampled.voxelSize()[0];
    if (missing <= 0 || sampled.empty()) return sampled.deepCopy();
    return openvdb::tools::dilateSdf(sampled, int(std::ceil(missing)) + 1, openvdb::tools::NN_FACE_EDGE_VERTEX);
}

// Switches off what lies beyond the band, and gives all that is off plus or minus the band's width.
void trim(FloatGrid& grid, float width) {
    openvdb::tree::LeafManager<FloatTree> leaves(grid.tree());
    leaves.foreach ([width](Leaf& leaf, std::size_t) {
        for (auto voxel = leaf.beginValueOn(); voxel; ++voxel) {
            if (std::abs(*voxel) < width) continue;
            voxel.setValue(std::copysign(width, *voxel));
            voxel.setValueOff();
        }
    });
    openvdb::tools::changeLevelSetBackground(leaves, width);
    openvdb::tools::pruneLevelSet(grid.tree());
}

// The field as a level set of the liquid's transform and the band width `width` [m].
FloatGrid::Ptr resampled(const LevelSet& field, const Pose& pose, const FloatGrid& liquid, float width) {
    const double voxel = liquid.voxelSize()[0];
    const FloatGrid::ConstPtr source = widened(field, voxel);
    const auto from = moved(source->transform(), pose);
    const openvdb::math::Transform& to = liquid.transform();

    const std::vector<Coord> origins = leavesNear(*source, *from, to);
    std::vector<std::unique_ptr<Leaf>> leaves(origins.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, origins.size()), [&](const auto& range) {
        const Sampler sampler(*source, *from, to);
        for (std::size_t i = range.begin(); i < range.end(); ++i) leaves[i] = sampledLeaf(origins[i], sampler, width);
    });
    const auto sampled = emptyLike(liquid, width);
    for (auto& leaf : leaves)
        if (leaf) sampled->tree().addLeaf(leaf.release());
    openvdb::tools::signedFloodFill(sampled->tree());

    const double sourceWidth =
        std::max<double>(std::min(field.exteriorWidth(), field.interiorWidth()), (1 + crossingSlack) * voxel);
    const auto result = completed(*sampled, sourceWidth - std::sqrt(3.0) * field.voxelSize(), width);
    trim(*result, width);
    return result;
}

FloatGrid::Ptr combined(const FloatGrid& liquid, const FloatGrid& body, SeedMode mode) {
    switch (mode) {
        case SeedMode::intersect:
            return openvdb::tools::csgIntersectionCopy(liquid, body);
        case SeedMode::subtract:
            return openvdb::tools::csgDifferenceCopy(liquid, body);
        case SeedMode::unite:
            break;
    }
    return openvdb::tools::csgUnionCopy(liquid, body);
}

}  // namespace

void seed(FloatGrid& liquid, const LevelSet& field, const Pose& pose, SeedMode mode) {
    requireLiquid(liquid);
    requirePose(pose, liquid.voxelSize()[0]);
    requireField(field, liquid);
    const float width = bandWidth(liquid);
    const FloatGrid::Ptr body = resampled(field, pose, liquid, width);
    const FloatGrid::Ptr old = liquid.deepCopy();
    trim(*old, width);
    const FloatGrid::Ptr result = combined(*old, *body, mode);
    mend(*result);
    liquid.setTree(result->treePtr());
}

}  // namespace bilayer::fluid
