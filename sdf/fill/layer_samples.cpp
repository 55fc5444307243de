// SPDX-License-Identifier: Apache-2.0
// Highway compiles the code between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once per instruction set.
#include "sdf/fill/layer_samples.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/fill/layer_samples.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>

#include "sdf/base/vector_lanes.h"
#include "sdf/fill/sample_writer.h"
#include "sdf/fill/tile_cutter.h"
#include "sdf/fill/triangle_lanes.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

/// Triangles with up to this many rows are processed together. A triangle with more rows fills vectors of its own.
constexpr int fewRows = 4;

using Wide = TriangleLanes::Wide;
using Small = TriangleLanes::Small;
/// As many samples of one triangle at once as there are float lanes.
using Row = hn::CappedTag<float, 16>;

inline VectorLanes<Small> narrowed(const VectorLanes<Wide>& a) {
    return {hn::DemoteTo(Small(), a.x), hn::DemoteTo(Small(), a.y), hn::DemoteTo(Small(), a.z)};
}

template <class D>
HWY_INLINE VectorLanes<D> pointsAt(D tag, const glm::vec3& place) {
    return {hn::Set(tag, place.x), hn::Set(tag, place.y), hn::Set(tag, place.z)};
}

// Generates the samples of the triangles in a brick.
class SampleGenerator {
  public:
    SampleGenerator(const Mesh& mesh, const SampledBrick& brick, const SampleCells& cells, AddedSamples& to)
        : mesh_(mesh), brick_(brick), cells_(cells), origin_(brick.origin), writer_(cells, to) {}

    void run(std::span<const std::uint32_t> triangles) {
        const std::size_t lanes = hn::Lanes(Wide());
        const TriangleLimits limits{origin_ + glm::dvec3(cells_.lower), origin_ + glm::dvec3(cells_.upper)};
        std::uint32_t triangle = 0;
        TileCutter cutter(brick_.options, &limits, [&](const TilePart& part) {
            if (part.rows > 0)
                addRows(part, triangle);
            else
                addThin(part, triangle, limits);
        });
        for (std::size_t i = 0; i < triangles.size(); i += lanes) {
            const std::size_t count = std::min(lanes, triangles.size() - i);
            lanes_.load(mesh_, triangles, i, count);
            for (std::uint64_t others = addFew(count); others != 0; others &= others - 1) {
                const auto lane = std::size_t(std::countr_zero(others));
                triangle = triangles[i + lane];
                const auto at = [&](const auto& rows) { return TriangleLanes::at(rows, lane); };
                cutter.cut({at(lanes_.corners[0]), at(lanes_.corners[1]), at(lanes_.corners[2])}, at(lanes_.normal),
                           lanes_.length[lane], lanes_.longest2[lane]);
            }
        }
    }

  private:
    // Adds the samples of triangles with few rows, several triangles at once. Returns one bit for each other triangle
    // with nonzero area.
    std::uint64_t addFew(std::size_t count) {
        const Wide wide;
        const double voxelsPerUnit = brick_.voxelsPerUnit;
        const VectorLanes<Wide> a = lanes_.corner(0, voxelsPerUnit), b = lanes_.corner(1, voxelsPerUnit),
                                c = lanes_.corner(2, voxelsPerUnit), ab = b - a, ac = c - a, bc = c - b,
                                normal = cross(ab, ac);
        const auto length = hn::Sqrt(dot(normal, normal)),
                   longest2 = hn::Max(dot(ab, ab), hn::Max(dot(bc, bc), dot(ac, ac)));
        const DoubleLayerOptions& options = brick_.options;
        const auto epsilon = hn::Set(wide, double(options.epsilon)), one = hn::Set(wide, 1.0);
        const auto area = hn::Mul(length, hn::Set(wide, 0.5));
        auto rows = one, step = one;
        if (!hn::AllFalse(wide, hn::Gt(area, epsilon))) {
            rows = hn::Max(one, hn::Ceil(hn::Sqrt(hn::Div(area, epsilon))));
            step = hn::Div(one, rows);
        }
        const auto real = hn::And(hn::FirstN(wide, count), hn::Gt(length, hn::Zero(wide)));
        const int maxRows = options.subdivision == Subdivision::rows ? std::min(fewRows, options.maxSubdivision) : 1;
        const auto whole = hn::Le(longest2, hn::Mul(hn::Mul(rows, rows), hn::Set(wide, longestOfOneSample2(options))));
        const auto few = hn::And(hn::And(real, whole), hn::Le(rows, hn::Set(wide, double(maxRows))));
        if (!hn::AllFalse(wide, few)) {
            const VectorLanes<Wide> down = scaled(ab, step),
                                    start = scaled(down + scaled(ac, step), hn::Set(wide, 1.0 / 3.0));
            const VectorLanes<Wide> origin{hn::Set(wide, origin_.x), hn::Set(wide, origin_.y),
                                           hn::Set(wide, origin_.z)};
            addRows(hn::DemoteTo(Small(), hn::IfThenElseZero(few, rows)), narrowed(a - origin + start), narrowed(down),
                    narrowed(scaled(bc, step)),
                    narrowed(scaled(normal, hn::Div(hn::Set(wide, double(options.delta)), length))));
        }
        const auto others = hn::AndNot(few, real);
        if (hn::AllFalse(wide, others)) return 0;
        TriangleLanes::store(normal, lanes_.normal);
        hn::Store(length, wide, lanes_.length);
        hn::Store(longest2, wide, lanes_.longest2);
        std::uint8_t bytes[8] = {};
        hn::StoreMaskBits(wide, others, bytes);
        return bytes[0];
    }

    // Adds the samples of Algorithm 1 for as many triangles as there are lanes. Row i has i + 1 samples.
    void addRows(hn::Vec<Small> rows, const VectorLanes<Small>& start, const VectorLanes<Small>& down,
                 const VectorLanes<Small>& across, const VectorLanes<Small>& offset) {
        const Small small;
        const auto owners = hn::Load(hn::RebindToSigned<Small>(), lanes_.triangles);
        for (int i = 0;; ++i) {
            const auto row = hn::Set(small, float(i));
            const auto among = hn::Gt(rows, row);
            if (hn::AllFalse(small, among)) return;
            for (int j = 0; j <= i; ++j) {
                const auto column = hn::Set(small, float(j));
                const auto place = [&](auto begin, auto s1, auto s2) {
                    return hn::MulAdd(column, s2, hn::MulAdd(row, s1, begin));
                };
                writer_.put(small, among,
                            {place(start.x, down.x, across.x), place(start.y, down.y, across.y),
                             place(start.z, down.z, across.z)},
                            offset, owners);
            }
        }
    }

    // The same for one triangle, many samples at once.
    void addRows(const TilePart& part, std::uint32_t triangle) {
        const Row tag;
        const hn::RebindToSigned<Row> intTag;
        const TriangleCorners& c = part.corners;
        const double step = 1.0 / double(part.rows);
        const glm::dvec3 s1 = (c[1] - c[0]) * step, s2 = (c[2] - c[1]) * step, s3 = (c[2] - c[0]) * step;
        const auto first = pointsAt(tag, glm::vec3(c[0] - origin_ + (s1 + s3) / 3.0)),
                   down = pointsAt(tag, glm::vec3(s1)), across = pointsAt(tag, glm::vec3(s2));
        const auto offset = offsetOf(part);
        const auto owner = hn::Set(intTag, std::int32_t(triangle));
        const auto half = hn::Set(tag, 0.5f), one = hn::Set(tag, 1.f);
        const int count = part.rows * (part.rows + 1) / 2;
        for (int k = 0; k < count; k += int(hn::Lanes(tag))) {
            // The square roots are exact at the start of a row, and clearly smaller before it.
            const auto number = hn::Add(hn::Iota(tag, 0), hn::Set(tag, float(k)));
            const auto root = hn::Sqrt(hn::MulAdd(number, hn::Set(tag, 8.f), one));
            const auto row = hn::Floor(hn::Mul(hn::Sub(root, one), half)),
                       column = hn::Sub(number, hn::Mul(half, hn::MulAdd(row, row, row)));
            const auto place = [&](auto begin, auto s1, auto s2) {
                return hn::MulAdd(column, s2, hn::MulAdd(row, s1, begin));
            };
            writer_.put(
                tag, hn::FirstN(tag, std::size_t(count - k)),
                {place(first.x, down.x, across.x), place(first.y, down.y, across.y), place(first.z, down.z, across.z)},
                offset, owner);
        }
    }

    // Adds the samples of a thin part.
    void addThin(const TilePart& part, std::uint32_t triangle, const TriangleLimits& limits) {
        const Row tag;
        const auto offset = offsetOf(part);
        const auto owner = hn::Set(hn::RebindToSigned<Row>(), std::int32_t(triangle));
        const ThinPart thin(part);
        const auto [begin, end] = thin.within(limits);
        for (int i = begin; i < end; i += ThinPart::run) {
            const ThinPart::Run run = thin.runFrom(i);
            const auto first = pointsAt(tag, glm::vec3(run.start - origin_)),
                       step = pointsAt(tag, glm::vec3(run.startStep)), rise = pointsAt(tag, glm::vec3(run.rise));
            for (int k = 0; k < run.count; k += int(hn::Lanes(tag))) {
                const auto number = hn::Iota(tag, float(k));
                const auto line = [&](double at, double each) {
                    return hn::MulAdd(number, hn::Set(tag, float(each)), hn::Set(tag, float(at)));
                };
                const auto across = hn::Min(line(run.up, run.upStep), line(run.down, run.downStep));
                const auto place = [&](auto at, auto each, auto upwards) {
                    return hn::MulAdd(across, upwards, hn::MulAdd(number, each, at));
                };
                writer_.put(
                    tag, hn::FirstN(tag, std::size_t(run.count - k)),
                    {place(first.x, step.x, rise.x), place(first.y, step.y, rise.y), place(first.z, step.z, rise.z)},
                    offset, owner);
            }
        }
    }

    // Returns the vector from a sample to its outer layer point. The division is in double, since floats cannot hold
    // the area of a very small triangle.
    VectorLanes<Row> offsetOf(const TilePart& part) const {
        return pointsAt(Row(), glm::vec3(part.normal * (double(brick_.options.delta) / part.length)));
    }

    const Mesh& mesh_;
    const SampledBrick& brick_;
    const SampleCells& cells_;
    glm::dvec3 origin_;  // of the brick [index coordinates]
    SampleWriter writer_;
    TriangleLanes lanes_;
};

void generateSamples(const Mesh& mesh, std::span<const std::uint32_t> triangles, const SampledBrick& brick,
                     const SampleCells& cells, AddedSamples& to) {
    SampleGenerator(mesh, brick, cells, to).run(triangles);
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {
namespace {

HWY_EXPORT(generateSamples);

constexpr std::size_t padding = 16;  // float count of the widest SIMD vector

}  // namespace

void SampleColumns::reserve(std::size_t count) {
    const std::size_t size = count + padding;
    if (triangle.size() >= size) return;
    const std::size_t grown = std::max(size, 2 * triangle.size());
    for (std::size_t axis = 0; axis < 3; ++axis) {
        place[axis].resize(grown);
        offset[axis].resize(grown);
    }
    triangle.resize(grown);
}

void LayerSamples::begin(const SampledBrick& brick) {
    brick_.emplace(brick);
    cells_.lower = glm::vec3(-brick.reach);
    cells_.upper = glm::vec3(float(brick.side - 1) + brick.reach);
    // A cell begins half a voxel before its voxels. One tenth of a voxel is a margin for rounding.
    cells_.around = cellsAround(brick.reach);
    cells_.firstCorner = -0.5f - float(cells_.around * cellSide);
    cells_.size = brick.side / cellSide + 2 * cells_.around;
    added_.count = 0;
}

void LayerSamples::add(const Mesh& mesh, std::span<const std::uint32_t> triangles) {
    HWY_DYNAMIC_DISPATCH(generateSamples)(mesh, triangles, *brick_, cells_, added_);
}

// A stable counting sort.
void LayerSamples::finish() {
    const auto size = std::size_t(cells_.size);
    begins_.assign(size * size * size + 1, 0);
    for (std::size_t i = 0; i < added_.count; ++i) ++begins_[std::size_t(added_.cell[i]) + 1];
    std::partial_sum(begins_.begin(), begins_.end(), begins_.begin());
    sorted_.reserve(added_.count);
    // Converts cells to positions.
    for (std::size_t i = 0; i < added_.count; ++i)
        added_.cell[i] = std::int32_t(begins_[std::size_t(added_.cell[i])]++);
    const auto sort = [&](const auto& from, auto& to) {
        const std::int32_t* places = added_.cell.data();
        for (std::size_t i = 0; i < added_.count; ++i) to[std::size_t(places[i])] = from[i];
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
        sort(added_.columns.place[axis], sorted_.place[axis]);
        sort(added_.columns.offset[axis], sorted_.offset[axis]);
    }
    sort(added_.columns.triangle, sorted_.triangle);
    // Each cursor has reached the end of its cell.
    std::copy_backward(begins_.begin(), begins_.end() - 1, begins_.end());
    begins_[0] = 0;
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
