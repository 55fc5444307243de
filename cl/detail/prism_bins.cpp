// SPDX-License-Identifier: Apache-2.0
#include "cl/detail/prism_bins.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <optional>
#include <utility>

#include "sdf/leaf/blocks.h"
#include "sdf/mesh/topology.h"

namespace bilayer::detail {
namespace {

constexpr double boxSlack = 1e-2;           // margin of a prism's box: overlap and rounding [voxels]
constexpr double minBisectorLength = 1e-6;  // two faces that coincide to within this angle have no bisecting plane
constexpr double minDeterminant = 1e-9;     // side planes closer to parallel have no corner that the box must contain
constexpr int blocksWorthCulling = 8;       // a prism whose box meets more blocks is tested against each

using Corners = std::array<glm::dvec3, 3>;

struct Box {
    glm::dvec3 lower, upper;
    void add(const glm::dvec3& point) {
        lower = glm::min(lower, point);
        upper = glm::max(upper, point);
    }
};

// A triangle with its longest edge first, and the opposite vertices across its edges.
struct Base {
    Corners corners;
    std::array<std::optional<glm::dvec3>, 3> across;
};

Base baseOf(const PrismJob& job, std::uint32_t triangle, const Corners& c, const glm::dvec3& first) {
    const auto length2 = [&](int k) {
        const glm::dvec3 edge = c[std::size_t((k + 1) % 3)] - c[std::size_t(k)];
        return glm::dot(edge, edge);
    };
    int longest = 0;
    for (int k = 1; k < 3; ++k)
        if (length2(k) > length2(longest)) longest = k;
    Base base;
    for (int k = 0; k < 3; ++k) {
        const int from = (k + longest) % 3;
        base.corners[std::size_t(k)] = c[std::size_t(from)] - first;
        const std::uint32_t vertex = job.across.ofTriangle[triangle][from];
        if (vertex != VerticesAcross::none)
            base.across[std::size_t(k)] = glm::dvec3(job.mesh.points[vertex]) * job.voxelsPerUnit - first;
    }
    return base;
}

// A prism in double precision.
struct Shape {
    glm::dvec3 axes[3];  // u, w, n
    glm::dvec3 start;    // corner 0
    glm::dvec2 corners[3], along[3];
    double lengths[3];
    glm::dvec2 sideNormal[3];

    // An offset in voxels, transformed to the frame.
    glm::dvec3 inFrame(const glm::dvec3& offset) const {
        return {glm::dot(axes[0], offset), glm::dot(axes[1], offset), glm::dot(axes[2], offset)};
    }
    // Unit vector in the frame's plane from edge k into the triangle.
    glm::dvec2 inward(int k) const { return {-along[k].y, along[k].x}; }
};

// The plane that bisects the angle between a face and its neighbour across edge k is equidistant from both. Its normal
// is thus the difference of the two directions from the edge into the faces.
glm::dvec2 sideNormalTo(const Shape& shape, int k, const glm::dvec3& vertexAcross) {
    const glm::dvec3 offset = shape.inFrame(vertexAcross - shape.start);
    const glm::dvec2 fromEdge = glm::dvec2(offset) - shape.corners[k];
    const glm::dvec2 intoNeighbour(glm::dot(shape.inward(k), fromEdge), offset.z);
    const double depth = glm::length(intoNeighbour);
    if (!(depth > 0)) return {0, 0};
    const glm::dvec2 normal = glm::dvec2(1, 0) - intoNeighbour / depth;
    const double length = glm::length(normal);
    return length > minBisectorLength ? normal / length : glm::dvec2(0);
}

// Nothing if the triangle has no area.
std::optional<Shape> shapeOf(const Base& base) {
    const auto& [a, b, c] = base.corners;
    const glm::dvec3 normal = glm::cross(b - a, c - a);
    const double area = glm::length(normal);
    if (!(area > 0)) return std::nullopt;
    Shape shape;
    shape.start = a;
    shape.axes[0] = glm::normalize(b - a);
    shape.axes[2] = normal / area;
    shape.axes[1] = glm::cross(shape.axes[2], shape.axes[0]);
    for (int k = 0; k < 3; ++k) shape.corners[k] = glm::dvec2(shape.inFrame(base.corners[std::size_t(k)] - a));
    for (int k = 0; k < 3; ++k) {
        const glm::dvec2 edge = shape.corners[(k + 1) % 3] - shape.corners[k];
        shape.lengths[k] = glm::length(edge);
        shape.along[k] = edge / shape.lengths[k];
    }
    for (int k = 0; k < 3; ++k) {
        const auto& vertex = base.across[std::size_t(k)];
        shape.sideNormal[k] = vertex ? sideNormalTo(shape, k, *vertex) : glm::dvec2(0);
    }
    return shape;
}

// Adds the two ends of the line in which the side planes at a vertex meet. Returns false if they do not meet.
bool addCorner(const Shape& shape, int k, double reach, Box& box) {
    const int before = (k + 2) % 3;
    const glm::dvec2 p = shape.sideNormal[before].x * shape.inward(before), q = shape.sideNormal[k].x * shape.inward(k);
    const double determinant = p.x * q.y - p.y * q.x;
    if (std::abs(determinant) < minDeterminant) return false;
    const glm::dvec2 slope = glm::dvec2(p.y * shape.sideNormal[k].y - q.y * shape.sideNormal[before].y,
                                        q.x * shape.sideNormal[before].y - p.x * shape.sideNormal[k].y) /
                             determinant;
    const glm::dvec3 corner = shape.start + shape.corners[k].x * shape.axes[0] + shape.corners[k].y * shape.axes[1];
    const glm::dvec3 edge = slope.x * shape.axes[0] + slope.y * shape.axes[1] + shape.axes[2];
    box.add(corner + reach * edge);
    box.add(corner - reach * edge);
    return true;
}

// A cross section of the prism at any height is a triangle similar to its own. So the vertices of its two ends bound
// the prism.
Box boxOf(const Shape& shape, const Corners& corners, double reach) {
    Box near{corners[0], corners[0]};
    near.add(corners[1]);
    near.add(corners[2]);
    near = {near.lower - reach - boxSlack, near.upper + reach + boxSlack};
    Box ends{glm::dvec3(1e30), glm::dvec3(-1e30)};
    for (int k = 0; k < 3; ++k)
        if (!addCorner(shape, k, reach, ends)) return near;
    return {glm::max(near.lower, ends.lower - boxSlack), glm::min(near.upper, ends.upper + boxSlack)};
}

Prism rounded(const Shape& shape, const Box& box, std::uint32_t triangle) {
    Prism prism;
    prism.u = glm::vec3(shape.axes[0]);
    prism.n = glm::vec3(shape.axes[2]);
    prism.origin = glm::vec3(shape.inFrame(-shape.start));
    prism.lower = glm::vec3(box.lower);
    prism.upper = glm::vec3(box.upper);
    prism.length = float(shape.lengths[0]);
    prism.apex = glm::vec2(shape.corners[2]);
    for (int k = 0; k < 3; ++k) prism.sideNormal[k] = glm::vec2(shape.sideNormal[k]);
    prism.triangle = std::int32_t(triangle);
    return prism;
}

// A half-space: normal . v >= -depth.
struct Plane {
    glm::dvec3 normal;
    double depth;
};

// The planes around a prism.
std::array<Plane, 5> planesOf(const Shape& shape, double reach) {
    const glm::dvec3& n = shape.axes[2];
    const double height = glm::dot(n, shape.start);
    std::array<Plane, 5> planes{Plane{n, reach - height}, Plane{-n, reach + height}};
    for (int k = 0; k < 3; ++k) {
        const glm::dvec2 inward = shape.sideNormal[k].x * shape.inward(k);
        const glm::dvec3 normal = inward.x * shape.axes[0] + inward.y * shape.axes[1] + shape.sideNormal[k].y * n;
        const glm::dvec3 corner = shape.start + shape.corners[k].x * shape.axes[0] + shape.corners[k].y * shape.axes[1];
        planes[std::size_t(k) + 2] = {normal, -glm::dot(normal, corner)};
    }
    return planes;
}

// Whether all voxels of a block are beyond one of the planes.
bool isBeyondPlane(const std::array<Plane, 5>& planes, const glm::ivec3& block) {
    constexpr double half = 0.5 * (blockSide - 1);
    const glm::dvec3 centre = glm::dvec3(block * blockSide) + half;
    return std::any_of(planes.begin(), planes.end(), [&](const Plane& plane) {
        const double extent = half * (std::abs(plane.normal.x) + std::abs(plane.normal.y) + std::abs(plane.normal.z));
        return glm::dot(plane.normal, centre) + plane.depth + extent < -boxSlack;
    });
}

// Adds a prism and its blocks, if it reaches any.
void bin(const Shape& shape, const Box& box, double reach, std::uint32_t triangle, int side, PrismBlocks& blocks) {
    const glm::ivec3 last(side / blockSide - 1);
    if (glm::any(glm::lessThan(box.upper, glm::dvec3(0))) || glm::any(glm::greaterThan(box.lower, glm::dvec3(side))))
        return;
    const glm::ivec3 lower = glm::ivec3(glm::max(box.lower, 0.0)) / blockSide,
                     upper = glm::min(glm::ivec3(glm::min(box.upper, double(side))) / blockSide, last),
                     size = upper - lower + 1;
    if (glm::any(glm::lessThan(size, glm::ivec3(1)))) return;
    const bool large = size.x * size.y * size.z > blocksWorthCulling;
    const std::array<Plane, 5> planes = large ? planesOf(shape, reach) : std::array<Plane, 5>{};
    const auto prism = std::uint32_t(blocks.prisms.size());
    const std::size_t before = blocks.pairs.size();
    for (int x = lower.x; x <= upper.x; ++x)
        for (int y = lower.y; y <= upper.y; ++y)
            for (int z = lower.z; z <= upper.z; ++z) {
                if (large && isBeyondPlane(planes, {x, y, z})) continue;
                const auto block = std::uint32_t((x * (last.x + 1) + y) * (last.x + 1) + z);
                ++blocks.cursors[block];
                blocks.pairs.push_back({block, prism});
            }
    if (blocks.pairs.size() > before) blocks.prisms.push_back(rounded(shape, box, triangle));
}

// The second half of a counting sort: converts pairs of block and prism to a list for each block.
void sortPairs(int blocksAlong, PrismBlocks& blocks) {
    blocks.places.clear();
    blocks.offsets.assign(1, 0);
    std::uint32_t sum = 0;
    for (std::size_t block = 0; block < blocks.cursors.size(); ++block) {
        const std::uint32_t count = std::exchange(blocks.cursors[block], sum);
        if (count == 0) continue;
        sum += count;
        const int b = int(block);
        blocks.places.push_back(
            glm::ivec3(b / (blocksAlong * blocksAlong), b / blocksAlong % blocksAlong, b % blocksAlong) * blockSide);
        blocks.offsets.push_back(sum);
    }
    blocks.reaching.resize(sum);
    for (const auto& pair : blocks.pairs) blocks.reaching[blocks.cursors[pair.block]++] = pair.prism;
}

}  // namespace

VerticesAcross::VerticesAcross(const Mesh& mesh, Progress& progress)
    : ofTriangle(mesh.triangles.size(), glm::uvec3(none)) {
    const Topology topology(mesh, &progress);
    // the edge of a triangle that starts or ends at a vertex of the welded mesh
    const auto edgeOf = [&](const EdgeUse& use) {
        const glm::uvec3& t = topology.triangles[use.triangle];
        const unsigned from = use.forward ? use.low : use.high;
        return t.x == from ? 0 : t.y == from ? 1 : 2;
    };
    topology.forEachEdge([&](std::span<const EdgeUse> uses) {
        if (uses.size() != 2) return;
        for (int i = 0; i < 2; ++i) {
            const EdgeUse &use = uses[std::size_t(i)], &other = uses[std::size_t(1 - i)];
            ofTriangle[use.triangle][edgeOf(use)] = mesh.triangles[other.triangle][(edgeOf(other) + 2) % 3];
        }
    });
}

void binPrisms(const PrismJob& job, const TriangleBins& bins, std::size_t brick, PrismBlocks& blocks) {
    const int blocksAlong = bins.side / blockSide;
    const glm::dvec3 first(bins.origins[brick]);
    blocks.prisms.clear();
    blocks.pairs.clear();
    blocks.cursors.assign(std::size_t(blocksAlong) * std::size_t(blocksAlong) * std::size_t(blocksAlong), 0);
    forEachTriangle(job.mesh, bins.trianglesOf(brick), job.voxelsPerUnit, [&](std::uint32_t t, const Corners& c) {
        const Base base = baseOf(job, t, c, first);
        if (const auto shape = shapeOf(base))
            bin(*shape, boxOf(*shape, base.corners, double(job.reach)), double(job.reach), t, bins.side, blocks);
    });
    sortPairs(blocksAlong, blocks);
}

}  // namespace bilayer::detail
