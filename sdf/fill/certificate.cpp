// SPDX-License-Identifier: Apache-2.0
#include "sdf/fill/certificate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>

#include "sdf/base/exact_error.h"
#include "sdf/sign/closest_side.h"

namespace bilayer::detail {
namespace {

/// Tolerance for pieces, whose values are rounded to floats of some voxels [voxels].
constexpr double pieceRounding = 1e-5;
/// The voxels of a block are checked in cubes of this side, each against the triangles that may be near it [voxels].
constexpr int partSide = 4;
constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

/// Whether a triangle comes within reach of a voxel of a box; cells that are certainly farther are skipped.
bool reaches(const TriangleCorners& corners, const glm::ivec3& first, const glm::ivec3& size, double reach) {
    const glm::dvec3 half = 0.5 * glm::dvec3(size - 1);
    const double distance = distanceTo(corners, glm::dvec3(first) + half);
    if (distance > reach + glm::length(half)) return false;
    if (size == glm::ivec3(1)) return true;
    const glm::ivec3 lower = glm::max(size / 2, glm::ivec3(1)), upper = size - lower;
    for (int part = 0; part < 8; ++part) {
        glm::ivec3 at = first, of = lower;
        for (int axis = 0; axis < 3; ++axis)
            if ((part >> axis) & 1) at[axis] += lower[axis], of[axis] = upper[axis];
        if (std::min({of.x, of.y, of.z}) > 0 && reaches(corners, at, of, reach)) return true;
    }
    return false;
}

TriangleCorners cornersOf(const Piece& piece) {
    const glm::dvec3 first = glm::dvec3(piece.base) + glm::dvec3(piece.origin), u(piece.u), w(piece.w);
    return {first, first + double(piece.length) * u,
            first + double(piece.olen) * (double(piece.ox) * u + double(piece.oy) * w)};
}

std::string text(const glm::ivec3& voxel) {
    return fmt::format("({}, {}, {})", voxel.x, voxel.y, voxel.z);
}

[[noreturn]] void fail(const std::string& what) {
    throw std::logic_error("the certificate of the exact method does not hold: " + what);
}

}  // namespace

void requireCompleteBins(const Mesh& mesh, const TriangleBins& bins, double voxelsPerUnit, float reach) {
    std::map<std::array<int, 3>, std::size_t> bricks;
    for (std::size_t brick = 0; brick < bins.count(); ++brick) {
        const glm::ivec3& origin = bins.origins[brick];
        bricks[{origin.x, origin.y, origin.z}] = brick;
    }
    std::vector<std::uint32_t> all(mesh.triangles.size());
    std::iota(all.begin(), all.end(), 0u);
    forEachTriangle(mesh, all, voxelsPerUnit, [&](std::uint32_t triangle, const TriangleCorners& c) {
        const auto brickOf = [&](const glm::dvec3& point) { return glm::ivec3(glm::floor(point / double(bins.side))); };
        const glm::ivec3 lower = brickOf(glm::min(c[0], glm::min(c[1], c[2])) - double(reach));
        const glm::ivec3 upper = brickOf(glm::max(c[0], glm::max(c[1], c[2])) + double(reach));
        for (int x = lower.x; x <= upper.x; ++x)
            for (int y = lower.y; y <= upper.y; ++y)
                for (int z = lower.z; z <= upper.z; ++z) {
                    const glm::ivec3 origin = bins.side * glm::ivec3(x, y, z);
                    const auto brick = bricks.find({origin.x, origin.y, origin.z});
                    if (brick != bricks.end()) {
                        const auto binned = bins.trianglesOf(brick->second);
                        if (std::binary_search(binned.begin(), binned.end(), triangle)) continue;
                    }
                    if (reaches(c, origin, glm::ivec3(bins.side), double(reach) - double(exactError)))
                        fail(fmt::format("triangle {} is not in the brick at {}, whose voxels it reaches", triangle,
                                         text(origin)));
                }
    });
}

void requireCovered(std::span<const Piece> pieces, std::span<const Cluster> clusters,
                    std::span<const ClusterMember> members, const glm::ivec3& brick) {
    for (const Piece& piece : pieces) {
        const glm::dvec3 sample = glm::dvec3(piece.base) + glm::dvec3(piece.sample);
        for (const glm::dvec3& corner : cornersOf(piece))
            if (!(glm::distance(corner, sample) <= double(piece.radius) + pieceRounding))
                fail(fmt::format("a piece of triangle {} leaves the circle about its sample", piece.triangle));
    }
    for (const Cluster& cluster : clusters)
        for (std::uint32_t m = cluster.begin; m < cluster.end; ++m) {
            const Piece& piece = pieces[members[m].piece];
            for (const glm::dvec3& corner : cornersOf(piece)) {
                const glm::dvec3 away = corner - glm::dvec3(brick) - glm::dvec3(cluster.sample);
                const double height = std::abs(glm::dot(away, glm::dvec3(cluster.normal)));
                if (!(glm::length(away) <= double(cluster.radius) + exactError &&
                      height <= cluster.thickness + exactError))
                    fail(fmt::format("a piece of triangle {} leaves the cylinder of its cluster", piece.triangle));
            }
        }
}

BlockCheck::BlockCheck(const Mesh& mesh, std::span<const std::uint32_t> triangles, double voxelsPerUnit) {
    balls_.reserve(triangles.size());
    forEachTriangle(mesh, triangles, voxelsPerUnit, [&](std::uint32_t triangle, const TriangleCorners& c) {
        const glm::dvec3 centre = (c[0] + c[1] + c[2]) / 3.0;
        const double radius =
            std::max({glm::distance(c[0], centre), glm::distance(c[1], centre), glm::distance(c[2], centre)});
        balls_.push_back({c, centre, radius, triangle});
    });
}

void BlockCheck::require(const glm::ivec3& origin, std::span<const Piece> pieces, const BlockDistances& block,
                         float reach) {
    for (int part = 0; part < 8; ++part)
        requirePart(origin, partSide * glm::ivec3(part / 4, part / 2 % 2, part % 2), pieces, block, reach);
}

void BlockCheck::requirePart(const glm::ivec3& origin, const glm::ivec3& first, std::span<const Piece> pieces,
                             const BlockDistances& block, float reach) {
    std::array<Voxel, std::size_t(partSide * partSide * partSide)> voxels;
    double maxDistance = 0;
    for (int i = 0; i < int(voxels.size()); ++i) {
        const glm::ivec3 inBlock = first + glm::ivec3(i / 16, i / 4 % 4, i % 4);
        const int voxel = (inBlock.x * blockSide + inBlock.y) * blockSide + inBlock.z;
        const std::int32_t nearest = block.nearest[voxel] >> sideBits;
        const double distance = nearest < 0 ? double(reach) : double(block.distance[voxel]);
        voxels[std::size_t(i)] = {origin + inBlock, distance,
                                  nearest < 0 ? none : pieces[std::size_t(nearest)].triangle};
        maxDistance = std::max(maxDistance, distance);
    }
    const double half = 0.5 * (partSide - 1);
    const glm::dvec3 middle = glm::dvec3(origin + first) + half;
    near_.clear();
    for (const Ball& ball : balls_)
        if (glm::distance(middle, ball.centre) <= ball.radius + maxDistance + std::sqrt(3.0) * half + exactError)
            near_.push_back(&ball);
    for (const Voxel& voxel : voxels) requireVoxel(voxel);
}

void BlockCheck::requireVoxel(const Voxel& voxel) const {
    double own = std::numeric_limits<double>::infinity();
    for (const Ball* ball : near_) {
        const bool isOwn = ball->triangle == voxel.triangle;
        if (!isOwn && glm::distance(glm::dvec3(voxel.at), ball->centre) > ball->radius + voxel.distance) continue;
        const double found = distanceTo(ball->corners, glm::dvec3(voxel.at));
        if (isOwn) own = found;
        if (found < voxel.distance - double(exactError))
            fail(fmt::format("voxel {} has the distance {}, but triangle {} is {} voxels away", text(voxel.at),
                             voxel.distance, ball->triangle, found));
    }
    if (voxel.triangle != none && !(own <= voxel.distance + double(exactError)))
        fail(fmt::format("voxel {} has the distance {}, but its nearest triangle {} is {} voxels away", text(voxel.at),
                         voxel.distance, voxel.triangle, own));
}

}  // namespace bilayer::detail
