// SPDX-License-Identifier: Apache-2.0
// Where no other surface passes, neighbours lie on the same side of everything. One winding number therefore decides
// for a patch of triangles connected in this way. Triangles that others cross or touch are cut along the lines of
// contact, and each piece is tested separately.
#include "sdf/mesh/unite.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include "sdf/base/progress.h"
#include "sdf/base/triangle_corners.h"
#include "sdf/bvh/triangle_tree.h"
#include "sdf/bvh/winding_number.h"
#include "sdf/mesh/topology.h"
#include "sdf/mesh/triangle_cut.h"

namespace bilayer::detail {
namespace {

/// Surfaces closer than this count as touching: one unit in the last place of a float, relative to the max coordinate.
constexpr double slackPart = 1.2e-7;
/// In units of the slack: distance in front of and behind a triangle at which winding numbers are evaluated.
constexpr double stepOff = 2;
/// In units of the slack: max length of a contact that neighbours with a common vertex or edge have next to it.
constexpr double shortContact = 4;

using CornerHeights = std::array<double, 3>;

double slackOf(const Mesh& mesh) {
    const Bounds box = bounds(mesh);
    const glm::vec3 largest = glm::max(glm::abs(box.lower), glm::abs(box.upper));
    return slackPart * double(std::max({largest.x, largest.y, largest.z}));
}

/// A triangle in double precision.
struct DoubleTriangle {
    TriangleCorners corners;
    glm::dvec3 normal;  // unit normal, or 0 for a triangle without area
    double area;

    DoubleTriangle(const Mesh& mesh, const glm::uvec3& t)
        : corners{glm::dvec3(mesh.points[t.x]), glm::dvec3(mesh.points[t.y]), glm::dvec3(mesh.points[t.z])} {
        normal = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
        area = 0.5 * glm::length(normal);
        normal = area > 0 ? 0.5 / area * normal : glm::dvec3(0);
    }

    Polygon polygon() const { return {corners.begin(), corners.end()}; }
    glm::dvec3 centroid() const { return (corners[0] + corners[1] + corners[2]) / 3.0; }
    double height(const glm::dvec3& p) const { return glm::dot(normal, p - corners[0]); }
    glm::dvec3 onPlane(const glm::dvec3& p) const { return p - height(p) * normal; }
};

/// Tests whether a box overlaps both a face's bounding box and its plane, with the slack as a margin.
class TriangleOverlap {
  public:
    TriangleOverlap(const Bounds& own, const DoubleTriangle& face, double slack)
        : box_{own.lower - float(slack), own.upper + float(slack)},
          normal_(face.normal),
          away_(glm::abs(face.normal)),
          at_(2 * glm::dot(face.normal, face.corners[0])),
          slack_(2 * slack) {}

    bool operator()(const Bounds& other) const {
        for (int axis = 0; axis < 3; ++axis)
            if (other.lower[axis] > box_.upper[axis] || box_.lower[axis] > other.upper[axis]) return false;
        const glm::dvec3 lower(other.lower), upper(other.upper);
        return std::abs(glm::dot(normal_, lower + upper) - at_) <= glm::dot(away_, upper - lower) + slack_;
    }

  private:
    const Bounds box_;
    const glm::dvec3 normal_, away_;
    const double at_, slack_;  // both doubled
};

/// Finds where other triangles cross or touch a triangle.
class Contacts {
  public:
    Contacts(const Mesh& mesh, const Topology& topology, const TriangleTree& tree, double slack)
        : mesh_(mesh), topology_(topology), tree_(tree), slack_(slack) {}

    /// Returns the contact segments within a triangle, except for edges and vertices that it shares with neighbours.
    std::vector<Segment> within(unsigned triangle) const {
        const DoubleTriangle face(mesh_, mesh_.triangles[triangle]);
        std::vector<Segment> found;
        if (!(face.area > 0)) return found;
        tree_.descend(TriangleOverlap(tree_.boxOf(triangle), face, slack_), [&](unsigned other) {
            if (other != triangle) add(triangle, face, other, found);
        });
        return found;
    }

  private:
    void add(unsigned triangle, const DoubleTriangle& face, unsigned other, std::vector<Segment>& found) const {
        const glm::uvec3& t = mesh_.triangles[other];
        const TriangleCorners corners{glm::dvec3(mesh_.points[t.x]), glm::dvec3(mesh_.points[t.y]),
                                      glm::dvec3(mesh_.points[t.z])};
        const CornerHeights heights{face.height(corners[0]), face.height(corners[1]), face.height(corners[2])};
        const auto [lowest, highest] = std::minmax({heights[0], heights[1], heights[2]});
        if (lowest > slack_ || highest < -slack_) return;
        for (Segment segment : traces(face, corners, heights)) {
            if (alongSharedEdge(triangle, other, face, segment)) continue;
            if (!clip(segment, face.polygon(), face.normal, slack_)) continue;
            if (glm::length(segment.to - segment.from) > shortContact * slack_) found.push_back(segment);
        }
    }

    /// Returns the intersection of a triangle with a face's plane: nothing, a segment, or all three edges.
    std::vector<Segment> traces(const DoubleTriangle& face, const TriangleCorners& corners,
                                const CornerHeights& heights) const {
        std::vector<Segment> edges;
        std::vector<glm::dvec3> points;
        for (std::size_t i = 0; i < 3; ++i) {
            const std::size_t k = (i + 1) % 3;
            const bool here = std::abs(heights[i]) <= slack_, there = std::abs(heights[k]) <= slack_;
            if (here) points.push_back(face.onPlane(corners[i]));
            if (here && there) edges.push_back({face.onPlane(corners[i]), face.onPlane(corners[k])});
            if (heights[i] * heights[k] < 0 && !(here && there))
                points.push_back(corners[i] + heights[i] / (heights[i] - heights[k]) * (corners[k] - corners[i]));
        }
        if (edges.size() == 3 || points.size() < 2) return edges;
        return {farthest(points)};
    }

    static Segment farthest(const std::vector<glm::dvec3>& points) {
        Segment best{points[0], points[1]};
        for (std::size_t i = 0; i < points.size(); ++i)
            for (std::size_t k = 0; k < i; ++k)
                if (glm::length(points[i] - points[k]) > glm::length(best.to - best.from))
                    best = {points[i], points[k]};
        return best;
    }

    bool alongSharedEdge(unsigned triangle, unsigned other, const DoubleTriangle& face, const Segment& segment) const {
        const glm::uvec3 &a = topology_.triangles[triangle], &b = topology_.triangles[other];
        const auto shares = [&b](unsigned vertex) { return vertex == b.x || vertex == b.y || vertex == b.z; };
        for (int i = 0; i < 3; ++i) {
            if (!shares(a[i]) || !shares(a[(i + 1) % 3])) continue;
            const glm::dvec3 &from = face.corners[std::size_t(i)], &to = face.corners[std::size_t((i + 1) % 3)];
            const glm::dvec3 across = glm::normalize(glm::cross(face.normal, to - from));
            if (std::max(std::abs(glm::dot(across, segment.from - from)),
                         std::abs(glm::dot(across, segment.to - from))) <= slack_)
                return true;
        }
        return false;
    }

    const Mesh& mesh_;
    const Topology& topology_;
    const TriangleTree& tree_;
    const double slack_;
};

/// Removes buried surfaces.
class Uniter {
  public:
    Uniter(const Mesh& mesh, Progress* progress)
        : mesh_(mesh),
          progress_(progress),
          topology_(mesh, progress),
          slack_(slackOf(mesh)),
          contacts_(mesh.triangles.size()),
          pieces_(mesh.triangles.size()),
          buried_(mesh.triangles.size(), 0) {}

    UnionSurface run() {
        findContacts();
        const std::vector<unsigned> patches = findPatches();
        const bool touched =
            std::any_of(contacts_.begin(), contacts_.end(), [](const auto& segments) { return !segments.empty(); });
        if (!touched && patches.size() == 1) return {mesh_, 0, 0};
        const WindingNumber winding(mesh_, progress_);
        judge(patches, winding);
        cutTriangles(winding);
        return assembled();
    }

  private:
    template <class Work>
    void forAll(std::size_t count, const Work& work) const {
        tbb::parallel_for(std::size_t(0), count, [&](std::size_t i) {
            poll(progress_);
            work(i);
        });
    }

    DoubleTriangle face(std::size_t triangle) const { return {mesh_, mesh_.triangles[triangle]}; }

    void findContacts() {
        const TriangleTree tree(mesh_, progress_);
        const Contacts contacts(mesh_, topology_, tree, slack_);
        forAll(contacts_.size(), [&](std::size_t i) { contacts_[i] = contacts.within(unsigned(i)); });
    }

    // Finds patches: triangles connected by edges of two triangles, without contacts. A patch is represented by its
    // largest triangle.
    std::vector<unsigned> findPatches() {
        DisjointSets sets(mesh_.triangles.size());
        topology_.forEachEdge([&](std::span<const EdgeUse> uses) {
            if (uses.size() == 2 && contacts_[uses[0].triangle].empty() && contacts_[uses[1].triangle].empty())
                sets.join(uses[0].triangle, uses[1].triangle);
        });
        patchOf_.resize(mesh_.triangles.size());
        for (unsigned i = 0; i < patchOf_.size(); ++i) patchOf_[i] = i;
        for (unsigned i = 0; i < patchOf_.size(); ++i) {
            unsigned& largest = patchOf_[sets.root(i)];
            if (face(i).area > face(largest).area) largest = i;
        }
        std::vector<unsigned> patches;
        for (unsigned i = 0; i < patchOf_.size(); ++i) {
            const unsigned root = sets.root(i);
            if (root == i && contacts_[i].empty()) patches.push_back(patchOf_[i]);
            if (root != i) patchOf_[i] = patchOf_[root];
        }
        return patches;
    }

    void judge(const std::vector<unsigned>& patches, const WindingNumber& winding) {
        forAll(patches.size(), [&](std::size_t p) {
            const DoubleTriangle largest = face(patches[p]);
            buried_[patches[p]] = largest.area > 0 && isBuried(largest.centroid(), largest.normal, winding);
        });
    }

    void cutTriangles(const WindingNumber& winding) {
        forAll(contacts_.size(), [&](std::size_t i) {
            if (contacts_[i].empty()) return;
            const glm::dvec3 normal = face(i).normal;
            pieces_[i] = cut(face(i).polygon(), normal, contacts_[i], slack_,
                             [&](const glm::dvec3& inside) { return !isBuried(inside, normal, winding); });
        });
    }

    bool isBuried(const glm::dvec3& point, const glm::dvec3& normal, const WindingNumber& winding) const {
        const glm::dvec3 step = stepOff * slack_ * normal;
        return winding.isInside(point + step) && winding.isInside(point - step);
    }

    bool isWhole(std::size_t triangle) const {
        if (contacts_[triangle].empty()) return !buried_[patchOf_[triangle]];
        return pieces_[triangle].size() == 1 && pieces_[triangle][0] == face(triangle).polygon();
    }

    UnionSurface assembled() const {
        UnionSurface united{{mesh_.points, {}}, 0, 0};
        for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
            if (isWhole(i)) {
                united.mesh.triangles.push_back(mesh_.triangles[i]);
                continue;
            }
            (pieces_[i].empty() ? united.buriedTriangles : united.cutTriangles) += 1;
            for (const Polygon& piece : pieces_[i]) append(piece, united.mesh);
        }
        return united;
    }

    static void append(const Polygon& polygon, Mesh& mesh) {
        const unsigned first = unsigned(mesh.points.size());
        for (const glm::dvec3& p : polygon) mesh.points.emplace_back(p);
        for (unsigned i = 2; i < polygon.size(); ++i) mesh.triangles.emplace_back(first, first + i - 1, first + i);
    }

    const Mesh& mesh_;
    Progress* progress_;
    const Topology topology_;
    const double slack_;
    std::vector<std::vector<Segment>> contacts_;  // for each triangle
    std::vector<std::vector<Polygon>> pieces_;    // the remaining pieces of each triangle with contacts
    std::vector<unsigned> patchOf_;               // for each triangle without contacts
    std::vector<char> buried_;                    // for each patch
};

}  // namespace

UnionSurface unite(const Mesh& mesh, Progress* progress) {
    validate(mesh);
    return Uniter(mesh, progress).run();
}

}  // namespace bilayer::detail
