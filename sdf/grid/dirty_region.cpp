// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/dirty_region.h"

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_reduce.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <vector>

#include "sdf/base/openvdb.h"

namespace bilayer::detail {
namespace {

/// Exceeds what binning and clustering add to the reach for rounding [voxels].
constexpr double roundingSlack = 2;
/// A triangle whose box spans more cells than this is tested against each cell.
constexpr int cellsWorthCulling = 8;
constexpr std::size_t trianglesPerTask = 1024;

// Compares bits: builds must be bit-identical, so 0 and -0 differ.
bool sameCorners(const Mesh& a, const Mesh& b, std::size_t triangle) {
    for (int k = 0; k < 3; ++k)
        if (std::memcmp(&a.points[a.triangles[triangle][k]], &b.points[b.triangles[triangle][k]], sizeof(glm::vec3)))
            return false;
    return true;
}

glm::ivec3 floorToInt(const glm::dvec3& v) {
    return {int(std::floor(v.x)), int(std::floor(v.y)), int(std::floor(v.z))};
}

// Visits all integer points of a box, including both ends.
template <class Visit>
void forEachIn(const glm::ivec3& lower, const glm::ivec3& upper, Visit visit) {
    for (int x = lower.x; x <= upper.x; ++x)
        for (int y = lower.y; y <= upper.y; ++y)
            for (int z = lower.z; z <= upper.z; ++z) visit(glm::ivec3(x, y, z));
}

}  // namespace

void checkMoved(const Mesh& before, const Mesh& after, std::span<const std::uint32_t> moved) {
    const std::size_t count = before.triangles.size();
    if (after.triangles.size() != count)
        throw std::invalid_argument(
            fmt::format("the mesh had {} triangles and now has {}", count, after.triangles.size()));
    std::vector<char> listed(count, 0);
    for (const std::uint32_t triangle : moved) {
        if (triangle >= count)
            throw std::invalid_argument(
                fmt::format("moved has triangle {}, but there are only {} triangles", triangle, count));
        listed[triangle] = 1;
    }
    const std::size_t first = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, count, trianglesPerTask), count,
        [&](const auto& range, std::size_t smallest) {
            for (std::size_t i = range.begin(); i < std::min(range.end(), smallest); ++i)
                if (!listed[i] && !sameCorners(before, after, i)) return i;
            return smallest;
        },
        [](std::size_t a, std::size_t b) { return std::min(a, b); });
    if (first < count)
        throw std::invalid_argument(fmt::format("moved lacks triangle {}, which has other corners now", first));
}

DirtyRegion::DirtyRegion(const Mesh& before, const Mesh& after, std::span<const std::uint32_t> moved,
                         double voxelsPerUnit, float reach, int side)
    : shift_(std::countr_zero(unsigned(side))) {
    tbb::enumerable_thread_specific<openvdb::MaskTree> parts;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, moved.size(), trianglesPerTask), [&](const auto& range) {
        openvdb::tree::ValueAccessor<openvdb::MaskTree> cells(parts.local());
        for (std::size_t i = range.begin(); i < range.end(); ++i)
            for (const Mesh* mesh : {&before, &after})
                add(*mesh, mesh->triangles[moved[i]], voxelsPerUnit, double(reach) + roundingSlack, cells);
    });
    for (const openvdb::MaskTree& part : parts) cells_.topologyUnion(part);
}

void DirtyRegion::add(const Mesh& mesh, const glm::uvec3& triangle, double voxelsPerUnit, double reach,
                      openvdb::tree::ValueAccessor<openvdb::MaskTree>& cells) const {
    const auto corner = [&](unsigned i) { return glm::dvec3(mesh.points[i]) * voxelsPerUnit; };
    const glm::dvec3 a = corner(triangle.x), b = corner(triangle.y), c = corner(triangle.z);
    const glm::ivec3 lower = floorToInt(glm::min(a, glm::min(b, c)) - reach) >> shift_,
                     upper = floorToInt(glm::max(a, glm::max(b, c)) + reach) >> shift_;
    const glm::ivec3 extent = upper - lower + 1;
    const bool large = std::int64_t(extent.x) * extent.y * extent.z > cellsWorthCulling;
    const double half = 0.5 * double(1 << shift_);
    const glm::dvec3 normal = large ? glm::cross(b - a, c - a) : glm::dvec3(0);
    const double room = glm::dot(glm::abs(normal), glm::dvec3(half)) + reach * glm::length(normal);
    forEachIn(lower, upper, [&](const glm::ivec3& cell) {
        // the plane of the triangle is too far from the cell
        if (large && std::abs(glm::dot(normal, glm::dvec3(cell * (1 << shift_)) + half - a)) > room) return;
        cells.setValueOn(coordOf(cell));
    });
}

bool DirtyRegion::any(const glm::ivec3& first, int side) const {
    const glm::ivec3 lower = first >> shift_, upper = (first + (side - 1)) >> shift_;
    bool found = false;
    forEachIn(lower, upper, [&](const glm::ivec3& cell) { found = found || cells_.isValueOn(coordOf(cell)); });
    return found;
}

}  // namespace bilayer::detail
