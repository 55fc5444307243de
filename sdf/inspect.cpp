#include "sdf/inspect.h"

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <span>
#include <tuple>
#include <vector>

#include "sdf/orient.h"
#include "sdf/piercing.h"
#include "sdf/sign.h"
#include "sdf/topology.h"
#include "sdf/triangle_tree.h"

namespace bilayer {
namespace {

/// Cells of the grid that walls are searched in, a triangle. Rays then pass a few triangles a cell.
constexpr double cellsPerTriangle = 2;
constexpr int mostCellsAlongSide = 512;
/// A wall that a ray leaves under a flatter angle than this is an edge, not a wall (cosine).
constexpr float leastFacing = 0.2f;
/// Part of the area whose walls are not common: creases and tips, which most meshes have somewhere.
constexpr double uncommonArea = 0.01;

struct Component {
    double volume = 0;
    bool closed = true;
};

glm::dvec3 areaVector(const Mesh& mesh, const glm::uvec3& t) {
    const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
    return 0.5 * glm::cross(b - a, c - a);
}

int netRuns(std::span<const EdgeUse> uses) {
    int net = 0;
    for (const EdgeUse& use : uses) net += use.direction();
    return net;
}

void countEdges(const Topology& topology, const std::vector<unsigned>& componentOf, std::vector<Component>& components,
                MeshReport& report) {
    topology.forEachEdge([&](std::span<const EdgeUse> uses) {
        if (uses.size() == 1) {
            ++report.boundaryEdges;
            components[componentOf[uses[0].triangle]].closed = false;
        }
        report.nonManifoldEdges += uses.size() > 2;
        report.misorientedEdges += uses.size() > 1 && netRuns(uses) != 0;
    });
}

// Holes: sets of boundary edges that share vertices.
std::size_t countLoops(const Topology& topology, std::size_t vertices) {
    Sets sets(vertices);
    std::vector<unsigned> ends;
    topology.forEachEdge([&](std::span<const EdgeUse> uses) {
        if (uses.size() != 1) return;
        sets.join(uses[0].low, uses[0].high);
        ends.push_back(uses[0].low);
    });
    for (unsigned& end : ends) end = sets.root(end);
    std::sort(ends.begin(), ends.end());
    return std::size_t(std::unique(ends.begin(), ends.end()) - ends.begin());
}

// Vertices whose triangles form several fans: the corners at a vertex that edges connect are one fan.
std::size_t countNonManifoldVertices(const Topology& topology, std::size_t vertices) {
    const auto corner = [&](unsigned triangle, unsigned vertex) {
        const glm::uvec3& t = topology.triangles[triangle];
        return 3 * triangle + (t.x == vertex ? 0 : t.y == vertex ? 1 : 2);
    };
    Sets fans(3 * topology.triangles.size());
    topology.forEachEdge([&](std::span<const EdgeUse> uses) {
        for (const EdgeUse& use : uses.subspan(1)) {
            fans.join(corner(uses[0].triangle, use.low), corner(use.triangle, use.low));
            fans.join(corner(uses[0].triangle, use.high), corner(use.triangle, use.high));
        }
    });
    std::vector<unsigned> count(vertices, 0);
    for (unsigned i = 0; i < topology.triangles.size(); ++i)
        for (unsigned k = 0; k < 3; ++k) count[topology.triangles[i][k]] += fans.root(3 * i + k) == 3 * i + k;
    return std::size_t(std::count_if(count.begin(), count.end(), [](unsigned n) { return n > 1; }));
}

std::size_t countDuplicates(const Topology& topology) {
    std::size_t duplicates = 0;
    for (unsigned i = 0; i < topology.original.size(); ++i) duplicates += topology.original[i] != i;
    return duplicates;
}

// Sets of triangles that share vertices; gives each triangle the number of its set.
std::vector<unsigned> components(const Mesh& mesh, std::size_t& count) {
    Sets sets(mesh.points.size());
    for (const auto& t : mesh.triangles) {
        sets.join(t.x, t.y);
        sets.join(t.x, t.z);
    }
    std::vector<unsigned> number(mesh.points.size(), noPart), of(mesh.triangles.size());
    count = 0;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        unsigned& n = number[sets.root(mesh.triangles[i].x)];
        if (n == noPart) n = unsigned(count++);
        of[i] = n;
    }
    return of;
}

std::vector<Component> gather(const Mesh& mesh, const std::vector<unsigned>& of, std::size_t count) {
    std::vector<Component> all(count);
    const glm::dvec3 origin(bounds(mesh).centre());
    for (std::size_t i = 0; i < of.size(); ++i) {
        const auto& t = mesh.triangles[i];
        all[of[i]].volume += glm::dot(areaVector(mesh, t), glm::dvec3(mesh.points[t.x]) - origin) / 3;
    }
    return all;
}

// A component within an even number of others should have positive volume, a cavity within an odd number negative
// volume.
std::size_t countInsideOut(const Mesh& mesh, const TriangleTree& tree, std::vector<unsigned> of,
                           const std::vector<Component>& all) {
    for (unsigned& component : of)
        if (!all[component].closed) component = noPart;
    const auto enclosing = enclosingParts(mesh, tree, of, all.size());
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < all.size(); ++i)
        wrong += all[i].closed && (all[i].volume < 0) != (enclosing[i].size() % 2 == 1);
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

float finiteOrZero(float thickness) {
    return std::isfinite(thickness) ? thickness : 0.f;
}

// The thickness behind triangles that only a part of the area stays below.
float commonThickness(const Mesh& mesh, const std::vector<float>& thickness, double area) {
    std::vector<unsigned> order(thickness.size());
    std::iota(order.begin(), order.end(), 0u);
    tbb::parallel_sort(order.begin(), order.end(),
                       [&](unsigned a, unsigned b) { return std::tie(thickness[a], a) < std::tie(thickness[b], b); });
    double below = 0;
    for (const unsigned triangle : order) {
        below += glm::length(areaVector(mesh, mesh.triangles[triangle]));
        if (below > uncommonArea * area) return finiteOrZero(thickness[triangle]);
    }
    return 0;
}

void findThinWalls(const Mesh& mesh, float wall, MeshReport& report) {
    if (!(report.bounds.longestSide() > 0)) return;
    const WallFinder finder(mesh);
    std::vector<float> thickness(mesh.triangles.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, thickness.size(), 1024), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) thickness[i] = finder.thicknessBehind(unsigned(i));
    });
    report.thinnestWall = finiteOrZero(*std::min_element(thickness.begin(), thickness.end()));
    report.commonWall = commonThickness(mesh, thickness, report.area);
    report.thinWalls =
        std::size_t(std::count_if(thickness.begin(), thickness.end(), [&](float t) { return t < wall; }));
}

}  // namespace

MeshGlance glance(const Mesh& mesh) {
    validate(mesh);
    if (balanced(mesh)) return {true, true};
    MeshGlance seen{true, true};
    Topology(mesh).forEachEdge([&](std::span<const EdgeUse> uses) {
        const int net = netRuns(uses);
        seen.closed &= uses.size() > 1 && (uses.size() == 2 || net == 0);
        seen.oriented &= uses.size() == 1 || net == 0;
    });
    return seen;
}

MeshReport inspect(const Mesh& input, float wall) {
    validate(input);
    MeshReport report;
    const Mesh mesh = weld(input);
    report.points = mesh.points.size();
    report.triangles = input.triangles.size();
    report.degenerateTriangles = input.triangles.size() - mesh.triangles.size();
    if (mesh.triangles.empty()) return report;
    report.bounds = bounds(mesh);
    report.origin = mesh.origin;
    const Topology topology(mesh);
    const TriangleTree tree(mesh);
    const std::vector<unsigned> of = components(mesh, report.components);
    std::vector<Component> all = gather(mesh, of, report.components);
    countEdges(topology, of, all, report);
    report.boundaryLoops = countLoops(topology, mesh.points.size());
    report.nonManifoldVertices = countNonManifoldVertices(topology, mesh.points.size());
    for (const Component& component : all) report.volume += component.volume;
    for (const auto& t : mesh.triangles) {
        const double area = glm::length(areaVector(mesh, t));
        report.area += area;
        report.degenerateTriangles += !(area > 0);
    }
    report.duplicateTriangles = countDuplicates(topology);
    report.insideOutComponents = countInsideOut(mesh, tree, of, all);
    report.selfIntersections = countPiercingPairs(mesh, topology, tree);
    report.flippedTriangles = orient(mesh).turnedTriangles;
    findThinWalls(mesh, wall, report);
    return report;
}

std::string verdict(const MeshReport& report) {
    if (report.triangles == 0 || report.triangles == report.degenerateTriangles) return "no triangle has an area";
    std::string text = !report.closed()    ? (report.boundaryEdges ? "open" : "closed, but not everywhere a surface")
                       : report.oriented() ? "closed and oriented"
                                           : "closed, but not oriented";
    const char* separator = ": ";
    const auto add = [&](std::size_t count, const char* one, const char* many, const std::string& more = "") {
        if (count == 0) return;
        text += fmt::format("{}{} {}{}", separator, count, count == 1 ? one : many, more);
        separator = ", ";
    };
    add(report.boundaryEdges, "boundary edge", "boundary edges",
        fmt::format(" in {} {}", report.boundaryLoops, report.boundaryLoops == 1 ? "loop" : "loops"));
    add(report.nonManifoldEdges, "non-manifold edge", "non-manifold edges");
    add(report.misorientedEdges, "misoriented edge", "misoriented edges");
    add(report.insideOutComponents, "component inside out", "components inside out");
    add(report.flippedTriangles, "triangle to be turned", "triangles to be turned");
    add(report.selfIntersections, "pair of triangles intersecting", "pairs of triangles intersecting");
    add(report.nonManifoldVertices, "non-manifold vertex", "non-manifold vertices");
    add(report.duplicateTriangles, "repeated triangle", "repeated triangles");
    add(report.degenerateTriangles, "triangle without area", "triangles without area");
    return text;
}

}  // namespace bilayer
