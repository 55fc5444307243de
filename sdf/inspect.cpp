// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/inspect.h>

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "sdf/base/large_array.h"
#include "sdf/base/polled_loop.h"
#include "sdf/base/welding.h"
#include "sdf/bvh/triangle_tree.h"
#include "sdf/mesh/orient.h"
#include "sdf/mesh/part_nesting.h"
#include "sdf/mesh/self_intersection.h"
#include "sdf/mesh/topology.h"
#include "sdf/mesh/wall_thickness.h"

namespace bilayer {

using namespace detail;

namespace {

/// Fraction of the area that commonWall excludes: creases and convex vertices, which most meshes have.
constexpr double uncommonArea = 0.01;
/// Rays behind this fraction of the area, estimated from one leaf in `sampling`, are followed to their exit. So all
/// thin walls are measured, and most rays end early.
constexpr double measuredArea = 2 * uncommonArea;
constexpr std::size_t sampling = 32;
/// Relative volume that exceeds rounding, in units of the volume of a cube with the same area (approximately).
constexpr double clearVolume = 1e-6;

constexpr std::size_t edgesPerSum = 4096;

/// Phases that count for the progress: topology, hierarchy, components, intersections, orientation.
constexpr std::size_t phases = 5;

struct Component {
    double volume = 0;
    bool closed = true;
};

// Calls visit(uses, sum) for all edges and returns the combined sum.
template <class Sum, class Visit>
Sum overEdges(const Topology& topology, Visit visit) {
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, topology.edges.size(), edgesPerSum), Sum{},
        [&](const auto& range, Sum sum) {
            topology.forEdges(range.begin(), range.end(), [&](std::span<const EdgeUse> uses) { visit(uses, sum); });
            return sum;
        },
        std::plus<>());
}

struct EdgeCounts {
    std::size_t boundary = 0, nonManifold = 0, misoriented = 0;

    EdgeCounts operator+(const EdgeCounts& o) const {
        return {boundary + o.boundary, nonManifold + o.nonManifold, misoriented + o.misoriented};
    }
};

int netRuns(std::span<const EdgeUse> uses) {
    int net = 0;
    for (const EdgeUse& use : uses) net += use.direction();
    return net;
}

void countEdges(const Topology& topology, MeshReport& report) {
    const auto counts = overEdges<EdgeCounts>(topology, [](std::span<const EdgeUse> uses, EdgeCounts& sum) {
        sum.boundary += uses.size() == 1;
        sum.nonManifold += uses.size() > 2;
        sum.misoriented += uses.size() > 1 && netRuns(uses) != 0;
    });
    report.boundaryEdges = counts.boundary;
    report.nonManifoldEdges = counts.nonManifold;
    report.misorientedEdges = counts.misoriented;
}

std::vector<EdgeUse> boundary(const Topology& topology) {
    std::vector<EdgeUse> edges;
    topology.forEachEdge([&](std::span<const EdgeUse> uses) {
        if (uses.size() == 1) edges.push_back(uses[0]);
    });
    return edges;
}

// Counts holes: sets of boundary edges connected by shared vertices.
std::size_t countLoops(const std::vector<EdgeUse>& boundary, std::size_t vertices) {
    DisjointSets sets(vertices);
    std::vector<unsigned> ends;
    for (const EdgeUse& edge : boundary) sets.join(edge.low, edge.high);
    for (const EdgeUse& edge : boundary) ends.push_back(sets.root(edge.low));
    std::sort(ends.begin(), ends.end());
    return std::size_t(std::unique(ends.begin(), ends.end()) - ends.begin());
}

// Counts vertices with several fans. The corners at a vertex that are connected by edges form one fan.
std::size_t countNonManifoldVertices(const Topology& topology, std::size_t vertices) {
    const auto corner = [&](unsigned triangle, unsigned vertex) {
        const glm::uvec3& t = topology.triangles[triangle];
        return 3 * triangle + (t.x == vertex ? 0 : t.y == vertex ? 1 : 2);
    };
    ConcurrentDisjointSets fans(3 * topology.triangles.size());
    // Each union of two sets reduces the count of fans by one.
    const std::size_t joined = overEdges<std::size_t>(topology, [&](std::span<const EdgeUse> uses, std::size_t& sum) {
        for (const EdgeUse& use : uses.subspan(1))
            for (const unsigned end : {use.low, use.high})
                sum += fans.join(corner(uses[0].triangle, end), corner(use.triangle, end));
    });
    if (3 * topology.triangles.size() - joined == vertices) return 0;
    std::vector<std::uint8_t> count(vertices, 0);  // 2 means two or more
    for (unsigned i = 0; i < topology.triangles.size(); ++i)
        for (unsigned k = 0; k < 3; ++k) {
            std::uint8_t& at = count[topology.triangles[i][k]];
            if (at < 2) at = std::uint8_t(at + (fans.root(3 * i + k) == 3 * i + k));
        }
    return std::size_t(std::count(count.begin(), count.end(), 2));
}

std::size_t countDuplicates(const Topology& topology) {
    std::size_t duplicates = 0;
    for (unsigned i = 0; i < topology.original.size(); ++i) duplicates += topology.original[i] != i;
    return duplicates;
}

// Finds the components connected by shared vertices, and returns the component index of each triangle.
std::vector<unsigned> components(const Mesh& mesh, std::size_t& count) {
    ConcurrentDisjointSets sets = connectedVertices(mesh);
    std::vector<unsigned> number(mesh.points.size(), noPart), of(mesh.triangles.size());
    forAllPolled(of.size(), nullptr, [&](std::size_t i) { of[i] = sets.root(mesh.triangles[i].x); });
    count = 0;
    for (unsigned& component : of) {
        unsigned& n = number[component];
        if (n == noPart) n = unsigned(count++);
        component = n;
    }
    return of;
}

// Contributions of each triangle to the sums.
struct Measures {
    LargeArray<double> areas, volumes;

    Measures(const Mesh& mesh, const Bounds& box) : areas(mesh.triangles.size()), volumes(mesh.triangles.size()) {
        const glm::dvec3 origin(box.centre());
        forAllPolled(areas.size(), nullptr, [&](std::size_t i) {
            const glm::uvec3& t = mesh.triangles[i];
            const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
            const glm::dvec3 area = 0.5 * glm::cross(b - a, c - a);
            areas[i] = glm::length(area);
            volumes[i] = glm::dot(area, a - origin) / 3;
        });
    }
};

// Counts components with the wrong orientation. A component inside an even count of others should have positive volume,
// a cavity inside an odd count negative volume.
std::size_t countInsideOut(const Mesh& mesh, const TriangleTree& tree, std::vector<unsigned> of,
                           const std::vector<Component>& all, Progress& progress) {
    if (all.size() == 1) return all[0].closed && all[0].volume < 0;
    for (unsigned& component : of)
        if (!all[component].closed) component = noPart;
    const PartNesting nesting(mesh, tree, of, all.size(), &progress);
    std::vector<std::size_t> inherited(all.size());
    std::size_t wrong = 0;
    for (const unsigned part : nesting.largestFirst()) {
        const std::size_t containers = nesting.sum(part, inherited, [](unsigned) { return std::size_t(1); });
        wrong += all[part].closed && (all[part].volume < 0) != (containers % 2 == 1);
    }
    return wrong;
}

// Returns whether orient() has nothing to flip. This holds if every edge has two triangles with opposite directions,
// every vertex has one fan, and all components have clearly positive volume. A flip requires a component of negative
// volume.
bool isKnownToBeOriented(const MeshReport& report, const std::vector<Component>& all) {
    return report.closed() && report.misorientedEdges == 0 && report.nonManifoldVertices == 0 &&
           std::all_of(all.begin(), all.end(), [&](const Component& component) {
               return component.volume > clearVolume * std::pow(report.area, 1.5);
           });
}

float finiteOrZero(float thickness) {
    return std::isfinite(thickness) ? thickness : 0.f;
}

// Returns the thickness that triangles of this area stay below; infinite if there are not so many.
float thicknessAt(double area, const std::vector<float>& thickness, const Measures& measures) {
    // Sorted by thickness, then by index: the bit patterns of positive floats have the same order as their values.
    LargeArray<std::uint64_t> order(thickness.size());
    forAllPolled(order.size(), nullptr, [&](std::size_t i) {
        order[i] = std::uint64_t(std::bit_cast<std::uint32_t>(thickness[i])) << 32 | i;
    });
    double below = 0;
    // The search usually ends within the first few of many triangles.
    std::size_t sorted = 0;
    for (std::size_t i = 0; i < order.size(); ++i) {
        if (i == sorted) {
            sorted = std::min(order.size(), 2 * sorted + order.size() / 32 + 1);
            std::uint64_t *from = order.data() + i, *to = order.data() + sorted;
            std::nth_element(from, to - 1, order.data() + order.size());
            std::sort(from, to);
        }
        const auto triangle = std::uint32_t(order[i]);
        below += measures.areas[triangle];
        if (below > area) return thickness[triangle];
    }
    return std::numeric_limits<float>::infinity();
}

void findThinWalls(const TriangleTree& tree, const Measures& measures, float wall, MeshReport& report,
                   Progress& progress) {
    if (!(report.bounds.longestSide() > 0)) return;
    const std::vector<float> sample = wallThickness(tree, {.stride = sampling}, &progress);
    WallSearch search{std::max(wall, thicknessAt(measuredArea * report.area / double(sampling), sample, measures))};
    std::vector<float> thickness = wallThickness(tree, search, &progress);
    float common = thicknessAt(uncommonArea * report.area, thickness, measures);
    if (!(common < search.limit) && std::isfinite(search.limit)) {
        thickness = wallThickness(tree, {}, &progress);
        common = thicknessAt(uncommonArea * report.area, thickness, measures);
    }
    report.thinnestWall = finiteOrZero(*std::min_element(thickness.begin(), thickness.end()));
    report.commonWall = finiteOrZero(common);
    report.thinWalls =
        std::size_t(std::count_if(thickness.begin(), thickness.end(), [&](float t) { return t < wall; }));
}

}  // namespace

MeshReport inspect(const Mesh& input, float wall, const std::function<bool(float)>& callback) {
    validate(input);
    Progress progress(callback);
    progress.begin(phases);
    MeshReport report;
    const std::optional<Mesh> welded = weldUnlessDone(input);
    const Mesh& mesh = welded ? *welded : input;
    report.points = mesh.points.size();
    report.triangles = input.triangles.size();
    report.degenerateTriangles = input.triangles.size() - mesh.triangles.size();
    if (mesh.triangles.empty()) return report;
    report.bounds = bounds(mesh);
    report.origin = mesh.origin;
    const Topology topology = Topology::ofWelded(mesh, &progress);
    progress.advance();
    const TriangleTree tree(mesh, &progress);
    progress.advance();
    const std::vector<unsigned> of = components(mesh, report.components);
    std::vector<Component> all(report.components);
    countEdges(topology, report);
    if (report.boundaryEdges > 0) {
        const std::vector<EdgeUse> edges = boundary(topology);
        for (const EdgeUse& edge : edges) all[of[edge.triangle]].closed = false;
        report.boundaryLoops = countLoops(edges, mesh.points.size());
    }
    report.nonManifoldVertices = countNonManifoldVertices(topology, mesh.points.size());
    // Sums are in triangle order, independent of the thread count.
    const Measures measures(mesh, report.bounds);
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        all[of[i]].volume += measures.volumes[i];
        report.area += measures.areas[i];
        report.degenerateTriangles += !(measures.areas[i] > 0);
    }
    for (const Component& component : all) report.volume += component.volume;
    report.duplicateTriangles = countDuplicates(topology);
    report.insideOutComponents = countInsideOut(mesh, tree, of, all, progress);
    progress.advance();
    report.selfIntersections = countIntersectingPairs(mesh, topology, tree, &progress);
    progress.advance();
    if (!isKnownToBeOriented(report, all)) report.flippedTriangles = orient(mesh, &progress).flippedTriangles;
    progress.advance();
    findThinWalls(tree, measures, wall, report, progress);
    progress.finish();
    return report;
}

std::string verdict(const MeshReport& report) {
    if (report.triangles == 0 || report.triangles == report.degenerateTriangles) return "no triangle has an area";
    std::string text = !report.closed()    ? (report.boundaryEdges ? "open" : "closed, but non-manifold")
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
    add(report.flippedTriangles, "triangle to be flipped", "triangles to be flipped");
    add(report.selfIntersections, "pair of triangles intersecting", "pairs of triangles intersecting");
    add(report.nonManifoldVertices, "non-manifold vertex", "non-manifold vertices");
    add(report.duplicateTriangles, "repeated triangle", "repeated triangles");
    add(report.degenerateTriangles, "triangle without area", "triangles without area");
    return text;
}

}  // namespace bilayer
