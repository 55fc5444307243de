// SPDX-License-Identifier: Apache-2.0
#include "sdf/bvh/triangle_tree.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/vector_relational.hpp>
#include <limits>

#include "sdf/base/polled_loop.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t grain = 1024;  // leaves or triangles per task
/// Rounding error of a box test in double precision, relative to the max coordinate; generous.
constexpr double roundingOfBoxes = 1e-12;
/// Count of lines that vote on whether a part lies within another: odd, and more than one in case a line hits an edge.
constexpr std::size_t votes = 3;

// Returns the triangles in the order of the tree.
std::vector<TreeItem> sortedTriangles(const Mesh& mesh, Progress* progress) {
    auto items = vectorOf<TreeItem>(mesh.triangles.size(), progress);
    forAllPolled(items.size(), grain, progress, [&](std::size_t i) {
        const glm::uvec3& t = mesh.triangles[i];
        items[i] = {mesh.points[t.x] + mesh.points[t.y] + mesh.points[t.z], unsigned(i)};
    });
    sortBySplitting(items, progress);
    return items;
}

bool holds(const Bounds& outer, const Bounds& inner) {
    return glm::all(glm::lessThanEqual(outer.lower, inner.lower)) &&
           glm::all(glm::greaterThanEqual(outer.upper, inner.upper));
}

glm::dvec3 centroid(const Mesh& mesh, unsigned triangle) {
    const glm::uvec3& t = mesh.triangles[triangle];
    return (glm::dvec3(mesh.points[t.x]) + glm::dvec3(mesh.points[t.y]) + glm::dvec3(mesh.points[t.z])) / 3.0;
}

// A line, and a plane perpendicular to it onto which triangles are projected.
struct LineFrame {
    glm::dvec3 origin, direction, inverse, u, v;

    LineFrame(const glm::dvec3& from, const glm::dvec3& along) : origin(from), direction(along), inverse(1.0 / along) {
        const glm::dvec3 helper = std::abs(along.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
        u = glm::normalize(glm::cross(along, helper));
        v = glm::cross(along, u);
    }

    bool meets(const Bounds& box, double slack) const {
        double first = -std::numeric_limits<double>::infinity(), last = -first;
        for (int axis = 0; axis < 3; ++axis) {
            const double a = (double(box.lower[axis]) - slack - origin[axis]) * inverse[axis];
            const double b = (double(box.upper[axis]) + slack - origin[axis]) * inverse[axis];
            first = std::max(first, std::min(a, b));
            last = std::min(last, std::max(a, b));
        }
        return first <= last;
    }

    // Returns twice the signed area of the projected edge and the origin. The reversed edge has exactly the negative
    // value.
    double beside(const glm::dvec3& a, const glm::dvec3& b) const {
        return glm::dot(a, u) * glm::dot(b, v) - glm::dot(a, v) * glm::dot(b, u);
    }

    // Returns 0 for a miss, otherwise the sign of the crossing; `along` receives its position.
    int cross(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, double& along) const {
        const double bc = beside(b, c), ca = beside(c, a), ab = beside(a, b);
        const bool front = bc > 0 && ca > 0 && ab > 0, back = bc < 0 && ca < 0 && ab < 0;
        if (!front && !back) return 0;
        const double sum = bc + ca + ab;
        along = (bc * glm::dot(a, direction) + ca * glm::dot(b, direction) + ab * glm::dot(c, direction)) / sum;
        return front ? 1 : -1;
    }
};

// Returns the parts that a ray from the point crosses an odd number of times, in order.
std::vector<unsigned> oddParts(const TriangleTree& tree, const glm::dvec3& point, const glm::dvec3& direction,
                               std::span<const unsigned> partOf) {
    std::vector<Crossing> found;
    tree.crossings(point, direction, found);
    std::vector<unsigned> parts, odd;
    for (const Crossing& crossing : found)
        if (crossing.along > 0 && partOf[crossing.triangle] != noPart) parts.push_back(partOf[crossing.triangle]);
    std::sort(parts.begin(), parts.end());
    for (std::size_t i = 0, j; i < parts.size(); i = j) {
        for (j = i; j < parts.size() && parts[j] == parts[i];) ++j;
        if ((j - i) % 2) odd.push_back(parts[i]);
    }
    return odd;
}

std::vector<unsigned> common(const std::vector<unsigned>& a, const std::vector<unsigned>& b) {
    std::vector<unsigned> both;
    std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
    return both;
}

}  // namespace

TriangleTree::TriangleTree(const Mesh& mesh, Progress* progress) : mesh_(mesh) {
    if (mesh.triangles.empty()) return;
    const std::vector<TreeItem> order = sortedTriangles(mesh, progress);
    boxes_.makeRoom((order.size() + treeWidth - 1) / treeWidth);
    leaves_ = LargeArray<TriangleLeaf>(boxes_.leafCount);
    forAllPolled(leaves_.size(), grain, progress, [&](std::size_t index) {
        TriangleLeaf& leaf = leaves_[index];
        Bounds box;
        for (std::size_t i = 0; i < treeWidth; ++i) {
            const std::uint32_t triangle = order[std::min(index * treeWidth + i, order.size() - 1)].index;
            leaf.triangles[i] = triangle;
            for (int corner = 0; corner < 3; ++corner) {
                const glm::vec3& p = mesh.points[mesh.triangles[triangle][corner]];
                for (int k = 0; k < 3; ++k) leaf.corners[corner][k][i] = p[k];
                box.add(p);
            }
        }
        boxes_.setLeafBox(index, box.lower, box.upper);
    });
    boxes_.joinBoxes(progress);
    const BoxGroup& root = boxes_.group(boxes_.root());
    for (int k = 0; k < 3; ++k)
        for (int i = 0; i < treeWidth; ++i)
            if (root.lower[k][i] <= root.upper[k][i])
                largest_ = std::max({largest_, std::abs(root.lower[k][i]), std::abs(root.upper[k][i])});
}

void TriangleTree::crossings(const glm::dvec3& origin, const glm::dvec3& direction,
                             std::vector<Crossing>& found) const {
    const LineFrame line(origin, direction);
    const double slack = roundingOfBoxes * double(largest_);
    found.clear();
    descend([&](const Bounds& box) { return line.meets(box, slack); },
            [&](unsigned i) {
                const glm::uvec3& t = mesh_.triangles[i];
                Crossing crossing{i, 0, 0};
                crossing.sign =
                    line.cross(glm::dvec3(mesh_.points[t.x]) - origin, glm::dvec3(mesh_.points[t.y]) - origin,
                               glm::dvec3(mesh_.points[t.z]) - origin, crossing.along);
                if (crossing.sign) found.push_back(crossing);
            });
}

std::vector<glm::dvec3> spreadDirections(std::size_t count) {
    std::vector<glm::dvec3> directions;
    const double golden = glm::pi<double>() * (3 - std::sqrt(5.0));
    for (std::size_t i = 0; i < count; ++i) {
        const double z = (double(i) + 0.5) / double(count), radius = std::sqrt(1 - z * z);
        const double angle = golden * (double(i) + 0.5);
        directions.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
    }
    return directions;
}

std::vector<std::vector<unsigned>> enclosingParts(const Mesh& mesh, const TriangleTree& tree,
                                                  std::span<const unsigned> partOf, std::size_t parts,
                                                  Progress* progress) {
    std::vector<std::vector<unsigned>> members(parts), enclosing(parts);
    std::vector<Bounds> boxes(parts);
    for (const unsigned i : Polled(partOf.size(), progress)) {
        if (partOf[i] == noPart) continue;
        members[partOf[i]].push_back(i);
        for (int k = 0; k < 3; ++k) boxes[partOf[i]].add(mesh.points[mesh.triangles[i][k]]);
    }
    if (parts < 2) return enclosing;
    const std::vector<glm::dvec3> directions = spreadDirections(votes);
    tbb::parallel_for(std::size_t(0), parts, [&](std::size_t part) {
        if (members[part].empty()) return;
        poll(progress);
        for (std::size_t vote = 0; vote < votes; ++vote) {
            const unsigned triangle = members[part][vote * members[part].size() / votes];
            const auto odd = oddParts(tree, centroid(mesh, triangle), directions[vote], partOf);
            enclosing[part] = vote ? common(enclosing[part], odd) : odd;
        }
        std::erase_if(enclosing[part],
                      [&](unsigned outer) { return outer == part || !holds(boxes[outer], boxes[part]); });
    });
    return enclosing;
}

}  // namespace bilayer::detail
