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
#include "sdf/fill/tile_cutter.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

/// As many triangles at once as there are double lanes, and as many samples of one triangle as there are float lanes.
using Wide = hn::CappedTag<double, 8>;
constexpr std::size_t maxLanes = 8;
/// Triangles with up to this many rows are processed together. A triangle with more rows fills vectors of its own.
constexpr int fewRows = 4;

using Small = hn::Rebind<float, Wide>;
using Row = hn::CappedTag<float, 16>;

inline VectorLanes<Small> narrowed(const VectorLanes<Wide>& a) {
    return {hn::DemoteTo(Small(), a.x), hn::DemoteTo(Small(), a.y), hn::DemoteTo(Small(), a.z)};
}

template <class D>
HWY_INLINE VectorLanes<D> pointsAt(D tag, const glm::vec3& place) {
    return {hn::Set(tag, place.x), hn::Set(tag, place.y), hn::Set(tag, place.z)};
}

// Generates the samples of the triangles in a brick.
class Spreader {
  public:
    Spreader(const Mesh& mesh, const SampledBrick& brick, const SampleCells& cells, AddedSamples& to)
        : mesh_(mesh), brick_(brick), cells_(cells), origin_(brick.origin), to_(to) {}

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
            load(triangles, i, count);
            for (std::uint64_t others = addFew(count); others != 0; others &= others - 1) {
                const auto lane = std::size_t(std::countr_zero(others));
                triangle = triangles[i + lane];
                const auto at = [&](const auto& rows) {
                    return glm::dvec3(rows[0][lane], rows[1][lane], rows[2][lane]);
                };
                cutter.cut({at(known_.corners[0]), at(known_.corners[1]), at(known_.corners[2])}, at(known_.normal),
                           known_.length[lane], known_.longest2[lane]);
            }
        }
    }

  private:
    // Loads the corners of some triangles. Prefetches the next ones, since they are scattered in memory.
    void load(std::span<const std::uint32_t> triangles, std::size_t first, std::size_t count) {
        // Prefetch distances match the memory latency: first the indices, then the corners.
        constexpr std::size_t indicesAhead = 32, cornersAhead = 16;
        for (std::size_t lane = 0; lane < count; ++lane) {
            const std::size_t i = first + lane;
            if (i + indicesAhead < triangles.size()) __builtin_prefetch(&mesh_.triangles[triangles[i + indicesAhead]]);
            if (i + cornersAhead < triangles.size())
                for (int k = 0; k < 3; ++k)
                    __builtin_prefetch(&mesh_.points[mesh_.triangles[triangles[i + cornersAhead]][k]]);
            const glm::uvec3& t = mesh_.triangles[triangles[i]];
            for (int k = 0; k < 3; ++k)
                for (int axis = 0; axis < 3; ++axis) world_[k][axis][lane] = mesh_.points[t[k]][axis];
            triangles_[lane] = std::int32_t(triangles[i]);
        }
    }

    // Returns corners in voxels.
    VectorLanes<Wide> corner(std::size_t k) {
        const Wide wide;
        const auto at = [&](std::size_t axis) {
            const auto world = hn::PromoteTo(wide, hn::Load(Small(), world_[k][axis]));
            return hn::Mul(world, hn::Set(wide, brick_.voxelsPerUnit));
        };
        const VectorLanes<Wide> corners{at(0), at(1), at(2)};
        keep(corners, known_.corners[k]);
        return corners;
    }

    template <class Rows>
    static void keep(const VectorLanes<Wide>& points, Rows& rows) {
        hn::Store(points.x, Wide(), rows[0]);
        hn::Store(points.y, Wide(), rows[1]);
        hn::Store(points.z, Wide(), rows[2]);
    }

    // Adds the samples of triangles with few rows, several triangles at once. Returns one bit for each other triangle
    // with nonzero area.
    std::uint64_t addFew(std::size_t count) {
        const Wide wide;
        const VectorLanes<Wide> a = corner(0), b = corner(1), c = corner(2), ab = b - a, ac = c - a, bc = c - b,
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
        keep(normal, known_.normal);
        hn::Store(length, wide, known_.length);
        hn::Store(longest2, wide, known_.longest2);
        std::uint8_t bytes[8] = {};
        hn::StoreMaskBits(wide, others, bytes);
        return bytes[0];
    }

    // Adds the samples of Algorithm 1 for as many triangles as there are lanes. Row i has i + 1 samples.
    void addRows(hn::Vec<Small> rows, const VectorLanes<Small>& start, const VectorLanes<Small>& down,
                 const VectorLanes<Small>& across, const VectorLanes<Small>& offset) {
        const Small small;
        const auto owners = hn::Load(hn::RebindToSigned<Small>(), triangles_);
        for (int i = 0;; ++i) {
            const auto row = hn::Set(small, float(i));
            const auto among = hn::Gt(rows, row);
            if (hn::AllFalse(small, among)) return;
            for (int j = 0; j <= i; ++j) {
                const auto column = hn::Set(small, float(j));
                const auto place = [&](auto begin, auto s1, auto s2) {
                    return hn::MulAdd(column, s2, hn::MulAdd(row, s1, begin));
                };
                put(small, among,
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
            put(tag, hn::FirstN(tag, std::size_t(count - k)),
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
                put(tag, hn::FirstN(tag, std::size_t(run.count - k)),
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

    // Adds the samples in the mask `among`, except those too far from the brick.
    template <class Tag>
    HWY_INLINE void put(Tag tag, hn::Mask<Tag> among, const VectorLanes<Tag>& place, const VectorLanes<Tag>& offset,
                        hn::Vec<hn::RebindToSigned<Tag>> triangle) {
        const hn::RebindToSigned<Tag> intTag;
        const auto within = [&](auto at, int axis) {
            return hn::And(hn::Ge(at, hn::Set(tag, cells_.lower[axis])), hn::Le(at, hn::Set(tag, cells_.upper[axis])));
        };
        const auto near = hn::And(hn::And(among, within(place.x, 0)), hn::And(within(place.y, 1), within(place.z, 2)));
        const auto cellAt = [&](auto at) {
            return hn::ConvertTo(intTag, hn::Mul(hn::Sub(at, hn::Set(tag, cells_.firstCorner)),
                                                 hn::Set(tag, 1.f / float(LayerSamples::cellSide))));
        };
        const auto size = hn::Set(intTag, cells_.size);
        const auto cell =
            hn::Add(hn::Mul(hn::Add(hn::Mul(cellAt(place.x), size), cellAt(place.y)), size), cellAt(place.z));
        to_.reserve(to_.count + hn::Lanes(tag));
        const auto compress = [&](auto d, auto values, auto* column) {
            hn::StoreU(hn::Compress(values, hn::RebindMask(d, near)), d, column + to_.count);
        };
        compress(tag, place.x, to_.columns.place[0].data());
        compress(tag, place.y, to_.columns.place[1].data());
        compress(tag, place.z, to_.columns.place[2].data());
        compress(tag, offset.x, to_.columns.offset[0].data());
        compress(tag, offset.y, to_.columns.offset[1].data());
        compress(tag, offset.z, to_.columns.offset[2].data());
        compress(intTag, triangle, to_.columns.triangle.data());
        compress(intTag, cell, to_.cell.data());
        to_.count += hn::CountTrue(tag, near);
    }

    const Mesh& mesh_;
    const SampledBrick& brick_;
    const SampleCells& cells_;
    glm::dvec3 origin_;  // of the brick [index coordinates]
    AddedSamples& to_;
    // One row per component, one column per triangle.
    alignas(64) float world_[3][3][maxLanes];
    alignas(64) std::int32_t triangles_[maxLanes];
    struct {
        alignas(64) double corners[3][3][maxLanes];
        alignas(64) double normal[3][maxLanes], length[maxLanes], longest2[maxLanes];
    } known_;
};

void spread(const Mesh& mesh, std::span<const std::uint32_t> triangles, const SampledBrick& brick,
            const SampleCells& cells, AddedSamples& to) {
    Spreader(mesh, brick, cells, to).run(triangles);
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {
namespace {

HWY_EXPORT(spread);

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
    cells_.around = 1 + int(std::floor((brick.reach - 0.4f) / float(cellSide)));
    cells_.firstCorner = -0.5f - float(cells_.around * cellSide);
    cells_.size = brick.side / cellSide + 2 * cells_.around;
    added_.count = 0;
}

void LayerSamples::add(const Mesh& mesh, std::span<const std::uint32_t> triangles) {
    HWY_DYNAMIC_DISPATCH(spread)(mesh, triangles, *brick_, cells_, added_);
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
