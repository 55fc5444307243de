#include "sdf/inspect.h"

#include <oneapi/tbb/parallel_reduce.h>
#include <oneapi/tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/vector_relational.hpp>
#include <limits>
#include <numeric>
#include <tuple>

namespace bilayer {
namespace {

/// Cells of the grid that walls are searched in, a triangle. Rays then pass a few triangles a cell.
constexpr double cellsPerTriangle = 2;
constexpr int mostCellsAlongSide = 512;
/// A wall that a ray leaves under a flatter angle than this is an edge, not a wall (cosine).
constexpr float leastFacing = 0.2f;

struct Edge {
    unsigned low, high, triangle;
    bool forward;  // the triangle runs it from low to high
    bool operator<(const Edge& other) const { return std::tie(low, high) < std::tie(other.low, other.high); }
    bool same(const Edge& other) const { return low == other.low && high == other.high; }
};

struct Component {
    std::vector<unsigned> triangles;
    Bounds bounds;
    double volume = 0;
    bool closed = true;
};

glm::dvec3 areaVector(const Mesh& mesh, const glm::uvec3& t) {
    const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
    return 0.5 * glm::cross(b - a, c - a);
}

void countEdges(const Mesh& mesh, const std::vector<unsigned>& componentOf, std::vector<Component>& components,
                MeshReport& report) {
    std::vector<Edge> edges;
    edges.reserve(3 * mesh.triangles.size());
    for (unsigned i = 0; i < mesh.triangles.size(); ++i)
        for (int k = 0; k < 3; ++k) {
            const unsigned a = mesh.triangles[i][k], b = mesh.triangles[i][(k + 1) % 3];
            edges.push_back({std::min(a, b), std::max(a, b), i, a < b});
        }
    tbb::parallel_sort(edges.begin(), edges.end());
    for (std::size_t i = 0, j; i < edges.size(); i = j) {
        for (j = i; j < edges.size() && edges[j].same(edges[i]);) ++j;
        if (j - i == 1) {
            ++report.boundaryEdges;
            components[componentOf[edges[i].triangle]].closed = false;
        }
        report.nonManifoldEdges += j - i > 2;
        const auto forward =
            std::count_if(&edges[i], &edges[i] + (j - i), [](const Edge& edge) { return edge.forward; });
        report.misorientedEdges += j - i > 1 && 2 * std::size_t(forward) != j - i;
    }
}

std::size_t countDuplicates(const Mesh& mesh) {
    std::vector<std::tuple<unsigned, unsigned, unsigned>> corners;
    corners.reserve(mesh.triangles.size());
    for (const auto& t : mesh.triangles) {
        unsigned sorted[3] = {t.x, t.y, t.z};
        std::sort(sorted, sorted + 3);
        corners.emplace_back(sorted[0], sorted[1], sorted[2]);
    }
    tbb::parallel_sort(corners.begin(), corners.end());
    std::size_t duplicates = 0;
    for (std::size_t i = 1; i < corners.size(); ++i) duplicates += corners[i] == corners[i - 1];
    return duplicates;
}

// Sets of vertices that triangles connect, by union-find; gives each triangle the number of its set.
std::vector<unsigned> components(const Mesh& mesh, std::size_t& count) {
    std::vector<unsigned> parent(mesh.points.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto root = [&](unsigned i) {
        while (parent[i] != i) i = parent[i] = parent[parent[i]];
        return i;
    };
    for (const auto& t : mesh.triangles) {
        const unsigned a = root(t.x);
        parent[root(t.y)] = a;
        parent[root(t.z)] = a;
    }
    constexpr unsigned none = ~0u;
    std::vector<unsigned> number(mesh.points.size(), none), of(mesh.triangles.size());
    count = 0;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        unsigned& n = number[root(mesh.triangles[i].x)];
        if (n == none) n = unsigned(count++);
        of[i] = n;
    }
    return of;
}

std::vector<Component> gather(const Mesh& mesh, const std::vector<unsigned>& of, std::size_t count) {
    std::vector<Component> all(count);
    const glm::dvec3 origin(bounds(mesh).centre());
    for (std::size_t i = 0; i < of.size(); ++i) {
        const auto& t = mesh.triangles[i];
        Component& c = all[of[i]];
        c.triangles.push_back(unsigned(i));
        for (int k = 0; k < 3; ++k) c.bounds.add(mesh.points[t[k]]);
        c.volume += glm::dot(areaVector(mesh, t), glm::dvec3(mesh.points[t.x]) - origin) / 3;
    }
    return all;
}

double windingNumber(const Mesh& mesh, const Component& component, const glm::dvec3& point) {
    // solid angles: A. Van Oosterom, J. Strackee, "The Solid Angle of a Plane Triangle", 1983
    double angle = 0;
    for (const unsigned i : component.triangles) {
        const auto& t = mesh.triangles[i];
        const glm::dvec3 a = glm::dvec3(mesh.points[t.x]) - point, b = glm::dvec3(mesh.points[t.y]) - point,
                         c = glm::dvec3(mesh.points[t.z]) - point;
        const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
        angle += 2 * std::atan2(glm::dot(a, glm::cross(b, c)),
                                la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb);
    }
    return angle / (4 * glm::pi<double>());
}

bool contains(const Bounds& box, const glm::vec3& p) {
    return glm::all(glm::lessThanEqual(box.lower, p)) && glm::all(glm::lessThanEqual(p, box.upper));
}

// A component within an even number of others should have positive volume, a cavity within an odd number negative
// volume.
std::size_t countInsideOut(const Mesh& mesh, const std::vector<Component>& all) {
    std::size_t wrong = 0;
    for (const Component& inner : all) {
        if (!inner.closed) continue;
        const glm::vec3 point = mesh.points[mesh.triangles[inner.triangles[0]].x];
        int depth = 0;
        for (const Component& outer : all)
            if (&outer != &inner && outer.closed && contains(outer.bounds, point))
                depth += std::abs(windingNumber(mesh, outer, point)) > 0.5;
        wrong += (inner.volume < 0) != (depth % 2 == 1);
    }
    return wrong;
}

// A uniform grid over the triangles, for rays that look for the far side of a wall.
class WallFinder {
  public:
    explicit WallFinder(const Mesh& mesh) : mesh_(mesh), box_(bounds(mesh)) {
        const double count = cellsPerTriangle * double(mesh.triangles.size());
        const glm::dvec3 size = glm::max(glm::dvec3(box_.size()), 1e-6 * double(box_.longestSide()));
        cell_ = float(
            std::max(std::cbrt(size.x * size.y * size.z / count), double(box_.longestSide()) / mostCellsAlongSide));
        cells_ = glm::ivec3(glm::vec3(size) / cell_) + 1;
        std::vector<unsigned> counts(std::size_t(cells_.x) * cells_.y * cells_.z + 1, 0);
        forEachPlace([&](std::size_t cell, unsigned) { ++counts[cell + 1]; });
        std::partial_sum(counts.begin(), counts.end(), counts.begin());
        begins_ = counts;
        triangles_.resize(counts.back());
        forEachPlace([&](std::size_t cell, unsigned triangle) { triangles_[counts[cell]++] = triangle; });
    }

    // The thickness of the solid behind a triangle, from its centre against its normal; infinite where nothing ends it.
    float thicknessBehind(unsigned triangle) const {
        const auto& t = mesh_.triangles[triangle];
        const glm::vec3 normal = glm::vec3(areaVector(mesh_, t));
        const float length = glm::length(normal);
        if (!(length > 0)) return infinite;
        const glm::vec3 origin = (mesh_.points[t.x] + mesh_.points[t.y] + mesh_.points[t.z]) / 3.f;
        return firstExit(origin, -normal / length, triangle);
    }

    static constexpr float infinite = std::numeric_limits<float>::infinity();

  private:
    template <class Visit>
    void forEachPlace(Visit visit) const {
        for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
            Bounds box;
            for (int k = 0; k < 3; ++k) box.add(mesh_.points[mesh_.triangles[i][k]]);
            const glm::ivec3 low = cellAt(box.lower), high = cellAt(box.upper);
            for (int x = low.x; x <= high.x; ++x)
                for (int y = low.y; y <= high.y; ++y)
                    for (int z = low.z; z <= high.z; ++z) visit(index({x, y, z}), unsigned(i));
        }
    }

    glm::ivec3 cellAt(const glm::vec3& p) const {
        return glm::clamp(glm::ivec3((p - box_.lower) / cell_), glm::ivec3(0), cells_ - 1);
    }
    std::size_t index(const glm::ivec3& c) const { return (std::size_t(c.x) * cells_.y + c.y) * cells_.z + c.z; }

    // Walks the cells along the ray (J. Amanatides, A. Woo, "A Fast Voxel Traversal Algorithm", 1987).
    float firstExit(const glm::vec3& origin, const glm::vec3& direction, unsigned self) const {
        glm::ivec3 cell = cellAt(origin), step;
        glm::vec3 next, delta;
        for (int axis = 0; axis < 3; ++axis) {
            step[axis] = direction[axis] < 0 ? -1 : 1;
            const float border = box_.lower[axis] + cell_ * float(cell[axis] + (step[axis] > 0));
            const bool moves = std::abs(direction[axis]) > 1e-12f;
            next[axis] = moves ? (border - origin[axis]) / direction[axis] : infinite;
            delta[axis] = moves ? cell_ / std::abs(direction[axis]) : infinite;
        }
        float nearest = infinite;
        for (;;) {
            for (unsigned i = begins_[index(cell)]; i < begins_[index(cell) + 1]; ++i)
                if (triangles_[i] != self) nearest = std::min(nearest, exit(origin, direction, triangles_[i]));
            const int axis = next.x < next.y ? (next.x < next.z ? 0 : 2) : (next.y < next.z ? 1 : 2);
            if (nearest <= next[axis]) return nearest;
            cell[axis] += step[axis];
            if (cell[axis] < 0 || cell[axis] >= cells_[axis]) return nearest;
            next[axis] += delta[axis];
        }
    }

    // Where the ray leaves through the front of a triangle (T. Moeller, B. Trumbore, 1997); infinite if it does not.
    float exit(const glm::vec3& origin, const glm::vec3& direction, unsigned triangle) const {
        const auto& t = mesh_.triangles[triangle];
        const glm::dvec3 a(mesh_.points[t.x]), ab = glm::dvec3(mesh_.points[t.y]) - a,
                                               ac = glm::dvec3(mesh_.points[t.z]) - a, d(direction),
                                               from = glm::dvec3(origin) - a;
        const glm::dvec3 normal = glm::cross(ab, ac);
        const double facing = glm::dot(normal, d);
        if (facing <= double(leastFacing) * glm::length(normal)) return infinite;
        const glm::dvec3 side = glm::cross(d, from);
        const double u = glm::dot(ac, side) / facing, v = -glm::dot(ab, side) / facing;
        if (u < 0 || v < 0 || u + v > 1) return infinite;
        const double along = -glm::dot(normal, from) / facing;
        return along > 0 ? float(along) : infinite;
    }

    const Mesh& mesh_;
    Bounds box_;
    float cell_;
    glm::ivec3 cells_;
    std::vector<unsigned> begins_, triangles_;
};

void findThinWalls(const Mesh& mesh, float wall, MeshReport& report) {
    if (!(report.bounds.longestSide() > 0)) return;
    const WallFinder finder(mesh);
    using Result = std::pair<float, std::size_t>;
    const Result result = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, mesh.triangles.size(), 1024), Result{WallFinder::infinite, 0},
        [&](const auto& range, Result part) {
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                const float thickness = finder.thicknessBehind(unsigned(i));
                part.first = std::min(part.first, thickness);
                part.second += thickness < wall;
            }
            return part;
        },
        [](const Result& a, const Result& b) {
            return Result{std::min(a.first, b.first), a.second + b.second};
        });
    report.thinnestWall = std::isfinite(result.first) ? result.first : 0.f;
    report.thinWalls = result.second;
}

}  // namespace

MeshReport inspect(const Mesh& input, float wall) {
    validate(input);
    MeshReport report;
    const Mesh mesh = weld(input);
    report.points = mesh.points.size();
    report.triangles = input.triangles.size();
    report.degenerateTriangles = input.triangles.size() - mesh.triangles.size();
    if (mesh.triangles.empty()) return report;
    report.bounds = bounds(mesh);
    const std::vector<unsigned> of = components(mesh, report.components);
    std::vector<Component> all = gather(mesh, of, report.components);
    countEdges(mesh, of, all, report);
    for (const Component& component : all) report.volume += component.volume;
    for (const auto& t : mesh.triangles) {
        const double area = glm::length(areaVector(mesh, t));
        report.area += area;
        report.degenerateTriangles += !(area > 0);
    }
    report.duplicateTriangles = countDuplicates(mesh);
    report.insideOutComponents = countInsideOut(mesh, all);
    findThinWalls(mesh, wall, report);
    return report;
}

}  // namespace bilayer
