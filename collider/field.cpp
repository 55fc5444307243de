// Samples and rays on a level set laid out for them. cl/field.cl samples in the same way.
#include "collider/field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "collider/field_data.h"

namespace bilayer {
namespace {

constexpr float cellDiagonal = 1.7320508f;  // [voxels]; also the Lipschitz bound of the trilinear interpolant
constexpr double smallestStep = 0.1;        // of a ray [voxels]: bounds the steps of rays that graze the surface
constexpr double rayTolerance = 1e-5;       // [voxels]
constexpr float infinity = std::numeric_limits<float>::infinity();

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

}  // namespace

// With the gradient where the distance is no more than some length.
Sample Field::Data::sample(const glm::dvec3& local, float gradientReach) const {
    // compared before any conversion to integers, so that NaN and huge coordinates end here
    const glm::dvec3 size = extent();
    const bool within =
        local.x >= 0 && local.y >= 0 && local.z >= 0 && local.x < size.x && local.y < size.y && local.z < size.z;
    if (!within) return {.distance = boundOutside(local)};

    const glm::ivec3 voxel(local), block = voxel >> 3, inBlock = voxel & 7;
    const std::int32_t entry = directory[entryOf(block)];
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

Field::Field(const LevelSet& levelSet, Mesh mesh) : data_(std::make_shared<Data>(levelSet, std::move(mesh))) {}

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
const Mesh* Field::mesh() const noexcept {
    return data_->mesh ? &data_->mesh->mesh() : nullptr;
}

std::size_t Field::memoryBytes() const noexcept {
    return sizeof(Data) + data_->directory.size() * sizeof(std::int32_t) +
           data_->clearances.size() * sizeof(Clearance::Part) +
           data_->stored * FieldLayout::blockFloats * sizeof(float) + (data_->mesh ? data_->mesh->memoryBytes() : 0);
}

}  // namespace bilayer
