// SPDX-License-Identifier: Apache-2.0
// Queries of fields in tiles.
// Tested by tests/tools/tiled_field.cpp through TiledField.
#include <algorithm>
#include <cstddef>
#include <memory>
#include <numeric>
#include <optional>
#include <vector>

#include <bilayer/collider/field.h>
#include "collider/field/layout/batch.h"
#include "collider/field/layout/ray_paths.h"
#include "collider/field/samples/field_data.h"
#include "collider/field/tiled/tiled_field_data.h"
#include "collider/field/tiled/tiled_search.h"
#include "collider/field/zero/zero_answers.h"

namespace bilayer {

using namespace detail;

TiledField::TiledField(const std::filesystem::path& folder, std::size_t budget, const FieldOptions& options)
    : data_(std::make_shared<const TiledFieldData>(folder, budget, options.storage)) {}

Sample TiledField::sample(const glm::vec3& point) const {
    return data_->sample(point, data_->tileOf(point));
}

// Tile after tile, so that each is read once.
void TiledField::sample(std::span<const glm::vec3> points, std::span<Sample> samples) const {
    requireSameLength(points.size(), "points", samples.size(), "samples");
    std::vector<std::optional<std::size_t>> tiles;
    for (const glm::vec3& point : points) tiles.push_back(data_->tileOf(point));
    std::vector<std::size_t> order(points.size());
    std::iota(order.begin(), order.end(), std::size_t(0));
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return tiles[a] < tiles[b]; });
    std::optional<std::size_t> held;
    std::shared_ptr<const FieldData> tile;
    for (const std::size_t i : order) {
        if (tiles[i] && tiles[i] != held) {
            tile.reset();  // before the next one is read
            tile = data_->hold(*tiles[i]);
            held = tiles[i];
        }
        samples[i] = tiles[i] ? data_->sampleIn(*tile, *held, points[i]) : data_->sample(points[i], std::nullopt);
    }
}

float TiledField::distance(const glm::vec3& point) const {
    return sample(point).distance;
}

bool TiledField::inside(const glm::vec3& point) const {
    return sample(point).distance < 0;
}

ClosestPoint TiledField::closest(const glm::vec3& point, float maxDistance) const {
    const auto nearest = [&](const glm::dvec3& from, double reach) { return nearestZero(*data_, from, reach); };
    return closestZero(data_->frame(), point, maxDistance, nearest, [&] { return inside(point); });
}

std::optional<RayHit> TiledField::raycast(const Ray& ray) const {
    if (!isRay(ray)) return std::nullopt;
    const Path path = pathOf(ray);
    if (const Sample start = sample(ray.origin); start.distance < 0)
        return hitAtStart(start, ray.origin, path.direction);
    return hitZero(data_->frame(), path, [&](const Path& local) { return firstInside(*data_, local); });
}

float TiledField::voxelSize() const noexcept {
    return data_->frame().voxelSize;
}
float TiledField::exteriorWidth() const noexcept {
    return data_->frame().exteriorWidth;
}
float TiledField::interiorWidth() const noexcept {
    return data_->frame().interiorWidth;
}
const Bounds& TiledField::bounds() const noexcept {
    return data_->frame().bounds;
}
std::size_t TiledField::tileCount() const noexcept {
    return data_->tileCount();
}
std::size_t TiledField::tilesRead() const {
    return data_->tiles().reads();
}
std::size_t TiledField::memoryBytes() const {
    return data_->memoryBytes();
}

}  // namespace bilayer
