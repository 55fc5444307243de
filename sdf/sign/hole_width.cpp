// SPDX-License-Identifier: Apache-2.0
// Branch and bound. Space is divided into cubes, starting with those that can contain the widest hole, until one is
// small enough. A cube is discarded if no winding number in it can be one half. This follows from a bound of its slope,
// which also holds for a cube that surfaces cross. In a ball without surface it follows from Harnack's inequality,
// because the winding number is harmonic there.
#include "sdf/sign/hole_width.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>
#include <queue>
#include <vector>

#include "sdf/base/divided_cubes.h"
#include "sdf/base/progress.h"
#include "sdf/bvh/triangle_tree.h"
#include "sdf/bvh/winding_number.h"
#include "sdf/sign/distance_to_triangles.h"
#include "sdf/sign/winding_slope.h"

namespace bilayer::detail {
namespace {

/// Cubes with half a side below this fraction of the hole's radius are not divided further.
constexpr double tolerance = 0.05;
/// Error of winding numbers, as a fraction of their distance to one half.
constexpr double share = 0.1;
const double halfDiagonal = std::sqrt(3.0);  // of a cube, in units of half its side

struct Cube {
    glm::dvec3 centre;
    double half;      // half a side [m]
    double distance;  // from the centre to the mesh [m]

    double radius() const { return halfDiagonal * half; }
    double maxDistance() const { return distance + radius(); }
    bool operator<(const Cube& other) const { return maxDistance() < other.maxDistance(); }
};

class Search {
  public:
    Search(const Mesh& mesh, double minimum, Progress* progress)
        : mesh_(mesh),
          minRadius_(0.5 * minimum),
          progress_(progress),
          tree_(mesh, progress),
          winding_(mesh, progress),
          slope_(mesh, progress) {}

    // Cubes are taken in descending order of the distances that they may hold. The first small one is thus the same for
    // any minimum width that it reaches.
    Hole run() const {
        std::priority_queue<Cube> cubes;
        cubes.push(whole());
        while (!cubes.empty()) {
            if (const Cube& widest = cubes.top(); isSmall(widest)) return {2 * widest.maxDistance(), widest.centre};
            std::vector<Cube> batch;
            for (; batch.size() < cubesAtOnce && !cubes.empty() && !isSmall(cubes.top()); cubes.pop())
                batch.push_back(cubes.top());
            for (const Cube& part : divided(batch, [&](const Cube& cube) { return octantsOf(cube); })) cubes.push(part);
        }
        return {};
    }

  private:
    // The winding number is below one half beyond a distance R with area / (4 pi R^2) = 1/2.
    Cube whole() const {
        const Bounds box = bounds(mesh_);
        const double reach = std::sqrt(winding_.area() / (2 * glm::pi<double>()));
        const glm::dvec3 centre(box.centre());
        return {centre, 0.5 * double(box.longestSide()) + reach,
                distance(centre, std::numeric_limits<double>::infinity())};
    }

    static bool isSmall(const Cube& cube) { return cube.half <= tolerance * cube.distance; }

    /// Returns the octants that may contain a sufficiently wide hole.
    std::vector<Cube> octantsOf(const Cube& cube) const {
        poll(progress_);
        std::vector<Cube> parts;
        for (int octant = 0; octant < 8; ++octant) {
            const Cube part = child(cube, octant);
            if (part.maxDistance() >= minRadius_ && mayHoldClosing(part)) parts.push_back(part);
        }
        return parts;
    }

    Cube child(const Cube& cube, int octant) const {
        const double half = 0.5 * cube.half;
        const glm::dvec3 step(octant & 1 ? half : -half, octant & 2 ? half : -half, octant & 4 ? half : -half);
        return {cube.centre + step, half, distance(cube.centre + step, cube.distance + glm::length(step))};
    }

    double distance(const glm::dvec3& point, double bound) const {
        return distanceToTriangles(mesh_, tree_, point, bound);
    }

    /// Returns whether the winding number may be one half somewhere in a cube, other than by a jump across a surface.
    bool mayHoldClosing(const Cube& cube) const {
        const WindingNumber::Estimate number = winding_.estimate(cube.centre, share);
        // Across closed surfaces the winding number changes by integers.
        const double off = std::abs(number.value - std::round(number.value)) + number.error;
        if (off < 0.5 && (slope_(cube.centre, cube.radius()) * cube.radius() < 0.5 - off)) return false;
        const double t = cube.radius() / cube.distance;
        if (!(t < 1)) return true;
        if (off * (1 + t) < 0.5 * (1 - t) * (1 - t)) return false;
        return std::abs(number.value - 0.5) - number.error < 0.5;
    }

    const Mesh& mesh_;
    const double minRadius_;
    Progress* progress_;
    const TriangleTree tree_;
    const WindingNumber winding_;
    const WindingSlope slope_;
};

}  // namespace

Hole widestHole(const Mesh& mesh, double minimum, Progress* progress) {
    return Search(mesh, minimum, progress).run();
}

}  // namespace bilayer::detail
