// SPDX-License-Identifier: Apache-2.0
#include "sdf/bvh/triangle_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>
#include <utility>

#include "sdf/base/box_relations.h"
#include "sdf/base/polled_loop.h"

namespace bilayer::detail {
namespace {

/// Rounding error of a box test in double precision, relative to the max coordinate; generous.
constexpr double roundingOfBoxes = 1e-12;
/// Minimum speed of a line along an axis: with it, the line stays between two planes for longer than any box is wide.
constexpr double minSpeed = 1e-30;
/// Count of leaves that are sampled to estimate how much boxes overlap, and max count of the leaves that one meets.
constexpr std::size_t maxSamples = 256, maxMet = 4096;
/// A leaf of a smooth surface meets about ten leaves. Where it meets more than this, oriented boxes are worth their
/// cost.
constexpr std::size_t maxOverlaps = 64;

TreeItem itemOf(const Mesh& mesh, unsigned triangle) {
    const glm::uvec3& t = mesh.triangles[triangle];
    return {mesh.points[t.x] + mesh.points[t.y] + mesh.points[t.z], triangle};
}

Bounds boxAt(const BoxGroup& group, int i) {
    return {{group.lower[0][i], group.lower[1][i], group.lower[2][i]},
            {group.upper[0][i], group.upper[1][i], group.upper[2][i]}};
}

// The part of a line beyond a position, and a plane perpendicular to it onto which triangles are projected.
class LineSearch {
  public:
    LineSearch(const glm::dvec3& from, const glm::dvec3& along, double first, double slack)
        : origin_(from), direction_(along), inverse_(inverse(along)), first_(first), slack_(slack) {
        const glm::dvec3 helper = std::abs(along.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
        u_ = glm::normalize(glm::cross(along, helper));
        v_ = glm::cross(along, u_);
    }

    // Returns a bit for each box of a group that the line meets.
    unsigned met(const BoxGroup& group, const OrientedGroup* oriented) const {
        const unsigned bits = met(group.lower, group.upper, origin_, inverse_);
        if (bits == 0 || !oriented) return bits;
        return bits &
               met(oriented->lower, oriented->upper, oriented->along(origin_), inverse(oriented->along(direction_)));
    }

    // Adds the crossings of a leaf's triangles. Returns false if the line hits an edge exactly.
    bool add(const TriangleLeaf& leaf, std::size_t count, std::vector<Crossing>& found) const {
        Lanes u[3], v[3], area[3];
        for (int corner = 0; corner < 3; ++corner) {
            project(leaf.corners[corner], u_, u[corner]);
            project(leaf.corners[corner], v_, v[corner]);
        }
        for (std::size_t k = 0; k < 3; ++k) {
            const std::size_t a = (k + 1) % 3, b = (k + 2) % 3;
            // twice the signed area of the origin and the edge opposite to corner k; the reversed edge has exactly the
            // negative value
            for (int i = 0; i < treeWidth; ++i) area[k].at[i] = u[a].at[i] * v[b].at[i] - v[a].at[i] * u[b].at[i];
        }
        bool clear = true;
        for (std::size_t i = 0; i < count; ++i) {
            const double bc = area[0].at[i], ca = area[1].at[i], ab = area[2].at[i];
            const double low = std::min({bc, ca, ab}), high = std::max({bc, ca, ab});
            if (low < 0 && high > 0) continue;
            if (low > 0 || high < 0)
                addCrossing(leaf, i, {bc, ca, ab}, found);
            else
                clear = false;
        }
        return clear;
    }

  private:
    struct Lanes {
        double at[treeWidth];
    };

    static glm::dvec3 inverse(const glm::dvec3& direction) {
        glm::dvec3 result;
        for (int k = 0; k < 3; ++k)
            result[k] = 1 / std::copysign(std::max(std::abs(direction[k]), minSpeed), direction[k]);
        return result;
    }

    unsigned met(const float (&lower)[3][treeWidth], const float (&upper)[3][treeWidth], const glm::dvec3& origin,
                 const glm::dvec3& inverse) const {
        double enter[treeWidth], exit[treeWidth];
        std::fill_n(enter, treeWidth, first_);
        std::fill_n(exit, treeWidth, std::numeric_limits<double>::infinity());
        for (int axis = 0; axis < 3; ++axis)
            for (int i = 0; i < treeWidth; ++i) {
                const double a = (double(lower[axis][i]) - slack_ - origin[axis]) * inverse[axis];
                const double b = (double(upper[axis][i]) + slack_ - origin[axis]) * inverse[axis];
                const double low = a < b ? a : b, high = a < b ? b : a;
                enter[i] = enter[i] < low ? low : enter[i];
                exit[i] = exit[i] > high ? high : exit[i];
            }
        unsigned bits = 0;
        for (int i = 0; i < treeWidth; ++i)
            if (enter[i] <= exit[i] && lower[0][i] <= upper[0][i]) bits |= 1u << i;
        return bits;
    }

    void project(const float (&corner)[3][treeWidth], const glm::dvec3& axis, Lanes& to) const {
        for (int i = 0; i < treeWidth; ++i)
            to.at[i] = (double(corner[0][i]) - origin_.x) * axis.x + (double(corner[1][i]) - origin_.y) * axis.y +
                       (double(corner[2][i]) - origin_.z) * axis.z;
    }

    void addCrossing(const TriangleLeaf& leaf, std::size_t i, const glm::dvec3& weights,
                     std::vector<Crossing>& found) const {
        double sum = 0, along = 0;
        for (int k = 0; k < 3; ++k) {
            const auto& corner = leaf.corners[k];
            sum += weights[k];
            along += weights[k] * glm::dot(glm::dvec3(corner[0][i], corner[1][i], corner[2][i]) - origin_, direction_);
        }
        along /= sum;
        if (along > first_) found.push_back({leaf.triangles[i], along, sum > 0 ? 1 : -1});
    }

    glm::dvec3 origin_, direction_, inverse_, u_, v_;
    double first_, slack_;
};

}  // namespace

// Whether boxes of leaves overlap much more than those of a smooth surface do, judged by a sample of them.
bool TriangleTree::isCrowded() const {
    std::size_t samples = 0, met = 0;
    for (std::size_t leaf = 0; leaf < leaves_.size(); leaf += 1 + leaves_.size() / maxSamples) {
        const BoxGroup& group = boxes_.group(std::uint32_t(leaves_.size() + leaf / treeWidth));
        const Bounds box = boxAt(group, int(leaf % treeWidth));
        std::vector<std::uint32_t> open{boxes_.root()};
        std::size_t count = 0;
        while (!open.empty() && count < maxMet) {
            const BoxGroup& next = boxes_.group(open.back());
            open.pop_back();
            for (int i = 0; i < treeWidth; ++i)
                if (overlap(box, boxAt(next, i))) {
                    const std::uint32_t child = next.firstChild + std::uint32_t(i);
                    if (boxes_.isLeaf(child))
                        ++count;
                    else
                        open.push_back(child);
                }
        }
        met += count;
        ++samples;
    }
    return met > maxOverlaps * samples;
}

TriangleTree::TriangleTree(const Mesh& mesh, Progress* progress) : mesh_(mesh), count_(mesh.triangles.size()) {
    auto items = vectorOf<TreeItem>(count_, progress);
    forAllPolled(count_, progress, [&](std::size_t i) { items[i] = itemOf(mesh, unsigned(i)); });
    build(std::move(items), progress);
}

TriangleTree::TriangleTree(const Mesh& mesh, std::span<const unsigned> triangles)
    : mesh_(mesh), count_(triangles.size()) {
    std::vector<TreeItem> items;
    items.reserve(count_);
    for (const unsigned triangle : triangles) items.push_back(itemOf(mesh, triangle));
    build(std::move(items), nullptr);
}

void TriangleTree::build(std::vector<TreeItem> order, Progress* progress) {
    if (order.empty()) return;
    sortBySplitting(order, progress);
    boxes_.makeRoom((order.size() + treeWidth - 1) / treeWidth);
    leaves_ = LargeArray<TriangleLeaf>(boxes_.leafCount);
    forAllPolled(leaves_.size(), progress, [&](std::size_t index) {
        TriangleLeaf& leaf = leaves_[index];
        Bounds box;
        for (std::size_t i = 0; i < treeWidth; ++i) {
            const std::uint32_t triangle = order[std::min(index * treeWidth + i, order.size() - 1)].index;
            leaf.triangles[i] = triangle;
            for (int corner = 0; corner < 3; ++corner) {
                const glm::vec3& p = mesh_.points[mesh_.triangles[triangle][corner]];
                for (int k = 0; k < 3; ++k) leaf.corners[corner][k][i] = p[k];
                box.add(p);
            }
        }
        boxes_.setLeafBox(index, box.lower, box.upper);
    });
    boxes_.joinBoxes(progress);
    if (isCrowded()) oriented_ = orientedGroups(mesh_, boxes_, leaves_, leafSize(leaves_.size() - 1), progress);
    const BoxGroup& root = boxes_.group(boxes_.root());
    for (int k = 0; k < 3; ++k)
        for (int i = 0; i < treeWidth; ++i)
            if (root.lower[k][i] <= root.upper[k][i])
                largest_ = std::max({largest_, std::abs(root.lower[k][i]), std::abs(root.upper[k][i])});
}

bool TriangleTree::crossings(const glm::dvec3& origin, const glm::dvec3& direction, std::vector<Crossing>& found,
                             double first) const {
    found.clear();
    if (boxes_.leafCount == 0) return true;
    const LineSearch line(origin, direction, first, roundingOfBoxes * double(largest_));
    bool clear = true;
    const auto visit = [&](const auto& self, std::uint32_t node) -> void {
        if (boxes_.isLeaf(node)) {
            clear &= line.add(leaves_[node], leafSize(node), found);
            return;
        }
        const BoxGroup& group = boxes_.group(node);
        for (unsigned bits = line.met(group, orientedGroup(node)); bits != 0; bits &= bits - 1)
            self(self, group.firstChild + std::uint32_t(std::countr_zero(bits)));
    };
    visit(visit, boxes_.root());
    return clear;
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

}  // namespace bilayer::detail
