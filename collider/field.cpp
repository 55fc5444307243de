// Rays by sphere tracing. field_sample.cpp has the samples.
#include "collider/field.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "collider/field_data.h"

namespace bilayer {
namespace {

constexpr double smallestStep = 0.1;   // of a ray [voxels]: bounds the steps of rays that graze the surface
constexpr double rayTolerance = 1e-5;  // [voxels]

// Where between two lengths along a ray the interpolant changes its sign.
double crossing(const FieldData& field, const glm::dvec3& start, const glm::dvec3& direction, double outside,
                double inside) {
    while (inside - outside > rayTolerance) {
        const double middle = 0.5 * (outside + inside);
        (field.sample(start + middle * direction).distance < 0 ? inside : outside) = middle;
    }
    return inside;
}

// Sphere tracing along a unit direction [voxels]. In the band the interpolant may be steeper than 1, by sqrt(3) at
// most.
std::optional<double> trace(const FieldData& field, const glm::dvec3& start, const glm::dvec3& direction,
                            double length) {
    double outside = 0;
    for (double along = 0;;) {
        const Sample here = field.sample(start + along * direction);
        if (here.distance < 0) return crossing(field, start, direction, outside, along);
        if (along >= length) return std::nullopt;
        outside = along;
        const double way = here.distance / field.voxel;
        along = std::min(length, along + std::max(here.inBand ? way / FieldData::cellDiagonal : way, smallestStep));
    }
}

}  // namespace

void FieldData::fillLanes() {
    const int blockStrides[] = {blocks.y * blocks.z, blocks.z, 0, 1}, voxelStrides[] = {stride * stride, stride, 0, 1};
    for (int lane = 0; lane < 4; ++lane) {
        const int axis = (lane + 1) / 2;
        lanes.origin[lane] = origin[axis];
        lanes.perMetre[lane] = perMetre;
        lanes.fixedPoint[lane] = 1.5 * (std::uint64_t(1) << (52 - fractionBits));  // of a double's 52 bits
        lanes.lastPlace[lane] = (std::uint64_t(side * blocks[axis]) << fractionBits) - 1;
        lanes.blockStrides[lane] = blockStrides[lane];
        lanes.voxelStrides[lane] = voxelStrides[lane];
        lanes.inBlock[lane] = side - 1;
        lanes.fraction[lane] = (1 << fractionBits) - 1;
        lanes.one[lane] = 1;
        lanes.least[lane] = -interiorWidth;
        lanes.most[lane] = exteriorWidth;
        lanes.scales[lane] = lane == 0 ? 1.f : float(perMetre);
    }
}

Field::Field(const LevelSet& levelSet, const FieldOptions& options)
    : data_(std::make_shared<FieldData>(levelSet, options.storage)) {}

Field::Field(const LevelSet& levelSet, Mesh mesh, const FieldOptions& options)
    : data_(std::make_shared<FieldData>(levelSet, std::move(mesh), options.storage)) {}

Clearance Field::clearance() const noexcept {
    return data_->coarse;
}

glm::dvec3 Field::origin() const noexcept {
    return data_->origin;
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
    const auto along = trace(*data_, start, unit, std::min(leave - enter, glm::length(size)));
    if (!along) return std::nullopt;

    const glm::dvec3 hit = start + *along * unit;
    const glm::vec3 gradient = data_->sample(hit, std::numeric_limits<float>::infinity()).gradient;
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
    return data_->memoryBytes() + data_->entries.memoryBytes() + (data_->mesh ? data_->mesh->memoryBytes() : 0);
}

}  // namespace bilayer
