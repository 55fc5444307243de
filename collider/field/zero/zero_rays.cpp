// SPDX-License-Identifier: Apache-2.0
// The first crossing of a path into the zero set. Paths are walked from cell to cell (J. Amanatides, A. Woo, "A fast
// voxel traversal algorithm for ray tracing", Eurographics 1987, 3-10). Along a path the interpolant of a cell is a
// cubic, monotone between its extrema (H. Hansson-Soederlund, A. Evans, T. Akenine-Moeller, "Ray tracing of signed
// distance function grids", JCGT 11 (2022) 94-113).
// Tested by tests/collider/zero_set.cpp through Field::raycast().
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <limits>
#include <optional>

#include "collider/field/zero/zero_cells.h"
#include "collider/field/zero/zero_set.h"

namespace bilayer::detail {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
/// Min clearance for a ray to skip empty space; below it, visiting the next coarse cell is faster.
constexpr double minCubeStride = 6;
/// Accuracy of a crossing along a path.
constexpr double crossingTolerance = 1e-9;

// The side of a coarse cell without surface.
bool isCellInside(const FieldData& field, std::int32_t entry, const glm::ivec3& cell) {
    return entry < 0 ? entry == FieldFrame::emptyInside
                     : cellValues(field, entry, Clearance::cellSide * cell & 7).front() < 0;
}

// The cubic c[0] + c[1] t + c[2] t^2 + c[3] t^3.
struct Cubic {
    std::array<double, 4> c;

    double operator()(double t) const { return ((c[3] * t + c[2]) * t + c[1]) * t + c[0]; }
    double slope(double t) const { return (3 * c[3] * t + 2 * c[2]) * t + c[1]; }

    // The zeros of the slope in ascending order; infinite for missing ones.
    std::array<double, 2> extrema() const {
        const double a = 3 * c[3], b = c[2], discriminant = b * b - a * c[1];
        if (!(discriminant >= 0)) return {infinity, infinity};
        const double q = -(b + std::copysign(std::sqrt(discriminant), b));  // without cancellation
        const double first = a != 0 ? q / a : infinity, second = q != 0 ? c[1] / q : infinity;
        return {std::min(first, second), std::max(first, second)};
    }
};

// Multiplies a polynomial by the line from + by * t.
template <std::size_t n>
std::array<double, n + 1> times(const std::array<double, n>& p, double from, double by) {
    std::array<double, n + 1> product{};
    for (std::size_t i = 0; i < n; ++i) {
        product[i] += from * p[i];
        product[i + 1] += by * p[i];
    }
    return product;
}

// Interpolates two polynomials by the weight from + by * t.
template <std::size_t n>
std::array<double, n + 1> between(const std::array<double, n>& low, std::array<double, n> high, double from,
                                  double by) {
    for (std::size_t i = 0; i < n; ++i) high[i] -= low[i];
    std::array<double, n + 1> mixed = times(high, from, by);
    for (std::size_t i = 0; i < n; ++i) mixed[i] += low[i];
    return mixed;
}

// The interpolant in a cell along a line.
Cubic cubicAlong(const CornerValues& v, const glm::dvec3& from, const glm::dvec3& direction) {
    std::array<std::array<double, 2>, 4> z;
    for (std::size_t i = 0; i < 4; ++i) z[i] = between<1>({v[2 * i]}, {v[2 * i + 1]}, from.z, direction.z);
    const auto low = between(z[0], z[1], from.y, direction.y), high = between(z[2], z[3], from.y, direction.y);
    return {between(low, high, from.x, direction.x)};
}

// The first place in [0, length] with a negative cubic, if any.
std::optional<double> firstNegative(const Cubic& f, double length) {
    if (f(0) < 0) return 0;
    const auto [first, second] = f.extrema();
    double from = 0;
    for (double to : {first, second, length}) {
        to = std::min(to, length);
        if (!(to > from)) continue;
        if (f(to) < 0) {
            // brackets the root, with Newton steps as long as they stay in the bracket
            double inside = to, t = 0.5 * (from + to);
            while (inside - from > crossingTolerance) {
                const double value = f(t), step = t - value / f.slope(t);
                (value < 0 ? inside : from) = t;
                // steps a little beyond the root, so that both ends converge
                const double beyond = step + (value < 0 ? -0.25 : 0.25) * crossingTolerance;
                t = beyond > from && beyond < inside ? beyond : 0.5 * (from + inside);
            }
            return inside;
        }
        from = to;
    }
    return std::nullopt;
}

// The traversal of equal cubes along a path.
class GridWalk {
  public:
    glm::ivec3 cube;  // the current one
    double enter;     // where the path enters it

    // Traverses the cubes in [lower, upper).
    GridWalk(const Path& path, double side, const glm::ivec3& lower, const glm::ivec3& upper, double from, double to)
        : cube(glm::clamp(glm::floor(path.at(from) / side), glm::dvec3(lower), glm::dvec3(upper - 1))),
          enter(from),
          path_(path),
          side_(side),
          lower_(lower),
          upper_(upper),
          end_(to) {
        findExit();
    }

    bool inside() const { return enter < end_ && glm::clamp(cube, lower_, upper_ - 1) == cube; }
    double leave() const { return std::min(exit_, end_); }
    void step() {
        cube[axis_] += path_.direction[axis_] > 0 ? 1 : -1;
        enter = std::max(enter, exit_);
        findExit();
    }

  private:
    void findExit() {
        exit_ = infinity;
        for (int k = 0; k < 3; ++k) {
            if (path_.direction[k] == 0) continue;
            const double wall = side_ * (cube[k] + (path_.direction[k] > 0));
            const double at = (wall - path_.origin[k]) / path_.direction[k];
            if (at < exit_) exit_ = at, axis_ = k;
        }
    }

    Path path_;
    double side_;
    glm::ivec3 lower_, upper_;
    double end_, exit_ = 0;
    int axis_ = 0;
};

// Searches one coarse cell of a stored block.
std::optional<double> firstInsideCell(const FieldData& field, const Path& path, const glm::ivec3& cell, double from,
                                      double to) {
    const glm::ivec3 lower = Clearance::cellSide * cell;
    const std::int32_t entry = entryAt(field, lower);
    for (GridWalk walk(path, 1, lower, lower + Clearance::cellSide, from, to); walk.inside(); walk.step()) {
        const CornerValues values = cellValues(field, entry, walk.cube & 7);
        if (*std::min_element(values.begin(), values.end()) >= 0) continue;
        const glm::dvec3 start = path.at(walk.enter) - glm::dvec3(walk.cube);
        const auto along = firstNegative(cubicAlong(values, start, path.direction), walk.leave() - walk.enter);
        if (along) return walk.enter + *along;
    }
    return std::nullopt;
}

}  // namespace

std::optional<double> firstInside(const FieldData& field, const Path& path) noexcept {
    const auto clipped = clip(path, glm::dvec3(0), glm::dvec3(extentOf(field)));
    if (!clipped) return std::nullopt;
    const auto [from, to] = *clipped;
    const glm::ivec3 counts = field.coarseCells();
    for (GridWalk walk(path, Clearance::cellSide, glm::ivec3(0), counts, from, to); walk.inside();) {
        const std::int32_t entry = entryAt(field, Clearance::cellSide * walk.cube);
        if (entry == FieldFrame::emptyInside) return walk.enter;
        const double stride = clearanceAt(field, path.at(walk.enter));
        if (stride >= minCubeStride) {
            if (isCellInside(field, entry, walk.cube)) return walk.enter;
            walk = GridWalk(path, Clearance::cellSide, glm::ivec3(0), counts, walk.enter + stride, to);
            continue;
        }
        if (entry >= 0 && !field.coarse.isAbove(glm::vec3(walk.cube) + 0.5f, 0)) {
            const auto along = firstInsideCell(field, path, walk.cube, walk.enter, walk.leave());
            if (along) return along;
        }
        walk.step();
    }
    return std::nullopt;
}

}  // namespace bilayer::detail
