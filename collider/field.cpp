// SPDX-License-Identifier: Apache-2.0
// Construction and properties of fields. Queries are in separate files.
#include <bilayer/collider/field.h>

#include <limits>
#include <utility>

#include "collider/field/samples/field_data.h"
#include "sdf/base/method_names.h"
#include "sdf/sign/sign_choice.h"

namespace bilayer {

using namespace detail;

FieldData::FieldData(const LevelSet& levelSet, Storage storage)
    : FieldLayout(levelSet, storage),
      worldOrigin(levelSet.origin()),
      kernels(sampleKernels(storage)),
      coarse(clearance()),
      signedByNormals(levelSet.sign() == nameOf(Sign::normals)),
      signedByWinding(signedByNormals || levelSet.sign() == nameOf(Sign::winding)),
      sampleError(levelSet.errorBound() + (storage == Storage::fixed16 ? step : 0)) {
    fillLanes();
}

FieldData::FieldData(FieldLayout layout)
    : FieldLayout(std::move(layout)),
      kernels(sampleKernels(storage)),
      coarse(clearance()),
      signedByNormals(false),
      signedByWinding(false),
      sampleError(std::numeric_limits<float>::infinity()) {
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
    : Field(std::make_shared<const FieldData>(levelSet, options.storage)) {}

Field::Field(const LevelSet& levelSet, Mesh mesh, const FieldOptions& options)
    : Field(std::make_shared<const FieldData>(FieldData(levelSet, options.storage),
                                              std::make_shared<const Mesh>(outwardMesh(levelSet, std::move(mesh))))) {}

Field::Field(std::shared_ptr<const FieldData> data) : data_(std::move(data)), sample_(data_->kernels.samplePoint) {}

glm::dvec3 Field::origin() const noexcept {
    return data_->worldOrigin;
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
    return data_->memoryBytes() + data_->entries.memoryBytes() + (data_->mesh ? data_->mesh->memoryBytes() : 0) +
           (data_->winding ? data_->winding->memoryBytes() : 0);
}

}  // namespace bilayer
