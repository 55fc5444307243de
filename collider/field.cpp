// How fields are made, and what they say of themselves. Queries have files of their own.
#include "collider/field.h"

#include <utility>

#include "collider/field_data.h"
#include "sdf/sign.h"

namespace bilayer {

FieldData::FieldData(const LevelSet& levelSet, Storage storage)
    : FieldLayout(levelSet, storage),
      kernels(sampleKernels(storage)),
      coarse(clearance()),
      signedByNormals(levelSet.sign() == "normals"),
      sampleError(levelSet.errorBound() + (storage == Storage::fixed16 ? step : 0)) {
    fillLanes();
}

void FieldData::fillLanes() {
    const glm::dvec3 offset = fixedPoint - origin * perMetre;
    lanes.perMetre = Doubles{perMetre, perMetre};
    lanes.offsetXy = Doubles{offset.x, offset.y};
    lanes.offsetYz = Doubles{offset.y, offset.z};
    lanes.fraction = Ints{} + ((1 << fractionBits) - 1);
    lanes.fractionUnit = Floats{} + 1 / float(1 << fractionBits);
    const float unit = storage == Storage::float32 ? 1.f : step, gradient = unit * float(perMetre);
    lanes.scales = Floats{unit, gradient, gradient, gradient};
    lanes.xBlocks = std::uint32_t(blocks.y) * std::uint32_t(blocks.z);
}

Field::Field(const LevelSet& levelSet, const FieldOptions& options)
    : data_(std::make_shared<FieldData>(levelSet, options.storage)), sample_(data_->kernels.samplePoint) {}

Field::Field(const LevelSet& levelSet, Mesh mesh, const FieldOptions& options)
    : Field(Field(levelSet, options), std::make_shared<const Mesh>(outwardMesh(levelSet, std::move(mesh)))) {}

Field::Field(const Field& samples, std::shared_ptr<const Mesh> outward)
    : data_(std::make_shared<FieldData>(*samples.data_, std::move(outward))), sample_(data_->kernels.samplePoint) {}

Clearance Field::clearance() const noexcept {
    return data_->coarse;
}

glm::ivec3 Field::blocks() const noexcept {
    return data_->blocks;
}
bool Field::keeps(const glm::ivec3& block) const noexcept {
    return block == glm::clamp(block, glm::ivec3(0), data_->blocks - 1) &&
           data_->directory.data()[data_->entryOf(block)] >= 0;
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
const FieldLayout& Field::layout() const noexcept {
    return *data_;
}
const Mesh* Field::mesh() const noexcept {
    return data_->mesh ? &data_->mesh->mesh() : nullptr;
}
const MeshTree* Field::tree() const noexcept {
    return data_->mesh.get();
}

std::size_t Field::memoryBytes() const noexcept {
    return data_->memoryBytes() + data_->entries.memoryBytes() + (data_->mesh ? data_->mesh->memoryBytes() : 0);
}

}  // namespace bilayer
