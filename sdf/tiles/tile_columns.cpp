// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/tile_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <glm/common.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "sdf/grid/field_part.h"
#include "sdf/sign/triangle_columns.h"
#include "sdf/tiles/hashed_record.h"

namespace bilayer::detail {
namespace {

BlockBox ownOf(const Tiling& tiling, std::size_t tile) {
    return tiling.own(tile).within(tiling.lattice());
}

// The sums without rows and columns of zeros at their borders.
ColumnSums trimmed(const ColumnSums& sums) {
    glm::ivec2 low = sums.end(), high = sums.first();
    for (int x = sums.first().x; x < sums.end().x; ++x)
        for (int y = sums.first().y; y < sums.end().y; ++y)
            if (sums.at(x, y) != 0) {
                low = glm::min(low, glm::ivec2(x, y));
                high = glm::max(high, glm::ivec2(x, y) + 1);
            }
    ColumnSums inner(low, high);
    inner.add(sums);
    return inner;
}

}  // namespace

ColumnSums crossingsOf(std::span<const TileTriangle> triangles, const Tiling& tiling, std::size_t tile,
                       float voxelSize) {
    const double voxelsPerUnit = 1 / double(voxelSize);
    const BlockBox own = tiling.own(tile), box = ownOf(tiling, tile);
    ColumnSums sums(glm::ivec2(box.first), glm::ivec2(box.end));
    for (const TileTriangle& t : triangles) {
        const auto corner = [&](int k) { return glm::dvec3(t.corners[k]) * voxelsPerUnit; };
        const TriangleColumns crossed(corner(0), corner(1), corner(2));
        const IntegerInterval xs = crossed.xs().within({box.first.x, box.end.x - 1});
        const IntegerInterval ys = crossed.ys().within({box.first.y, box.end.y - 1});
        for (std::int64_t x = xs.first; x <= xs.last; ++x)
            for (std::int64_t y = ys.first; y <= ys.last; ++y) {
                const glm::dvec2 at(x, y);
                const int sign = crossed.crossing(at);
                if (sign == 0) continue;
                if (!crossed.isCertain(at))
                    throw std::invalid_argument(fmt::format(
                        "triangle {}, counted from 0, is vertical but for rounding, and only the whole mesh can decide "
                        "the sides above it: build this field in one piece",
                        t.number));
                const std::int32_t above = crossed.firstAbove(at);
                if (above >= own.first.z && above < own.end.z) sums.add(int(x), int(y), sign);
            }
    }
    return sums;
}

ColumnSums crossingsBelow(const Tiling& tiling, std::size_t tile,
                          const std::function<ColumnSums(std::size_t)>& sumsOf) {
    const FieldPart part{tiling.mesh(), 0, tiling.lattice(), tiling.own(tile), {}};
    const BlockBox box = part.filled().within(part.lattice);
    const glm::ivec3 place = tiling.place(tile);
    ColumnSums below{glm::ivec2(box.first), glm::ivec2(box.end)};
    for (int x = place.x; x <= std::min(place.x + 1, tiling.counts().x - 1); ++x)
        for (int y = place.y; y <= std::min(place.y + 1, tiling.counts().y - 1); ++y)
            for (int z = 0; z < place.z; ++z) below.add(sumsOf(tiling.tileAt({x, y, z})));
    return below;
}

void writeColumnSums(const std::filesystem::path& path, const ColumnSums& sums) {
    const ColumnSums inner = trimmed(sums);
    HashedRecordWriter record;
    record.add(inner.first());
    record.add(inner.end());
    record.add(std::vector<std::int32_t>(inner.values().begin(), inner.values().end()));
    record.write(path);
}

ColumnSums readColumnSums(const std::filesystem::path& path) {
    HashedRecordReader record(path);
    const auto first = record.value<glm::ivec2>(), end = record.value<glm::ivec2>();
    const auto values = record.values<std::int32_t>();
    const glm::dvec2 size = glm::dvec2(end) - glm::dvec2(first);
    if (!(size.x >= 0 && size.y >= 0 && size.x * size.y == double(values.size()))) record.fail();
    ColumnSums sums(first, end);
    std::copy(values.begin(), values.end(), sums.values().begin());
    return sums;
}

}  // namespace bilayer::detail
