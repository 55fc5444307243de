// SPDX-License-Identifier: Apache-2.0
#include "sdf/fill/clusters.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace bilayer::detail {
namespace {

/// Maximum mean radius for grouping: several smaller pieces share a voxel [voxels].
constexpr double smallRadius = 1.6;
/// Maximum cell count, 4 MiB of counters. Above it, the pieces of a brick are not grouped.
constexpr double maxCells = 1 << 20;
/// Cell side as a multiple of the mean piece radius, and its limits. Measured to be the fastest [voxels].
constexpr float cellFactor = 4.f, minCellSide = 1.1f, maxCellSide = 3.f;
/// Rounding of a cluster's own values [voxels].
constexpr float clusterSlack = 1e-4f;

}  // namespace

void Clusters::build(std::span<const Piece> pieces, const glm::ivec3& origin) {
    members_.clear();
    clusters_.clear();
    if (pieces.empty()) return;
    double radii = 0;
    glm::vec3 lower(1e30f), upper(-1e30f);
    for (std::size_t i = 0; i < pieces.size(); ++i) {
        const Piece& piece = pieces[i];
        const glm::vec3 sample = glm::vec3(piece.base - origin) + piece.sample;
        members_.push_back({sample, piece.radius, piece.n, std::uint32_t(i)});
        radii += double(piece.radius);
        lower = glm::min(lower, sample);
        upper = glm::max(upper, sample);
    }
    const float meanRadius = float(radii / double(pieces.size()));
    const Cells cells(lower, upper, std::clamp(cellFactor * meanRadius, minCellSide, maxCellSide));
    const bool grouped = radii < smallRadius * double(pieces.size()) && cells.count() <= maxCells;
    if (!grouped) {
        for (std::uint32_t i = 0; i < members_.size(); ++i)
            clusters_.push_back({members_[i].sample, members_[i].radius, members_[i].normal, 0, i, i + 1});
        return;
    }
    sort_.run(
        members_, cells, [](const ClusterMember& member) { return member.sample; },
        [&](std::uint32_t begin, std::uint32_t end) { addCluster(begin, end); });
}

void Clusters::addCluster(std::uint32_t begin, std::uint32_t end) {
    glm::vec3 mean(0), normal(0);
    for (std::uint32_t m = begin; m < end; ++m) {
        mean += members_[m].sample;
        normal += members_[m].normal;
    }
    mean /= float(end - begin);
    const float length = glm::length(normal);
    normal = length > 0 ? normal / length : glm::vec3(0, 0, 1);
    // The sample must be a point of the surface: the member sample nearest to the mean.
    const auto nearer = [&](const ClusterMember& a, const ClusterMember& b) {
        const glm::vec3 toA = a.sample - mean, toB = b.sample - mean;
        return glm::dot(toA, toA) < glm::dot(toB, toB);
    };
    const glm::vec3 sample = std::min_element(&members_[begin], &members_[begin] + (end - begin), nearer)->sample;
    float radius = 0, thickness = 0;
    for (std::uint32_t m = begin; m < end; ++m) {
        const ClusterMember& member = members_[m];
        const glm::vec3 away = member.sample - sample;
        // by the cross product: near 1, the cosine is too coarse to give the sine
        const float sine = glm::length(glm::cross(member.normal, normal));
        radius = std::max(radius, glm::length(away) + member.radius);
        thickness = std::max(thickness, std::abs(glm::dot(away, normal)) + member.radius * sine);
    }
    clusters_.push_back({sample, radius + clusterSlack, normal, thickness + clusterSlack, begin, end});
}

}  // namespace bilayer::detail
