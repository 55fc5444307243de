// SPDX-License-Identifier: Apache-2.0
// Finds the balls that reach each block of a brick, by a counting sort per brick.
// Tested by tests/sdf/exact.cpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <utility>
#include <vector>

#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// The balls of a brick, binned by the blocks that they reach. Reuses its memory for each brick.
class BlockBins {
  public:
    /// @param balls   each is a ball of `radius` around `sample` [brick voxels], cut by a slab: `thickness` on each
    ///                side of the plane through `sample` with `normal`. Both contain the ball's contents [voxels].
    /// @param blocks  count along the side of the brick
    /// @param reach   maximum distance of a voxel from a ball that affects it [voxels]
    template <class Ball>
    void build(std::span<const Ball> balls, int blocks, float reach) {
        cursors_.assign(std::size_t(blocks) * std::size_t(blocks) * std::size_t(blocks), 0);
        std::size_t count = 0;
        for (std::uint32_t i = 0; i < balls.size(); ++i) count = addPairs(balls[i], i, blocks, reach, count);
        offsets_.assign(1, 0);
        std::uint32_t sum = 0;
        for (std::uint32_t& cursor : cursors_) {
            sum += std::exchange(cursor, sum);
            offsets_.push_back(sum);
        }
        balls_.resize(sum);
        for (std::size_t i = 0; i < count; ++i) balls_[cursors_[pairs_[i].block]++] = pairs_[i].ball;
    }

    /// Returns the balls that reach a block, in ascending order.
    std::span<const std::uint32_t> at(std::size_t block) const {
        return {balls_.data() + offsets_[block], balls_.data() + offsets_[block + 1]};
    }

  private:
    struct Pair {
        std::uint32_t block, ball;
    };
    static constexpr float slack = 1e-3f;  // tolerance far above rounding [voxels]

    // Appends the pairs of a ball after the first `count`, and returns the new count.
    template <class Ball>
    std::size_t addPairs(const Ball& ball, std::uint32_t index, int blocks, float beyond, std::size_t count) {
        const float reach = beyond + ball.radius;
        constexpr float half = 0.5f * float(blockSide - 1), perBlock = 1.f / float(blockSide);
        const float slab = beyond + ball.thickness + slack +
                           half * (std::abs(ball.normal.x) + std::abs(ball.normal.y) + std::abs(ball.normal.z));
        // Conversion to int truncates toward zero, so coordinates slightly below 0 give block 0.
        const auto block = [&](float coordinate) { return std::clamp(int(coordinate * perBlock), 0, blocks - 1); };
        const glm::vec3 lower = ball.sample - reach, upper = ball.sample + reach;
        const int x1 = block(upper.x), y0 = block(lower.y), y1 = block(upper.y), z0 = block(lower.z),
                  z1 = block(upper.z);
        const auto toCentre = [&](int at, float coordinate) { return float(blockSide * at) + half - coordinate; };
        const auto away2 = [&](float toCentre) {
            const float away = std::max(std::abs(toCentre) - half, 0.f);
            return away * away;
        };
        const int x0 = block(lower.x);
        const std::size_t most = count + std::size_t((x1 - x0 + 1) * (y1 - y0 + 1) * (z1 - z0 + 1));
        if (pairs_.size() < most) pairs_.resize(2 * most);
        for (int x = x0; x <= x1; ++x) {
            const float dx = toCentre(x, ball.sample.x), left = reach * reach - away2(dx), hx = dx * ball.normal.x;
            for (int y = y0; y <= y1; ++y) {
                const float dy = toCentre(y, ball.sample.y), rest = left - away2(dy), hy = hx + dy * ball.normal.y;
                for (int z = z0; z <= z1; ++z) {
                    const float dz = toCentre(z, ball.sample.z);
                    // The pair is always written, and counted only if it reaches. A branch would be mispredicted half
                    // of the time.
                    const auto number = std::uint32_t((x * blocks + y) * blocks + z);
                    const std::uint32_t reaches =
                        unsigned(away2(dz) < rest) & unsigned(std::abs(hy + dz * ball.normal.z) < slab);
                    pairs_[count] = {number, index};
                    count += reaches;
                    cursors_[number] += reaches;
                }
            }
        }
        return count;
    }

    std::vector<Pair> pairs_;
    std::vector<std::uint32_t> cursors_, offsets_, balls_;
};

}  // namespace bilayer::detail
