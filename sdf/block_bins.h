// Which balls reach which block of a brick: a counting sort, brick by brick.
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

#include "sdf/blocks.h"

namespace bilayer {

/// The balls of a brick by the blocks that they reach. Memory is used again from brick to brick.
class BlockBins {
  public:
    /// @param balls   each with `sample` [in the voxels of the brick], `radius` around it, and `thickness` of the slab
    ///                around the plane through it with `normal`, that hold all of its contents [voxels]
    /// @param blocks  along the side of the brick
    /// @param reach   how far beyond a ball a voxel may lie [voxels]
    template <class Ball>
    void build(std::span<const Ball> balls, int blocks, float reach) {
        pairs_.clear();
        cursors_.assign(std::size_t(blocks) * std::size_t(blocks) * std::size_t(blocks), 0);
        for (std::uint32_t i = 0; i < balls.size(); ++i)
            forEachBlock(balls[i], blocks, reach, [&](std::uint32_t block) {
                ++cursors_[block];
                pairs_.push_back({block, i});
            });
        offsets_.assign(1, 0);
        std::uint32_t sum = 0;
        for (std::uint32_t& cursor : cursors_) {
            sum += std::exchange(cursor, sum);
            offsets_.push_back(sum);
        }
        balls_.resize(sum);
        for (const Pair& pair : pairs_) balls_[cursors_[pair.block]++] = pair.ball;
    }

    /// The balls that reach a block, in ascending order.
    std::span<const std::uint32_t> at(std::size_t block) const {
        return {balls_.data() + offsets_[block], balls_.data() + offsets_[block + 1]};
    }

  private:
    struct Pair {
        std::uint32_t block, ball;
    };
    static constexpr float slack = 1e-3f;  // far above rounding [voxels]

    template <class Ball, class Visit>
    static void forEachBlock(const Ball& ball, int blocks, float beyond, Visit visit) {
        const float reach = beyond + ball.radius;
        const auto block = [&](float coordinate) { return std::clamp(int(coordinate) / blockSide, 0, blocks - 1); };
        const glm::vec3 lower = ball.sample - reach, upper = ball.sample + reach, normal = glm::abs(ball.normal);
        constexpr float half = 0.5f * float(blockSide - 1);
        const float slab = beyond + ball.thickness + half * (normal.x + normal.y + normal.z) + slack;
        for (int x = block(lower.x); x <= block(upper.x); ++x)
            for (int y = block(lower.y); y <= block(upper.y); ++y)
                for (int z = block(lower.z); z <= block(upper.z); ++z) {
                    const glm::vec3 toCentre = float(blockSide) * glm::vec3(x, y, z) + half - ball.sample;
                    const glm::vec3 away = glm::max(glm::abs(toCentre) - half, glm::vec3(0));
                    if (glm::dot(away, away) < reach * reach && std::abs(glm::dot(toCentre, ball.normal)) < slab)
                        visit(std::uint32_t((x * blocks + y) * blocks + z));
                }
    }

    std::vector<Pair> pairs_;
    std::vector<std::uint32_t> cursors_, offsets_, balls_;
};

}  // namespace bilayer
