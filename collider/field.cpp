// How fields are made, and what they say of themselves. Queries have files of their own.
#include "collider/field.h"

#include <bit>
#include <utility>

#include "collider/field_data.h"

namespace bilayer {

void FieldData::fillLanes() {
    const int blockStrides[] = {blocks.y * blocks.z, blocks.z, 0, 1}, voxelStrides[] = {stride * stride, stride, 0, 1};
    for (int lane = 0; lane < 4; ++lane) {
        const int axis = (lane + 1) / 2;
        lanes.origin[lane] = origin[axis];
        lanes.perMetre[lane] = perMetre;
        lanes.fixedPoint[lane] = 1.5 * (std::uint64_t(1) << (52 - fractionBits));  // of a double's 52 bits
        lanes.zeroPlace[lane] = std::bit_cast<std::uint64_t>(double(lanes.fixedPoint[lane]));
        lanes.lastPlace[lane] = (std::uint64_t(side * blocks[axis]) << fractionBits) - 1;
        lanes.blockStrides[lane] = blockStrides[lane];
        lanes.voxelStrides[lane] = voxelStrides[lane];
        lanes.inBlock[lane] = side - 1;
        lanes.fraction[lane] = (1 << fractionBits) - 1;
        lanes.one[lane] = std::bit_cast<std::int32_t>(1.f);
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
