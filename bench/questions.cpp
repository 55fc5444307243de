// SPDX-License-Identifier: Apache-2.0
#include "bench/questions.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <random>

#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"

namespace bilayer::bench {
namespace {

constexpr double fromCellFaces = 1e-3;  // [voxels]
constexpr float cameraDistance = 1.5f;  // from the box's centre [diagonals of the box]

double cellFaceDistance(const glm::dvec3& voxels) {
    const glm::dvec3 offset = glm::abs(voxels - glm::round(voxels));
    return std::min({offset.x, offset.y, offset.z});
}

// Interleaves the bits of the three coordinates.
std::uint64_t mortonCode(const glm::uvec3& voxel) {
    std::uint64_t code = 0;
    for (int bit = 0; bit < 21; ++bit)
        for (int axis = 0; axis < 3; ++axis) code |= std::uint64_t(voxel[axis] >> bit & 1) << (3 * bit + 2 - axis);
    return code;
}

std::vector<glm::vec3> alongCurve(const std::vector<glm::vec3>& points, const Field& field) {
    std::vector<std::pair<std::uint64_t, glm::vec3>> keyed;
    for (const glm::vec3& p : points)
        keyed.emplace_back(mortonCode(glm::uvec3(glm::max(
                               (glm::dvec3(p) - glm::dvec3(field.bounds().lower)) / double(field.voxelSize()), 0.))),
                           p);
    std::sort(keyed.begin(), keyed.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<glm::vec3> sorted;
    for (const auto& [code, point] : keyed) sorted.push_back(point);
    return sorted;
}

}  // namespace

std::vector<Questions<glm::vec3>> pointsInBand(const Field& field, const LevelSet& levelSet, std::size_t count,
                                               unsigned seed) {
    const openvdb::FloatGrid& grid = *levelSet.grids().distance;
    std::vector<glm::dvec3> leaves;
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf)
        leaves.emplace_back(leaf->origin().x(), leaf->origin().y(), leaf->origin().z());
    std::mt19937 engine(seed);
    std::uniform_int_distribution<std::size_t> anyLeaf(0, leaves.size() - 1);
    std::uniform_real_distribution<double> anyPlace(0, 8);
    const double voxel = grid.voxelSize()[0];
    std::vector<glm::vec3> points;
    while (points.size() < count) {
        const double x = anyPlace(engine), y = anyPlace(engine), z = anyPlace(engine);
        const glm::vec3 point(voxel * (leaves[anyLeaf(engine)] + glm::dvec3(x, y, z)));
        const Sample sample = field.sample(point);
        const bool within = sample.inBand && sample.distance < field.exteriorWidth() - field.voxelSize() &&
                            sample.distance > field.voxelSize() - field.interiorWidth();
        if (within && cellFaceDistance(glm::dvec3(point) / voxel) > fromCellFaces) points.push_back(point);
    }
    return {{"random", points}, {"coherent", alongCurve(points, field)}};
}

std::vector<Questions<Ray>> raysOnto(const Field& field, std::size_t count, unsigned seed) {
    const Bounds& box = field.bounds();
    const float away = cameraDistance * glm::length(box.size()), length = 2 * away;
    std::mt19937 engine(seed);
    std::normal_distribution<float> normal;
    std::uniform_real_distribution<float> part(0, 1);
    std::vector<Ray> random;
    while (random.size() < count) {
        const float x = normal(engine), y = normal(engine), z = normal(engine);
        const glm::vec3 from = box.centre() + away * glm::normalize(glm::vec3(x, y, z));
        const float u = part(engine), v = part(engine), w = part(engine);
        random.push_back({from, glm::normalize(box.lower + glm::vec3(u, v, w) * box.size() - from), length});
    }

    // the camera looks along -z at a window through the middle of the box
    const auto side = int(std::lround(std::sqrt(double(count))));
    const glm::vec3 eye = box.centre() + glm::vec3(0, 0, away);
    std::vector<Ray> image;
    for (int row = 0; row < side; ++row)
        for (int column = 0; column < side; ++column) {
            const glm::vec3 at((float(column) + 0.5f) / float(side), (float(row) + 0.5f) / float(side), 0.5f);
            image.push_back({eye, glm::normalize(box.lower + at * box.size() - eye), length});
        }
    return {{"random", random}, {"coherent", image}};
}

}  // namespace bilayer::bench
