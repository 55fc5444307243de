// SPDX-License-Identifier: Apache-2.0
#include "sdf/bvh/oriented_groups.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <limits>

#include "sdf/base/jacobi_rotation.h"
#include "sdf/base/polled_loop.h"
#include "sdf/bvh/triangle_tree.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t levels = 3;        // of groups with oriented boxes
constexpr std::size_t triangles = 4096;  // per task, about

glm::dvec3 cornerOf(const TriangleLeaf& leaf, int corner, std::size_t i) {
    return {leaf.corners[corner][0][i], leaf.corners[corner][1][i], leaf.corners[corner][2][i]};
}

glm::dvec3 areaVector(const TriangleLeaf& leaf, std::size_t i) {
    const glm::dvec3 a = cornerOf(leaf, 0, i);
    return glm::cross(cornerOf(leaf, 1, i) - a, cornerOf(leaf, 2, i) - a);
}

// A range of leaves: those of a group, which are consecutive, or those of one child.
struct Leaves {
    const LargeArray<TriangleLeaf>& all;
    std::size_t begin, end, lastLeaf;

    Leaves child(std::size_t i, std::size_t each) const {
        return {all, std::min(begin + i * each, end), std::min(begin + (i + 1) * each, end), lastLeaf};
    }
    template <class Visit>
    void forEach(const Visit& visit) const {
        for (std::size_t leaf = begin; leaf < end; ++leaf) {
            const std::size_t count = leaf + 1 < all.size() ? std::size_t(treeWidth) : lastLeaf;
            for (std::size_t i = 0; i < count; ++i) visit(all[leaf], i);
        }
    }
};

// Sets the axes to the principal axes of the area vectors: across layers, and along slivers.
void setAxes(const Leaves& leaves, OrientedGroup& group) {
    glm::dmat3 spread(0);
    leaves.forEach([&](const TriangleLeaf& leaf, std::size_t i) {
        const glm::dvec3 normal = areaVector(leaf, i);
        for (int k = 0; k < 3; ++k) spread[k] += normal[k] * normal;
    });
    const glm::dmat3 axes = eigenvectors(spread);
    for (int k = 0; k < 3; ++k)
        for (int i = 0; i < 3; ++i) group.axes[k][i] = std::isfinite(axes[k][i]) ? float(axes[k][i]) : float(k == i);
}

struct ProjectedBounds {
    glm::dvec3 lower{std::numeric_limits<double>::infinity()}, upper{-lower};

    void add(const glm::dvec3& p) {
        lower = glm::min(lower, p);
        upper = glm::max(upper, p);
    }
};

std::int8_t roundedNormal(double scaled) {
    constexpr double scale = double(OrientedGroup::normalScale);
    return std::int8_t(std::clamp(scaled, -scale, scale));
}

template <class Group>
void setBox(const ProjectedBounds& box, std::size_t place, Group& group) {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    for (int k = 0; k < 3; ++k) {
        group.lower[k][place] = std::nextafter(float(box.lower[k]), -infinity);
        group.upper[k][place] = std::nextafter(float(box.upper[k]), infinity);
    }
}

void setChild(const Leaves& leaves, std::size_t place, OrientedGroup& group) {
    ProjectedBounds box, normals;
    leaves.forEach([&](const TriangleLeaf& leaf, std::size_t i) {
        for (int corner = 0; corner < 3; ++corner) box.add(group.along(cornerOf(leaf, corner, i)));
        const glm::dvec3 normal = areaVector(leaf, i);
        const double length = glm::length(normal);
        if (length > 0) normals.add(group.along(normal / length));
    });
    setBox(box, place, group);
    constexpr double scale = double(OrientedGroup::normalScale);
    for (int k = 0; k < 3; ++k) {
        const bool some = normals.lower[k] <= normals.upper[k];
        group.lowerNormal[k][place] = roundedNormal(some ? std::floor(scale * normals.lower[k]) : -scale);
        group.upperNormal[k][place] = roundedNormal(some ? std::ceil(scale * normals.upper[k]) : scale);
    }
}

// Returns a vertex that all triangles share, or `noVertex`.
std::uint32_t commonVertex(const Mesh& mesh, const Leaves& leaves) {
    if (leaves.begin == leaves.end) return noVertex;
    const glm::uvec3& first = mesh.triangles[leaves.all[leaves.begin].triangles[0]];
    bool common[3] = {true, true, true};
    for (std::size_t leaf = leaves.begin; leaf < leaves.end && (common[0] || common[1] || common[2]); ++leaf)
        for (const std::uint32_t triangle : leaves.all[leaf].triangles) {
            const glm::uvec3& t = mesh.triangles[triangle];
            for (int k = 0; k < 3; ++k) common[k] &= t.x == first[k] || t.y == first[k] || t.z == first[k];
        }
    for (int k = 0; k < 3; ++k)
        if (common[k]) return first[k];
    return noVertex;
}

void setFan(const Mesh& mesh, const Leaves& leaves, std::size_t place, const OrientedGroup& group, FanGroup& fans) {
    fans.vertex[place] = commonVertex(mesh, leaves);
    ProjectedBounds box;
    leaves.forEach([&](const TriangleLeaf& leaf, std::size_t i) {
        for (int corner = 0; corner < 3; ++corner)
            if (mesh.triangles[leaf.triangles[i]][corner] != fans.vertex[place])
                box.add(group.along(cornerOf(leaf, corner, i)));
    });
    setBox(box, place, fans);
}

}  // namespace

OrientedGroups orientedGroups(const Mesh& mesh, const BoxTree& boxes, const LargeArray<TriangleLeaf>& leaves,
                              std::size_t lastLeaf, Progress* progress) {
    std::size_t counts[levels] = {}, total = 0;
    std::size_t nodes = leaves.size();
    for (std::size_t level = 0; level < levels && (level == 0 || nodes > 1); ++level)
        total += counts[level] = nodes = (nodes + treeWidth - 1) / treeWidth;
    OrientedGroups result{LargeArray<OrientedGroup>(std::min<std::size_t>(total, boxes.groupCount)), {}};
    // calls visit(group, leaves of the group, leaves of a child)
    const auto forGroups = [&](const auto& visit) {
        std::size_t first = 0, each = 1;  // of the level: its first group, and the leaves of a child
        for (const std::size_t count : counts) {
            const std::size_t all = each * treeWidth, grain = std::max<std::size_t>(1, triangles / (all * treeWidth));
            const auto visitGroup = [&](std::size_t i) {
                const Leaves own{leaves, i * all, std::min((i + 1) * all, leaves.size()), lastLeaf};
                visit(result.groups[first + i], own, each);
            };
            forAllPolled(count, grain, progress, visitGroup);
            first += count;
            each = all;
        }
    };
    forGroups([&](OrientedGroup& group, const Leaves& own, std::size_t each) {
        setAxes(own, group);
        group.fans = noFans;
        for (std::size_t place = 0; place < treeWidth; ++place) {
            const Leaves child = own.child(place, each);
            setChild(child, place, group);
            if (commonVertex(mesh, child) != noVertex) group.fans = 0;
        }
    });
    std::uint32_t fans = 0;
    for (std::size_t i = 0; i < result.groups.size(); ++i)
        if (result.groups[i].fans != noFans) result.groups[i].fans = fans++;
    result.fans.resize(fans);
    forGroups([&](const OrientedGroup& group, const Leaves& own, std::size_t each) {
        if (group.fans == noFans) return;
        for (std::size_t place = 0; place < treeWidth; ++place)
            setFan(mesh, own.child(place, each), place, group, result.fans[group.fans]);
    });
    return result;
}

}  // namespace bilayer::detail
