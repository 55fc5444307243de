// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/body/interpolation_error.h"

#include "collider/field/samples/field_data.h"

#include <cmath>
#include <cstddef>

#include "collider/field/layout/interpolant.h"
#include "sdf/base/access.h"

namespace bilayer::detail {
namespace {

// Max error of samples [voxels].
constexpr float errorTolerance = 0.1f;
// Count of tested places along each axis of a cell.
constexpr int places = 3;

// Two bits per cell of a block: whether it has been tested, and the result.
constexpr int blockEdge = FieldFrame::side, cellsPerWord = 32,
              wordsPerBlock = blockEdge * blockEdge * blockEdge / cellsPerWord;
constexpr std::uint64_t isTested = 1, isInaccurate = 2;

}  // namespace

InterpolationErrorMask::InterpolationErrorMask(const Field& field)
    : field_(std::make_shared<const Field>(field)),
      known_(new std::atomic<std::uint64_t>[wordsPerBlock * dataOf(field).stored]()) {}

bool InterpolationErrorMask::isMarked(const glm::vec3& point) const noexcept {
    if (!field_) return false;
    const FieldLayout& layout = dataOf(*field_);
    const glm::dvec3 local = (glm::dvec3(point) - layout.origin) * layout.perMetre;
    const glm::dvec3 extent = double(blockEdge) * glm::dvec3(layout.blocks);
    if (!(local.x >= 0 && local.y >= 0 && local.z >= 0)) return false;
    if (!(local.x < extent.x && local.y < extent.y && local.z < extent.z)) return false;
    const glm::ivec3 cell(local), inBlock = cell % blockEdge;
    const std::int32_t block = layout.directory.data()[layout.entryOf(cell / blockEdge)];
    if (block < 0) return false;

    const int index = (inBlock.x * blockEdge + inBlock.y) * blockEdge + inBlock.z, shift = 2 * (index % cellsPerWord);
    std::atomic<std::uint64_t>& word = known_[std::ptrdiff_t(block) * wordsPerBlock + index / cellsPerWord];
    std::uint64_t bits = word.load(std::memory_order_relaxed) >> shift;
    if (!(bits & isTested)) {
        bits = exceedsTolerance(cell) ? isTested | isInaccurate : isTested;
        word.fetch_or(bits << shift, std::memory_order_relaxed);  // another thread may have stored the same result
    }
    return bits & isInaccurate;
}

bool InterpolationErrorMask::exceedsTolerance(const glm::ivec3& cell) const noexcept {
    for (int i = 0; i < places * places * places; ++i) {
        const glm::ivec3 place(i / (places * places), i / places % places, i % places);
        if (isOff(glm::dvec3(cell) + (glm::dvec3(place) + 0.5) / double(places))) return true;
    }
    return false;
}

// Tests a place in voxels from the layout's origin.
bool InterpolationErrorMask::isOff(const glm::dvec3& local) const noexcept {
    const FieldLayout& layout = dataOf(*field_);
    const float voxel = field_->voxelSize();
    const glm::vec3 place(local * layout.voxel + layout.origin);
    const Sample sample = field_->sample(place);
    if (!sample.inBand) return false;
    const ClosestPoint closest = field_->closest(place, std::abs(sample.distance) + maxInterpolationError * voxel);
    return !(std::abs(closest.distance - sample.distance) <= errorTolerance * voxel);
}

}  // namespace bilayer::detail
