// SPDX-License-Identifier: Apache-2.0
// An exact distance transform of the coarse cells that the surface may meet.
#include "collider/field/layout/coarse_distance.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/base/large_array.h"

namespace bilayer::detail {
namespace {

constexpr int perBlock = Clearance::perBlock, blockCells = Clearance::blockCells;
constexpr int maxCells = 16;  // distance limit of the bounds [coarse cells]
static_assert(maxCells <= perBlock * clearanceReach);

// Squared distances from the centres of coarse cells to the nearest one that the surface meets. The unit is half a
// coarse cell, so that distances to faces are integers.
using SquaredSteps = std::int16_t;
constexpr SquaredSteps farAway = 4 * maxCells * maxCells;

// The increase of a squared distance to the near face of a coarse cell `d` places away.
constexpr SquaredSteps squaredStepsTo(int d) {
    return SquaredSteps((2 * d - 1) * (2 * d - 1));
}

// Lowers squared distances to those of others plus an increment. Returns false if no larger increment can lower any.
bool lower(SquaredSteps* squares, const SquaredSteps* others, std::size_t count, SquaredSteps more) {
    SquaredSteps largest = 0;
    for (std::size_t i = 0; i < count; ++i) {
        largest = std::max(largest, squares[i]);
        squares[i] = std::min(squares[i], SquaredSteps(others[i] + more));
    }
    return largest > more;
}

// Lowers each squared distance along the last axis to the minimum of the others plus their increments (as P.
// Felzenszwalb, D. Huttenlocher, "Distance transforms of sampled functions", 2012, but to the faces of coarse cells).
void transformRow(SquaredSteps* squares, int length, std::vector<SquaredSteps>& before) {
    before.assign(squares, squares + length);
    for (int d = 1; d <= std::min(maxCells, length - 1); ++d) {
        const std::size_t count = length - d;
        const bool up = lower(squares + d, before.data(), count, squaredStepsTo(d));
        const bool down = lower(squares, before.data() + d, count, squaredStepsTo(d));
        if (!up && !down) break;
    }
}

// The same across rows of `count` values with a stride of `step`.
void transformRows(SquaredSteps* squares, std::size_t count, std::size_t step, int length,
                   std::vector<SquaredSteps>& before) {
    before.resize(std::size_t(length) * count);
    for (int i = 0; i < length; ++i) std::copy_n(squares + i * step, count, before.data() + i * count);
    for (int i = 0; i < length; ++i) {
        bool more = true;
        for (int d = 1; more && d <= maxCells; ++d) {
            more = false;
            if (i >= d) more |= lower(squares + i * step, before.data() + (i - d) * count, count, squaredStepsTo(d));
            if (i + d < length)
                more |= lower(squares + i * step, before.data() + (i + d) * count, count, squaredStepsTo(d));
        }
    }
}

// Distance transform. Input: 0 for coarse cells that meet the surface, `farAway` for others. Processes one axis after
// the other, since a squared distance is a sum over the axes.
void transform(LargeArray<SquaredSteps>& squares, const glm::ivec3& size) {
    const std::size_t row = std::size_t(size.z), plane = size.y * row;
    tbb::parallel_for(0, size.x, [&](int x) {
        std::vector<SquaredSteps> before;
        for (int y = 0; y < size.y; ++y) transformRow(squares.data() + x * plane + y * row, size.z, before);
        transformRows(squares.data() + x * plane, row, row, size.y, before);
    });
    tbb::parallel_for(0, size.y, [&](int y) {
        std::vector<SquaredSteps> before;
        transformRows(squares.data() + y * row, row, plane, size.x, before);
    });
}

// The coarse cells of a box of blocks.
struct Cells {
    glm::ivec3 size;                             // along each axis
    std::array<std::size_t, blockCells> next{};  // offsets of a block's cells from its first
    LargeArray<SquaredSteps> squares;

    explicit Cells(const glm::ivec3& blocks)
        : size(perBlock * blocks), squares(std::size_t(size.x) * std::size_t(size.y) * std::size_t(size.z)) {
        for (int k = 0; k < blockCells; ++k) next[std::size_t(k)] = indexOf({k >> 2, k >> 1 & 1, k & 1});
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, squares.size()), [&](const auto& range) {
            std::fill(squares.data() + range.begin(), squares.data() + range.end(), farAway);
        });
    }

    std::size_t indexOf(const glm::ivec3& cell) const {
        return (std::size_t(cell.x) * std::size_t(size.y) + std::size_t(cell.y)) * std::size_t(size.z) +
               std::size_t(cell.z);
    }

    void enter(const SurfaceBlock& block, const glm::ivec3& place) {
        const std::size_t cell = indexOf(perBlock * place);
        for (int k = 0; k < blockCells; ++k)
            if (block.meets >> k & 1) squares[cell + next[std::size_t(k)]] = 0;
    }
};

// The square roots of all squared distances, rounded down [steps].
std::array<std::int8_t, farAway + 1> rootsOfSquares() {
    std::array<std::int8_t, farAway + 1> roots;
    for (int square = 0; square <= farAway; ++square)
        roots[square] =
            std::int8_t(std::min(Clearance::maxDistanceSteps, int(0.5f * Clearance::steps * std::sqrt(float(square)))));
    return roots;
}

}  // namespace

void measureClearances(FieldLayout& field, const glm::ivec3& first, std::span<const SurfaceBlock> surface, int margin) {
    field.centres = LargeArray<std::int8_t>(field.entries() * blockCells);
    if (!field.findsSurface()) {
        std::fill_n(field.centres.data(), field.centres.size(), std::int8_t(0));
        return;
    }
    const glm::ivec3 blocks = field.blocks + 2 * margin;
    Cells cells(blocks);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, surface.size()), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            const glm::ivec3 place = (surface[i].first - first) / FieldFrame::side + margin;
            if (place == glm::clamp(place, glm::ivec3(0), blocks - 1)) cells.enter(surface[i], place);
        }
    });
    transform(cells.squares, cells.size);
    const auto roots = rootsOfSquares();
    tbb::parallel_for(0, field.blocks.x, [&](int x) {
        for (int y = 0; y < field.blocks.y; ++y)
            for (int z = 0; z < field.blocks.z; ++z) {
                const std::size_t entry = field.entryOf({x, y, z});
                const std::size_t cell = cells.indexOf(perBlock * (glm::ivec3(x, y, z) + margin));
                const std::int32_t block = field.directory[entry];
                const bool emptyInside = block == FieldLayout::emptyInside;
                for (std::size_t k = 0; k < blockCells; ++k) {
                    const std::int8_t root = roots[std::size_t(cells.squares[cell + cells.next[k]])];
                    const bool inside = block < 0 ? emptyInside : field.minima[std::size_t(block) * blockCells + k] < 0;
                    field.centres[entry * blockCells + k] = std::int8_t(inside ? -root : root);
                }
            }
    });
}

}  // namespace bilayer::detail
