// SPDX-License-Identifier: Apache-2.0
// Branch and bound. Space is divided into cubes, the deepest ones first. No point of a cube is deeper in the body than
// the cube's centre by more than half a diagonal, so cubes without a deep point are discarded. Bodies that are wide
// enough somewhere are found so. Where all of a body is about as thin, a field decides on all cubes at once.
#include "integration/fluid/detail/lattice_cover.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bitset>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <queue>
#include <vector>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "sdf/base/divided_cubes.h"
#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/bvh/triangle_tree.h"
#include "sdf/bvh/winding_number.h"
#include "sdf/sign/distance_to_triangles.h"

namespace bilayer::fluid::detail {

using namespace bilayer::detail;

namespace {

/// Lattices along an axis. The cubes of the smallest side are centred at their voxels.
constexpr int lattices = 4;
/// Count of cubes that are divided at once, and of those after which the search gives up.
constexpr std::size_t cubesAtOnce = 64, maxCubes = 4096;
/// Count of triangles from which a climb starts, and the first and last depth behind them [voxels].
constexpr std::size_t climbs = 64;
constexpr double firstDepth = 1e-2, lastDepth = 1e-5;
/// A climb ends with steps below this fraction of the depth.
constexpr double minStep = 1e-3;
constexpr double infinite = std::numeric_limits<double>::infinity();
/// Half a diagonal of the smallest cube: the maximum distance of a lattice from the next one that is tried.
const double minDepth = std::sqrt(3.0) / (2 * lattices);  // [voxels]

/// The depth of points inside of a body.
class Depth {
  public:
    Depth(const Mesh& mesh, Progress* progress) : mesh_(mesh), tree_(mesh, progress), winding_(mesh, progress) {}

    /// The distance to the mesh, negative outside.
    double operator()(const glm::dvec3& point) const {
        const double away = distance(point, infinite);
        return winding_.isInside(point) ? away : -away;
    }
    double distance(const glm::dvec3& point, double bound) const {
        return distanceToTriangles(mesh_, tree_, point, bound);
    }

  private:
    const Mesh& mesh_;
    const TriangleTree tree_;
    const WindingNumber winding_;
};

/// A cube of the search. Lengths in the smallest side.
struct Cube {
    glm::dvec3 lower;  // whole numbers, from the body's lower corner
    double side;
    double depth;  // of the centre [voxels]

    double maxDepth() const { return depth + side * minDepth; }
    bool operator<(const Cube& other) const { return maxDepth() < other.maxDepth(); }
};

using Covered = std::bitset<lattices * lattices * lattices>;

/// The lattice with a voxel at the centre of a cube of the smallest side.
std::size_t latticeOfCube(const glm::ivec3& cube) {
    const glm::ivec3 in = cube & (lattices - 1);
    return (std::size_t(in.x) * lattices + std::size_t(in.y)) * lattices + std::size_t(in.z);
}

class CoverSearch {
  public:
    CoverSearch(const Mesh& mesh, Progress* progress)
        : progress_(progress), depth_(mesh, progress), box_(bounds(mesh)), origin_(box_.lower) {}

    /// Whether all lattices are covered. Nothing if that is not decided soon.
    std::optional<bool> run() {
        std::priority_queue<Cube> cubes;
        cubes.push(whole());
        for (std::size_t count = 0; !cubes.empty() && !covered_.all(); count += cubesAtOnce) {
            if (count >= maxCubes) return std::nullopt;
            std::vector<Cube> batch;
            for (; batch.size() < cubesAtOnce && !cubes.empty(); cubes.pop())
                if (isNeeded(cubes.top())) batch.push_back(cubes.top());
            for (const Cube& part : divided(batch, [&](const Cube& cube) { return octantsOf(cube); }))
                if (part.side > 1)
                    cubes.push(part);
                else
                    covered_.set(latticeOf(part.lower));
        }
        return covered_.all();
    }

  private:
    Cube whole() const {
        double side = lattices;
        while (side < double(lattices) * double(box_.longestSide())) side *= 2;
        return {glm::dvec3(0), side, depth_(centre(glm::dvec3(0), side))};
    }

    glm::dvec3 centre(const glm::dvec3& lower, double side) const {
        return origin_ + (lower + 0.5 * side) / double(lattices);
    }

    static std::size_t latticeOf(const glm::dvec3& lower) { return latticeOfCube(glm::ivec3(lower)); }

    /// Whether a cube may hold voxels of a lattice that has none inside yet.
    bool isNeeded(const Cube& cube) const {
        if (cube.side >= lattices) return true;
        const int side = int(cube.side);
        for (int i = 0; i < side * side * side; ++i)
            if (!covered_[latticeOf(cube.lower + glm::dvec3(i / side / side, i / side % side, i % side))]) return true;
        return false;
    }

    /// Returns the octants with deep points.
    std::vector<Cube> octantsOf(const Cube& cube) const {
        poll(progress_);
        std::vector<Cube> parts;
        for (int octant = 0; octant < 8; ++octant) {
            const double side = 0.5 * cube.side;
            const glm::dvec3 lower = cube.lower + side * glm::dvec3(octant >> 2, octant >> 1 & 1, octant & 1);
            const Cube part{lower, side, depthIn(cube, centre(lower, side))};
            if ((side > 1 ? part.maxDepth() : part.depth) >= minDepth) parts.push_back(part);
        }
        return parts;
    }

    double depthIn(const Cube& cube, const glm::dvec3& point) const {
        const double step = glm::distance(point, centre(cube.lower, cube.side));
        // no surface reaches into the ball around the cube's centre
        return step < cube.depth ? depth_.distance(point, cube.depth + step) : depth_(point);
    }

    Progress* progress_;
    const Depth depth_;
    const Bounds box_;
    const glm::dvec3 origin_;
    Covered covered_;  // lattices with a voxel inside
};

// The depths of all cubes of the smallest side at once: those of a field whose voxels are these cubes.
bool isCoveredInField(const Mesh& mesh, Progress* progress) {
    Mesh inCubes{{}, mesh.triangles, {}};
    const glm::dvec3 origin(bounds(mesh).lower);
    for (const glm::vec3& p : mesh.points)
        inCubes.points.emplace_back(double(lattices) * (glm::dvec3(p) - origin) - 0.5);
    const auto goesOn = [&](float) {
        poll(progress);
        return true;
    };
    const LevelSet field = build(inCubes, {.voxelSize = 1,
                                           .exteriorWidthVoxels = 1,
                                           .interiorWidthVoxels = 1,
                                           .sign = Sign::winding,
                                           .progress = goesOn});
    Covered covered;
    for (auto value = field.grids().distance->tree().cbeginValueAll(); value; ++value) {
        if (!(-double(*value) >= lattices * minDepth)) continue;
        const openvdb::Coord cube = value.getCoord();
        covered.set(latticeOfCube({cube.x(), cube.y(), cube.z()}));
        if (!value.isVoxelValue()) return true;  // a tile has cubes of all lattices
    }
    return covered.all();
}

// Moves to deeper places as long as there are any next to it. Steps are shorter than the depth, so all places are
// inside.
WidePlace climbFrom(const Depth& depth, glm::dvec3 place, double deep) {
    for (double step = 0.5 * deep; step > minStep * deep;) {
        const double before = deep;
        for (int axis = 0; axis < 3; ++axis)
            for (const double side : {-1.0, 1.0}) {
                glm::dvec3 next = place;
                next[axis] += side * step;
                const double there = depth.distance(next, infinite);
                if (there > deep) place = next, deep = there;
            }
        step = deep > before ? 0.5 * deep : 0.5 * step;
    }
    return {2 * deep, place};
}

// Climbs from behind a triangle.
WidePlace climb(const Mesh& mesh, const Depth& depth, const glm::uvec3& triangle) {
    const glm::dvec3 a(mesh.points[triangle.x]), b(mesh.points[triangle.y]), c(mesh.points[triangle.z]);
    const glm::dvec3 across = glm::cross(b - a, c - a);
    const double area = glm::length(across);
    if (!(area > 0)) return {};
    for (double start = firstDepth; start > lastDepth; start *= 0.5) {
        const glm::dvec3 place = (a + b + c) / 3.0 - start / area * across;
        if (const double deep = depth(place); deep > 0) return climbFrom(depth, place, deep);
    }
    return {};
}

}  // namespace

bool LatticeCover::isComplete() const {
    const std::optional<bool> found = CoverSearch(mesh_, progress_).run();
    return found ? *found : isCoveredInField(mesh_, progress_);
}

WidePlace LatticeCover::widestPlace() const {
    const Depth depth(mesh_, progress_);
    const std::size_t count = mesh_.triangles.size(), stride = 1 + count / climbs;
    std::vector<WidePlace> found((count + stride - 1) / stride);
    tbb::parallel_for(std::size_t(0), found.size(), [&](std::size_t i) {
        poll(progress_);
        found[i] = climb(mesh_, depth, mesh_.triangles[i * stride]);
    });
    const auto byWidth = [](const WidePlace& a, const WidePlace& b) { return a.widthVoxels < b.widthVoxels; };
    return found.empty() ? WidePlace{} : *std::max_element(found.begin(), found.end(), byWidth);
}

}  // namespace bilayer::fluid::detail
