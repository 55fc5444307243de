// SPDX-License-Identifier: Apache-2.0
#include "collider/field/tiled/tiled_search.h"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>
#include <vector>

#include "collider/field/zero/zero_set.h"

namespace bilayer::detail {
namespace {

/// The tiles along a path that starts in the field's box, in their order.
class TileWalk {
  public:
    TileWalk(const TiledFieldData& field, const Path& path) : field_(field), path_(path) {
        const glm::ivec3 block(glm::floor(path.origin / double(FieldFrame::side)));
        place_ = field.placeOf(glm::clamp(block, glm::ivec3(0), field.frame().blocks - 1));
        findExit();
    }

    bool isWithin() const {
        return enter_ <= path_.length && place_ == glm::clamp(place_, glm::ivec3(0), field_.counts() - 1);
    }
    std::size_t tile() const { return field_.tileAt(place_); }
    double enter() const { return enter_; }
    double leave() const { return std::min(exit_, path_.length); }

    void step() {
        place_[axis_] += path_.direction[axis_] > 0 ? 1 : -1;
        enter_ = std::max(enter_, exit_);
        if (isWithin()) findExit();
    }

  private:
    void findExit() {
        exit_ = std::numeric_limits<double>::infinity();
        const PlacedTile& tile = field_.placed(field_.tileAt(place_));
        for (int axis = 0; axis < 3; ++axis) {
            if (path_.direction[axis] == 0) continue;
            const double wall = path_.direction[axis] > 0 ? tile.upper[axis] : tile.lower[axis];
            const double at = (wall - path_.origin[axis]) / path_.direction[axis];
            if (at < exit_) exit_ = at, axis_ = axis;
        }
    }

    const TiledFieldData& field_;
    Path path_;
    glm::ivec3 place_{0};
    double enter_ = 0, exit_ = 0;
    int axis_ = 0;
};

}  // namespace

std::optional<ZeroPoint> nearestZero(const TiledFieldData& field, const glm::dvec3& point, double reach) {
    std::vector<std::pair<double, std::size_t>> byDistance;
    for (std::size_t tile = 0; tile < field.tileCount(); ++tile) {
        const PlacedTile& placed = field.placed(tile);
        const double away = glm::distance(point, glm::clamp(point, placed.lower, placed.upper));
        if (placed.hasSurface() && away <= reach) byDistance.emplace_back(away, tile);
    }
    std::sort(byDistance.begin(), byDistance.end());
    std::optional<ZeroPoint> nearest;
    for (const auto& [away, tile] : byDistance) {
        if (away > reach) break;
        const glm::dvec3& shift = field.placed(tile).shift;
        const auto data = field.hold(tile);
        const auto zero = nearestZero(*data, point - shift, reach);
        if (!zero) continue;
        nearest = {*zero + shift, zeroNormal(*data, *zero)};
        reach = glm::distance(point, nearest->position);
    }
    return nearest;
}

std::optional<ZeroPoint> firstInside(const TiledFieldData& field, const Path& path) {
    for (TileWalk walk(field, path); walk.isWithin(); walk.step()) {
        const PlacedTile& placed = field.placed(walk.tile());
        if (!placed.hasSurface()) continue;
        const auto data = field.hold(walk.tile());
        const Path section{path.at(walk.enter()) - placed.shift, path.direction,
                           std::max(0.0, walk.leave() - walk.enter())};
        if (const auto along = firstInside(*data, section)) {
            const glm::dvec3 position = section.at(*along);
            return ZeroPoint{position + placed.shift, zeroNormal(*data, position), walk.enter() + *along};
        }
    }
    return std::nullopt;
}

}  // namespace bilayer::detail
