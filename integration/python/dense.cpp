// SPDX-License-Identifier: Apache-2.0
#include "integration/python/dense.h"

#include <fmt/format.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tree/LeafManager.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <vector>

#include <bilayer/sdf/grids.h>

#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/without_gil.h"
#include "sdf/base/openvdb.h"

namespace bilayer::python {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::FloatTree;

constexpr double maxDenseVoxels = 1u << 31;  // 8 GiB; a finer field wants sparse()
/// Maximum difference of the magnitudes of neighbouring distances [voxels]. It is 1 for exact distances; those of the
/// double layer method and of fast sweeping differ by more near creases.
constexpr float maxStep = 1.5f;
/// Minimum of the median, over voxels next to the surface, of the largest change to a neighbour [spacings]. Distances
/// change by 1 / sqrt(3) or more, values in a larger unit by less.
constexpr float minStepAtSurface = 0.4f;
/// What to do with scipy's distance_transform_edt of the outside minus that of the inside.
constexpr const char* halfSpacingHint =
    "; distance transforms of the outside and the inside count from voxel centres: subtract half a spacing from each, "
    "and then one from the other";
/// Tolerance of an origin at whole voxels [voxels]: a rounding of double coordinates, and less than errors of fields.
constexpr double originTolerance = 1e-4;

using DenseFloats = openvdb::tools::Dense<float, openvdb::tools::LayoutZYX>;

/// The distances of a dense array with z innermost.
class DenseValues {
  public:
    DenseValues(std::span<const float> values, const Shape& shape, double spacing)
        : values_(values), size_(int(shape[0]), int(shape[1]), int(shape[2])), spacing_(float(spacing)) {}

    const Coord& size() const { return size_; }
    float at(const Coord& voxel) const { return values_[index(voxel)]; }

    /// The smallest value on the array's border.
    float minAtBorder() const {
        float minimum = std::numeric_limits<float>::infinity();
        visit([&](const Coord& voxel) {
            if (isAtBorder(voxel)) minimum = std::min(minimum, at(voxel));
        });
        return minimum;
    }

    float min() const { return *std::min_element(values_.begin(), values_.end()); }

    /// Throws std::invalid_argument unless neighbours differ as distances do.
    void requireDistances() const {
        std::atomic<std::size_t> first = values_.size();  // the first voxel that differs too much from the next
        forSlices([&](int x) {
            std::size_t found = values_.size();
            visitSlice(x, [&](const Coord& voxel) {
                forNext(voxel, [&](const Coord& next) {
                    const float step = std::abs(std::abs(at(next)) - std::abs(at(voxel)));
                    if (!(step <= maxStep * spacing_)) found = std::min(found, index(voxel));
                });
            });
            std::size_t known = first;
            while (found < known && !first.compare_exchange_weak(known, found)) {
            }
        });
        if (first == values_.size()) return;
        const std::size_t i = first;
        const Coord voxel(int(i / row() / std::size_t(size_.y())), int(i / row() % std::size_t(size_.y())),
                          int(i % row()));
        forNext(voxel, [&](const Coord& next) {
            const float step = std::abs(std::abs(at(next)) - std::abs(at(voxel)));
            if (step <= maxStep * spacing_) return;
            throw std::invalid_argument(fmt::format(
                "values: values[{}] is {:g} and values[{}] is {:g}, but distances at a spacing of {:g} differ by at "
                "most that: expected signed distances in the unit of the spacing",
                text(voxel), at(voxel), text(next), at(next), spacing_));
        });
    }

    /// Throws std::invalid_argument unless values change from voxel to voxel across the surface as distances do.
    void requireStepsAtSurface() const {
        std::vector<std::vector<float>> parts(std::size_t(size_.x()));
        forSlices([&](int x) {
            visitSlice(x, [&](const Coord& voxel) {
                if (const auto step = stepAtSurface(voxel)) parts[std::size_t(x)].push_back(*step);
            });
        });
        std::vector<float> steps;
        for (const auto& part : parts) steps.insert(steps.end(), part.begin(), part.end());
        if (steps.empty()) return;
        const auto middle = steps.begin() + std::ptrdiff_t(steps.size() / 2);
        std::nth_element(steps.begin(), middle, steps.end());
        if (!(*middle >= minStepAtSurface && *middle <= maxStep))
            throw std::invalid_argument(fmt::format(
                "values: across the surface they change by {:.3g} spacings from voxel to voxel in the median, and "
                "distances by 0.58 to 1: expected signed distances in the unit of the spacing{}",
                *middle, *middle > maxStep ? halfSpacingHint : ""));
    }

  private:
    static std::string text(const Coord& voxel) { return fmt::format("{}, {}, {}", voxel.x(), voxel.y(), voxel.z()); }

    std::size_t row() const { return std::size_t(size_.z()); }
    std::size_t index(const Coord& v) const {
        return (std::size_t(v.x()) * std::size_t(size_.y()) + std::size_t(v.y())) * row() + std::size_t(v.z());
    }

    bool isAtBorder(const Coord& voxel) const {
        for (int axis = 0; axis < 3; ++axis)
            if (voxel[axis] == 0 || voxel[axis] == size_[axis] - 1) return true;
        return false;
    }

    template <class Work>
    void forSlices(const Work& work) const {
        tbb::parallel_for(0, size_.x(), work);
    }

    template <class Visit>
    void visitSlice(int x, const Visit& visit) const {
        for (int y = 0; y < size_.y(); ++y)
            for (int z = 0; z < size_.z(); ++z) visit(Coord(x, y, z));
    }

    template <class Visit>
    void visit(const Visit& visit) const {
        for (int x = 0; x < size_.x(); ++x) visitSlice(x, visit);
    }

    // Visits the next voxel along each axis.
    template <class Visit>
    void forNext(const Coord& voxel, const Visit& visit) const {
        for (int axis = 0; axis < 3; ++axis) {
            Coord next = voxel;
            if (++next[axis] < size_[axis]) visit(next);
        }
    }

    // The largest change from a voxel to a neighbour [spacings], if the surface passes between it and any neighbour.
    std::optional<float> stepAtSurface(const Coord& voxel) const {
        float largest = 0;
        bool crossed = false;
        for (int axis = 0; axis < 3; ++axis)
            for (const int side : {-1, 1}) {
                Coord next = voxel;
                next[axis] += side;
                if (next[axis] < 0 || next[axis] >= size_[axis]) continue;
                largest = std::max(largest, std::abs(at(next) - at(voxel)) / spacing_);
                crossed |= (at(voxel) < 0) != (at(next) < 0);
            }
        return crossed ? std::optional(largest) : std::nullopt;
    }

    std::span<const float> values_;
    Coord size_;
    float spacing_;
};

struct Widths {
    float exterior, interior;
};

Widths widthsOf(const py::object& halfWidth, float minAtBorder, float deepest, double spacing) {
    if (halfWidth.is_none()) return {minAtBorder, deepest};
    const Floats given(halfWidth, "half_width", {}, Range::nonNegative);
    const auto widths = given.as<float>();
    if (widths.size() != 1 && given.shape() != Shape{2})
        throw std::invalid_argument("half_width: expected a number, or an exterior and an interior one, got shape " +
                                    text(given.shape()));
    for (const float width : widths) requirePositive(width, "half_width");
    if (double(widths[0]) > double(minAtBorder) + spacing)
        throw std::invalid_argument(
            fmt::format("half_width is {:g} outside, but a voxel at the border of the array is at {:g}: the band must "
                        "end within the array",
                        widths[0], minAtBorder));
    return {widths[0], widths[widths.size() - 1]};
}

// The index of voxel [0, 0, 0] in the grid.
Coord shiftOf(const glm::dvec3& origin, double spacing) {
    Coord shift;
    for (int axis = 0; axis < 3; ++axis) {
        const double voxels = origin[axis] / spacing, whole = std::round(voxels);
        if (!(std::abs(voxels - whole) <= originTolerance))
            throw std::invalid_argument(fmt::format(
                "origin[{}] is {:g}, which is {:g} voxels from zero, and must be whole voxels from it: pass "
                "field_origin=origin in place of origin, and subtract that from the points of queries",
                axis, origin[axis], voxels));
        if (!(std::abs(whole) < double(std::numeric_limits<int>::max() / 2)))
            throw std::invalid_argument(
                fmt::format("origin[{}] is {:g} voxels from zero, and must be at most 2^30: pass field_origin=origin "
                            "in place of origin, and subtract that from the points of queries",
                            axis, voxels));
        shift[axis] = int(whole);
    }
    return shift;
}

// The grid of the array's values. Those beyond the band are inactive.
FloatGrid::Ptr gridOf(std::span<const float> values, const CoordBBox& box, const Widths& widths) {
    const auto grid = FloatGrid::create(widths.exterior);
    const DenseFloats dense(box, const_cast<float*>(values.data()));
    openvdb::tools::copyFromDense(dense, *grid, 0.f);
    const auto clamped = [&](float value) { return std::clamp(value, -widths.interior, widths.exterior); };
    const auto inBand = [&](float value) { return value > -widths.interior && value < widths.exterior; };
    FloatTree& tree = grid->tree();
    auto tile = tree.beginValueAll();
    tile.setMaxDepth(FloatTree::DEPTH - 2);
    for (; tile; ++tile) {
        tile.setValue(clamped(*tile));
        tile.setActiveState(inBand(*tile));
    }
    tree.voxelizeActiveTiles();
    openvdb::tree::LeafManager<FloatTree> leaves(tree);
    leaves.foreach ([&](FloatTree::LeafNodeType& leaf, std::size_t) {
        for (auto voxel = leaf.beginValueAll(); voxel; ++voxel) {
            voxel.setValue(clamped(*voxel));
            leaf.setActiveState(voxel.pos(), inBand(*voxel));
        }
    });
    openvdb::tools::pruneLevelSet(tree, widths.exterior, -widths.interior);
    return grid;
}

LevelSet levelSetOf(const FloatGrid::Ptr& grid, const Widths& widths, double spacing, const glm::dvec3& origin) {
    grid->setTransform(openvdb::math::Transform::createLinearTransform(spacing));
    grid->setName("distance");
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    if (widths.interior != widths.exterior)
        grid->insertMeta(metadata::interiorWidth, openvdb::FloatMetadata(widths.interior));
    if (origin != glm::dvec3(0))
        grid->insertMeta(metadata::origin, openvdb::Vec3DMetadata({origin.x, origin.y, origin.z}));
    auto grids = std::make_shared<Grids>();
    grids->distance = grid;
    return LevelSet(std::move(grids));
}

}  // namespace

py::object toDense(const LevelSet& levelSet, int padding) {
    if (padding < 0) throw std::invalid_argument(fmt::format("padding is {}, and must be 0 or above", padding));
    const FloatGrid& grid = *levelSet.grids().distance;
    CoordBBox box = grid.evalActiveVoxelBoundingBox();
    const openvdb::Vec3d padded = box.dim().asVec3d() + 2. * openvdb::Vec3d(padding);
    if (padded.x() * padded.y() * padded.z() > maxDenseVoxels)
        throw std::invalid_argument(
            fmt::format("padding: a dense array of {} x {} x {} voxels is larger than 8 GiB: "
                        "use sparse()",
                        padded.x(), padded.y(), padded.z()));
    box.expand(padding);
    const Coord size = box.dim();
    py::array_t<float> values({size.x(), size.y(), size.z()});
    float* const memory = values.mutable_data();
    {
        const WithoutGil release;
        DenseFloats target(box, memory);
        openvdb::tools::copyToDense(grid, target);
    }
    const openvdb::Vec3d place = grid.indexToWorld(box.min());
    return result("Dense", values, toArray(glm::dvec3(place.x(), place.y(), place.z())), levelSet.voxelSize());
}

LevelSet fromDense(const py::object& array, const py::object& origin, double spacing, const py::object& halfWidth,
                   const py::object& fieldOrigin) {
    const Floats given(array, "values", {});
    const Shape& shape = given.shape();
    if (shape.size() != 3 || std::find(shape.begin(), shape.end(), 0) != shape.end())
        throw std::invalid_argument("values: expected real numbers of shape (nx, ny, nz), got shape " + text(shape));
    requireVoxelSize(spacing, "spacing");
    const glm::dvec3 reference = doubleVector(fieldOrigin, "field_origin");
    const Coord shift = shiftOf(doubleVector(origin, "origin"), spacing);
    const DenseValues values(given.as<float>(), shape, spacing);
    float minAtBorder = 0, min = 0;
    {
        const WithoutGil release;
        min = values.min();
        minAtBorder = values.minAtBorder();
        if (!(min < 0)) throw std::invalid_argument("values: expected negative distances inside, got none");
        if (!(minAtBorder > 0))
            throw std::invalid_argument(fmt::format(
                "values: a voxel at the border of the array is at {:g}: the solid must end within the array, by a "
                "voxel or more",
                minAtBorder));
        values.requireDistances();
        values.requireStepsAtSurface();
    }
    const Widths widths = widthsOf(halfWidth, minAtBorder, -min, spacing);
    const WithoutGil release;
    openvdb::initialize();
    const CoordBBox box(shift, shift + values.size() - Coord(1));
    return levelSetOf(gridOf(given.as<float>(), box, widths), widths, spacing, reference);
}

}  // namespace bilayer::python
