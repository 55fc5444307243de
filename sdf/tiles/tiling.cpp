// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/tiling.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "sdf/base/method_names.h"
#include "sdf/grid/field_part.h"
#include "sdf/leaf/build_options.h"
#include "sdf/leaf/build_size.h"

namespace bilayer::detail {
namespace {

/// Margin of the limits of exact.cpp, which discard triangles of a brick [voxels].
constexpr double limitsMargin = 1;

float reachOf(const BuildOptions& options) {
    if (hasOwnSigns(options.method)) return layerReach(fillParameters(options));
    return detail::reachOf(options, options.sign == Sign::flood ? Sign::flood : Sign::normals);
}

// Returns the bounds, unless index coordinates would leave 32 bits.
const Bounds& checked(const Bounds& mesh, const BuildOptions& options) {
    for (int axis = 0; axis < 3; ++axis)
        for (const float end : {mesh.lower[axis], mesh.upper[axis]})
            if (!(std::abs(double(end) / double(options.voxelSize)) < maxIndexCoordinate))
                throw std::invalid_argument(
                    fmt::format("voxelSize {:g} is too small for this mesh: index coordinates would leave 32 bits",
                                options.voxelSize));
    return mesh;
}

}  // namespace

void requireLocal(const BuildOptions& options) {
    const auto refuse = [](const std::string& what, const char* why) {
        throw std::invalid_argument(fmt::format("tiles have no {}: {}", what, why));
    };
    if (options.method != Method::exact && options.method != Method::doubleLayer)
        refuse(fmt::format("method {}", nameOf(options.method)),
               "its distances depend on the whole mesh; take exact or double-layer");
    if (options.unite) refuse("union", "walls inside other solids are found from the whole mesh");
}

Tiling::Tiling(const Bounds& mesh, const BuildOptions& options, const glm::ivec3& counts)
    : mesh_(checked(mesh, options)),
      counts_(counts),
      reach_(reachOf(options)),
      bricks_(mesh, 1.0 / double(options.voxelSize), double(reach_)) {
    checkOptions(options);
    for (int axis = 0; axis < 3; ++axis) {
        if (counts[axis] < 1 || counts[axis] > bricks_.size[axis])
            throw std::invalid_argument(fmt::format(
                "{} tiles along {}: the field has room for 1 to {}, since a tile is at least {} voxels wide",
                counts[axis], "xyz"[axis], bricks_.size[axis], brickSide()));
        tileOfBrick_[axis].resize(std::size_t(bricks_.size[axis]));
        for (int tile = 0; tile < counts[axis]; ++tile)
            for (int brick = border(axis, tile); brick < border(axis, tile + 1); ++brick)
                tileOfBrick_[axis][std::size_t(brick)] = std::uint32_t(tile);
    }
}

glm::ivec3 Tiling::place(std::size_t tile) const {
    const auto y = std::size_t(counts_.y), z = std::size_t(counts_.z);
    return {int(tile / z / y), int(tile / z % y), int(tile % z)};
}

std::size_t Tiling::tileAt(const glm::ivec3& place) const {
    return (std::size_t(place.x) * std::size_t(counts_.y) + std::size_t(place.y)) * std::size_t(counts_.z) +
           std::size_t(place.z);
}

int Tiling::border(int axis, int tile) const {
    return int(std::int64_t(bricks_.size[axis]) * tile / counts_[axis]);
}

BlockBox Tiling::lattice() const {
    return {bricks_.first * brickSide(), (bricks_.first + bricks_.size) * brickSide()};
}

BlockBox Tiling::own(std::size_t tile) const {
    BlockBox box{glm::ivec3(-unbounded), glm::ivec3(unbounded)};
    const glm::ivec3 at = place(tile);
    for (int axis = 0; axis < 3; ++axis) {
        if (at[axis] > 0) box.first[axis] = (bricks_.first[axis] + border(axis, at[axis])) * brickSide();
        if (at[axis] + 1 < counts_[axis])
            box.end[axis] = (bricks_.first[axis] + border(axis, at[axis] + 1)) * brickSide();
    }
    return box;
}

TriangleLimits Tiling::limits(std::size_t tile) const {
    const FieldPart part{mesh_, 0, lattice(), own(tile), {}};
    const BlockBox box = part.filled().within(part.lattice);
    const double margin = double(reach_) + limitsMargin;
    return {glm::dvec3(box.first) - margin, glm::dvec3(box.end - 1) + margin};
}

void Tiling::add(std::size_t tile) {
    if (std::find(found_.begin(), found_.end(), tile) == found_.end()) found_.push_back(tile);
}

// The tile of the brick, and those whose next layer of blocks lies in the brick.
void Tiling::addTilesOf(const glm::ivec3& brick, const TriangleCorners& corners) {
    glm::ivec3 own, below;
    for (int axis = 0; axis < 3; ++axis) {
        own[axis] = int(tileOfBrick_[axis][std::size_t(brick[axis])]);
        below[axis] = own[axis] - int(own[axis] > 0 && border(axis, own[axis]) == brick[axis]);
    }
    add(tileAt(own));
    if (own == below) return;
    for (int x = below.x; x <= own.x; ++x)
        for (int y = below.y; y <= own.y; ++y)
            for (int z = below.z; z <= own.z; ++z)
                if (const std::size_t tile = tileAt({x, y, z}); !misses(corners, limits(tile))) add(tile);
}

}  // namespace bilayer::detail
