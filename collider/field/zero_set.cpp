// Queries of the zero set. Rays walk from cell to cell (J. Amanatides, A. Woo, "A fast voxel traversal algorithm for
// ray tracing", Eurographics 1987, 3-10). Along a ray the interpolant of a cell is a cubic, monotone between its
// extrema (H. Hansson-Soederlund, A. Evans, T. Akenine-Moeller, "Ray tracing of signed distance function grids", JCGT
// 11 (2022) 94-113). All other queries are branch and bound over cubes: those of the directory, most of which are
// rejected by their clearances, cells, and their octants.
#include "collider/field/zero_set.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

namespace bilayer::detail {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
/// Tolerance for the single precision of clearances.
constexpr double clearanceSlack = 1e-2;
/// Min clearance for a ray to skip empty space; below it, visiting the next coarse cell is faster.
constexpr double minStride = 6;
/// Accuracy of a crossing along a ray.
constexpr double rayTolerance = 1e-9;
/// Cubes of this side are not subdivided: their diagonal is within zeroTolerance.
constexpr double smallestSide = 1.0 / 2048;
static_assert(1.7321 * smallestSide < zeroTolerance);
/// Max count of tangent steps. If a path only grazes a box, each step takes half of the remaining distance.
constexpr int maxTangents = 64;
/// Tangent steps end at this distance.
constexpr double tangentTolerance = 1e-9;
/// Accuracy of a multiplier, in distance from the plane, and max count of steps. There are at most three kinks.
constexpr double multiplierTolerance = 1e-9;
constexpr int maxMultipliers = 8;

using Values = std::array<double, 8>;  // at the corners of a cube, the last axis fastest

glm::dvec3 corner(std::size_t i) {
    return {double(i >> 2), double(i >> 1 & 1), double(i & 1)};
}

// The values of a cell in a stored block.
Values cellValues(const FieldData& field, std::int32_t entry, const glm::ivec3& inBlock) {
    constexpr int x = FieldFrame::stride * FieldFrame::stride, y = FieldFrame::stride;
    const std::size_t at =
        std::size_t(entry) * FieldFrame::blockFloats + std::size_t(inBlock.x * x + inBlock.y * y + inBlock.z);
    const auto v = [&](int step) { return double(field.valueAt(at + std::size_t(step))); };
    return {v(0), v(1), v(y), v(y + 1), v(x), v(x + 1), v(x + y), v(x + y + 1)};
}

std::int32_t entryAt(const FieldData& field, const glm::ivec3& voxel) {
    return field.directory[field.entryOf(voxel >> 3)];
}

glm::ivec3 extentOf(const FieldData& field) {
    return FieldFrame::side * field.blocks;
}

// A lower bound of the distance to the surface.
double clearanceAt(const FieldData& field, const glm::dvec3& point) {
    return double(field.clearanceAt(point)) - clearanceSlack;
}

// The side of a coarse cell without surface.
bool isInside(const FieldData& field, std::int32_t entry, const glm::ivec3& part) {
    return entry < 0 ? entry == FieldFrame::emptyInside
                     : cellValues(field, entry, Clearance::partSide * part & 7).front() < 0;
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
Cubic cubicAlong(const Values& v, const glm::dvec3& from, const glm::dvec3& direction) {
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
            while (inside - from > rayTolerance) {
                const double value = f(t), step = t - value / f.slope(t);
                (value < 0 ? inside : from) = t;
                // steps a little beyond the root, so that both ends converge
                const double beyond = step + (value < 0 ? -0.25 : 0.25) * rayTolerance;
                t = beyond > from && beyond < inside ? beyond : 0.5 * (from + inside);
            }
            return inside;
        }
        from = to;
    }
    return std::nullopt;
}

// The traversal of equal cubes along a path.
class Walk {
  public:
    glm::ivec3 cube;  // the current one
    double enter;     // where the path enters it

    // Traverses the cubes in [lower, upper).
    Walk(const Path& path, double side, const glm::ivec3& lower, const glm::ivec3& upper, double from, double to)
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
std::optional<double> firstInsidePart(const FieldData& field, const Path& path, const glm::ivec3& part, double from,
                                      double to) {
    const glm::ivec3 lower = Clearance::partSide * part;
    const std::int32_t entry = entryAt(field, lower);
    for (Walk walk(path, 1, lower, lower + Clearance::partSide, from, to); walk.inside(); walk.step()) {
        const Values values = cellValues(field, entry, walk.cube & 7);
        if (*std::min_element(values.begin(), values.end()) >= 0) continue;
        const glm::dvec3 start = path.at(walk.enter) - glm::dvec3(walk.cube);
        const auto along = firstNegative(cubicAlong(values, start, path.direction), walk.leave() - walk.enter);
        if (along) return walk.enter + *along;
    }
    return std::nullopt;
}

// A cube of 2^level voxels in the directory.
struct Block {
    glm::ivec3 lower;
    int level;
};

// A cell or a sub-cell.
struct Cube {
    glm::dvec3 lower;
    double side;
    Values values;

    bool holdsZero() const {
        const auto [low, high] = std::minmax_element(values.begin(), values.end());
        return *low < 0 && *high >= 0;
    }
    glm::dvec3 centre() const { return lower + 0.5 * side; }
};

// A linear approximation of the interpolant in a cube, with its max error.
struct Plane {
    glm::dvec3 through;
    double value;  // at `through`
    glm::dvec3 gradient;
    double error;

    explicit Plane(const Cube& cube) : through(cube.centre()) {
        const Values& v = cube.values;
        // Haar transform: the coefficients of the interpolant about the centre
        std::array<double, 8> sum = v;
        for (const std::size_t axis : {1, 2, 4})
            for (std::size_t i = 0; i < 8; ++i)
                if (!(i & axis)) {
                    const double low = sum[i], high = sum[i | axis];
                    sum[i] = 0.5 * (low + high);
                    sum[i | axis] = 0.5 * (high - low);
                }
        value = sum[0];
        gradient = 2 / cube.side * glm::dvec3(sum[4], sum[2], sum[1]);
        error = std::abs(sum[3]) + std::abs(sum[5]) + std::abs(sum[6]) + std::abs(sum[7]);
    }

    double at(const glm::dvec3& point) const { return value + glm::dot(gradient, point - through); }
};

// Finds the point of the zero set with the smallest key. A Query has
//   bound(lower, upper)  a lower bound of the keys in a box; infinite if no point counts
//   bound(lower, upper, plane)  the same for the points where the plane's function is zero within its error
//   limit()              only smaller keys matter
//   offer(point)         a point of the zero set
//   settle(bound, point) the smallest cube around a point, with a lower bound of its keys
template <class Query>
class ZeroSearch {
  public:
    ZeroSearch(const FieldData& field, Query& query) : field_(field), query_(query), extent_(extentOf(field)) {}

    void run() {
        const auto longest = unsigned(std::max({extent_.x, extent_.y, extent_.z}));
        visit(Block{glm::ivec3(0), int(std::bit_width(longest - 1))});
    }

  private:
    template <class Node>
    struct Child {
        double bound;
        Node node;
    };

    // Visits children in ascending order of their bounds, as long as they are below the limit.
    template <class Node>
    void visitAll(const std::array<Child<Node>, 8>& children, std::size_t count) {
        std::array<std::uint8_t, 8> order;
        for (std::size_t i = 0; i < count; ++i) {
            std::size_t place = i;
            for (; place > 0 && children[order[place - 1]].bound > children[i].bound; --place)
                order[place] = order[place - 1];
            order[place] = std::uint8_t(i);
        }
        for (std::size_t i = 0; i < count; ++i)
            if (children[order[i]].bound < query_.limit()) visit(children[order[i]].node);
    }

    void visit(const Block& block) {
        constexpr int blockLevel = 3, partLevel = 2;
        if (block.level == blockLevel && entryAt(field_, block.lower) < 0) return;
        if (block.level == 0) return visitCell(block.lower);
        std::array<Child<Block>, 8> children;
        std::size_t count = 0;
        const int level = block.level - 1, side = 1 << level;
        for (int i = 0; i < 8; ++i) {
            const glm::ivec3 lower = block.lower + side * glm::ivec3(i >> 2, i >> 1 & 1, i & 1);
            if (lower.x >= extent_.x || lower.y >= extent_.y || lower.z >= extent_.z) continue;
            const glm::dvec3 low(lower), high(glm::min(lower + side, extent_));
            if (level >= partLevel && isClear(low, high)) continue;
            const double bound = query_.bound(low, high);
            if (bound < query_.limit()) children[count++] = {bound, {lower, level}};
        }
        visitAll(children, count);
    }

    bool isClear(const glm::dvec3& lower, const glm::dvec3& upper) const {
        return clearanceAt(field_, 0.5 * (lower + upper)) > 0.5 * glm::distance(lower, upper);
    }

    void visitCell(const glm::ivec3& voxel) {
        const Cube cell{glm::dvec3(voxel), 1, cellValues(field_, entryAt(field_, voxel), voxel & 7)};
        if (cell.holdsZero()) visit(cell);
    }

    void visit(const Cube& cube) {
        const double bound = query_.bound(cube.lower, cube.lower + cube.side, Plane(cube));
        if (!(bound < query_.limit())) return;
        const glm::dvec3 point = offerEdges(cube);
        if (cube.side <= smallestSide) return query_.settle(bound, point);
        if (!(bound < query_.limit())) return;
        visitEighths(cube);
    }

    // Offers the zeros on the edges, where the interpolant is linear: one on each edge whose ends have both signs.
    // Returns one of them.
    glm::dvec3 offerEdges(const Cube& cube) {
        glm::dvec3 point(0);
        for (std::size_t i = 0; i < 8; ++i)
            for (const std::size_t axis : {1, 2, 4}) {
                const double low = cube.values[i], high = cube.values[i | axis];
                if ((i & axis) || (low < 0) == (high < 0)) continue;
                const glm::dvec3 from = corner(i), to = corner(i | axis);
                point = cube.lower + cube.side * (from + low / (low - high) * (to - from));
                query_.offer(point);
            }
        return point;
    }

    void visitEighths(const Cube& cube) {
        // the values at the corners of the octants
        std::array<double, 27> grid;
        for (std::size_t i = 0; i < 27; ++i) {
            const std::size_t at[] = {i / 9, i / 3 % 3, i % 3};
            double sum = 0;
            for (std::size_t c = 0; c < 8; ++c) {
                const std::size_t side[] = {c >> 2, c >> 1 & 1, c & 1};
                double weight = 1;
                for (int k = 0; k < 3; ++k) weight *= 0.5 * double(side[k] ? at[k] : 2 - at[k]);
                sum += weight * cube.values[c];
            }
            grid[i] = sum;
        }
        std::array<Child<Cube>, 8> children;
        std::size_t count = 0;
        for (std::size_t i = 0; i < 8; ++i) {
            Cube& eighth = children[count].node;
            eighth.side = 0.5 * cube.side;
            eighth.lower = cube.lower + eighth.side * corner(i);
            const std::size_t first = 9 * (i >> 2) + 3 * (i >> 1 & 1) + (i & 1);
            for (std::size_t c = 0; c < 8; ++c)
                eighth.values[c] = grid[first + 9 * (c >> 2) + 3 * (c >> 1 & 1) + (c & 1)];
            if (!eighth.holdsZero()) continue;
            children[count].bound = query_.bound(eighth.lower, eighth.lower + eighth.side);
            if (children[count].bound < query_.limit()) ++count;
        }
        visitAll(children, count);
    }

    const FieldData& field_;
    Query& query_;
    glm::ivec3 extent_;
};

double boxDistance(const glm::dvec3& point, const glm::dvec3& lower, const glm::dvec3& upper) {
    return glm::distance(point, glm::clamp(point, lower, upper));
}

// A separating direction. The zeros of a cube are in its box, and no farther from its plane than the error. From a
// point outside that slab of the box, all of them have at least the distance `least` along a unit direction.
struct Separation {
    glm::dvec3 direction;
    double least;
};

// Lagrangian dual of the distance to the box within the slab. The multiplier is found by tangents; the bound holds for
// any multiplier.
Separation separation(const glm::dvec3& point, const glm::dvec3& lower, const glm::dvec3& upper, const Plane& plane) {
    const double height = plane.at(point), steepness = glm::length(plane.gradient);
    const glm::dvec3 low = lower - point, high = upper - point;
    // points of the slab have normal * way <= beyond
    const glm::dvec3 normal = (height < 0 ? -1 : 1) / steepness * plane.gradient;
    const double beyond = (plane.error - std::abs(height)) / steepness;
    double multiplier = 0;
    glm::dvec3 way = glm::clamp(glm::dvec3(0), low, high);
    const bool slices = std::isfinite(beyond) && beyond < 0;
    for (int i = 0; slices && i < maxMultipliers; ++i) {
        const double excess = glm::dot(normal, way) - beyond;
        if (std::abs(excess) <= multiplierTolerance) break;
        // unclamped coordinates follow the multiplier; if there are none, up to the next one that is released
        double slope = 0, next = infinity;
        for (int k = 0; k < 3; ++k) {
            const double free = -multiplier * normal[k];
            if (free > low[k] && free < high[k]) slope += normal[k] * normal[k];
            const double leaves = -way[k] / normal[k];
            if (leaves > multiplier) next = std::min(next, leaves);
        }
        const double step = slope > 0 ? excess / slope : excess > 0 ? (1 + 1e-9) * next - multiplier : 0;
        if (!std::isfinite(step) || step == 0) break;
        multiplier = std::max(0.0, multiplier + step);
        way = glm::clamp(-multiplier * normal, low, high);
    }
    const double length = glm::length(way);
    if (!(length > 0)) return {glm::dvec3(1, 0, 0), -infinity};
    const glm::dvec3 direction = way / length;
    if (!slices) return {direction, length};
    const double weight = multiplier / length;
    const glm::dvec3 tilted = direction + weight * normal;
    const glm::dvec3 nearest = glm::min(tilted * low, tilted * high);
    return {direction, nearest.x + nearest.y + nearest.z - weight * beyond};
}

// Keys are distances from a point.
struct Nearest {
    glm::dvec3 point;
    double best;             // or the search radius, while nothing is found
    bool anyWillDo = false;  // the search ends with the first point
    std::optional<glm::dvec3> found{};

    double limit() const {
        if (!found) return std::nextafter(best, infinity);
        return anyWillDo ? 0 : best - zeroTolerance;
    }
    double bound(const glm::dvec3& lower, const glm::dvec3& upper) const { return boxDistance(point, lower, upper); }
    double bound(const glm::dvec3& lower, const glm::dvec3& upper, const Plane& plane) const {
        return std::max(bound(lower, upper), separation(point, lower, upper, plane).least);
    }
    void offer(const glm::dvec3& zero) { settle(glm::distance(point, zero), zero); }
    void settle(double key, const glm::dvec3& zero) {
        if (!(key < best) && !(key == best && !found)) return;
        best = key;
        found = zero;
    }
};

// Keys are path lengths of a sphere's centre.
struct SurfaceSample {
    Path path;
    double radius, best;
    std::optional<glm::dvec3> found{};

    double limit() const { return found ? best - zeroTolerance : std::nextafter(best, infinity); }

    double bound(const glm::dvec3& lower, const glm::dvec3& upper) const {
        return byTangents([&](const glm::dvec3& centre) -> Separation {
            const glm::dvec3 way = glm::clamp(centre, lower, upper) - centre;
            const double distance = glm::length(way);
            return {way / distance, distance};
        });
    }
    double bound(const glm::dvec3& lower, const glm::dvec3& upper, const Plane& plane) const {
        return std::max(bound(lower, upper),
                        byTangents([&](const glm::dvec3& centre) { return separation(centre, lower, upper, plane); }));
    }

    // A convex shape is reached no sooner than a plane that separates it.
    template <class Separate>
    double byTangents(Separate separate) const {
        double along = 0;
        for (int i = 0; i < maxTangents; ++i) {
            const Separation found = separate(path.at(along));
            const double left = found.least - radius;
            if (!(left > 0)) break;
            const double approach = glm::dot(found.direction, path.direction);
            if (!(approach > 0)) return infinity;
            along += left / approach;
            if (along > best) return infinity;
            if (left < tangentTolerance) break;
        }
        return along;
    }

    void offer(const glm::dvec3& zero) {
        const glm::dvec3 way = zero - path.origin;
        const double along = glm::dot(way, path.direction), beside = glm::length(way - along * path.direction);
        if (glm::length(way) <= radius) return settle(0, zero);
        const double half2 = (radius - beside) * (radius + beside);
        if (half2 >= 0 && along >= 0) settle(std::max(0.0, along - std::sqrt(half2)), zero);
    }
    void settle(double key, const glm::dvec3& zero) {
        if (!(key < best) && !(key == best && !found)) return;
        best = key;
        found = zero;
    }
};

// Keys are 0 in the box and infinite outside.
struct InBox {
    const RotatedBox& box;
    bool found = false;

    double limit() const { return found ? 0 : infinity; }
    double bound(const glm::dvec3& lower, const glm::dvec3& upper) const {
        const glm::dvec3 half = 0.5 * (upper - lower), way = 0.5 * (upper + lower) - box.centre;
        for (int k = 0; k < 3; ++k) {
            const double along = glm::dot(box.axes[k], way), reach = glm::dot(glm::abs(box.axes[k]), half);
            if (std::abs(along) > reach + box.halfSize[k]) return infinity;
            const glm::dvec3 row(box.axes[0][k], box.axes[1][k], box.axes[2][k]);
            if (std::abs(way[k]) > half[k] + glm::dot(glm::abs(row), box.halfSize)) return infinity;
        }
        return 0;
    }
    double bound(const glm::dvec3& lower, const glm::dvec3& upper, const Plane& plane) const {
        const glm::dvec3 along(glm::dot(plane.gradient, box.axes[0]), glm::dot(plane.gradient, box.axes[1]),
                               glm::dot(plane.gradient, box.axes[2]));
        const double reach = glm::dot(glm::abs(along), box.halfSize) + plane.error;
        return std::abs(plane.at(box.centre)) > reach ? infinity : bound(lower, upper);
    }
    void offer(const glm::dvec3& zero) {
        const glm::dvec3 way = zero - box.centre;
        for (int k = 0; k < 3; ++k)
            if (std::abs(glm::dot(box.axes[k], way)) > box.halfSize[k]) return;
        found = true;
    }
    void settle(double, const glm::dvec3&) { found = true; }
};

}  // namespace

std::optional<double> firstInside(const FieldData& field, const Path& path) noexcept {
    const auto clipped = clip(path, glm::dvec3(0), glm::dvec3(extentOf(field)));
    if (!clipped) return std::nullopt;
    const auto [from, to] = *clipped;
    const glm::ivec3 parts = field.parts();
    for (Walk walk(path, Clearance::partSide, glm::ivec3(0), parts, from, to); walk.inside();) {
        const std::int32_t entry = entryAt(field, Clearance::partSide * walk.cube);
        if (entry == FieldFrame::emptyInside) return walk.enter;
        const double stride = clearanceAt(field, path.at(walk.enter));
        if (stride >= minStride) {
            if (isInside(field, entry, walk.cube)) return walk.enter;
            walk = Walk(path, Clearance::partSide, glm::ivec3(0), parts, walk.enter + stride, to);
            continue;
        }
        if (entry >= 0 && !field.coarse.isAbove(glm::vec3(walk.cube) + 0.5f, 0)) {
            const auto along = firstInsidePart(field, path, walk.cube, walk.enter, walk.leave());
            if (along) return along;
        }
        walk.step();
    }
    return std::nullopt;
}

glm::dvec3 zeroNormal(const FieldData& field, const glm::dvec3& point) noexcept {
    const glm::ivec3 voxel = glm::clamp(glm::ivec3(glm::floor(point)), glm::ivec3(0), extentOf(field) - 1);
    const std::int32_t entry = entryAt(field, voxel);
    if (entry < 0) return glm::dvec3(0);
    const Values v = cellValues(field, entry, voxel & 7);
    const glm::dvec3 f = point - glm::dvec3(voxel), g = 1.0 - f;
    glm::dvec3 gradient(0);
    for (std::size_t i = 0; i < 8; ++i) {
        const glm::dvec3 at = corner(i), weight = glm::mix(g, f, at), way = 2.0 * at - 1.0;
        gradient += v[i] * way * glm::dvec3(weight.y * weight.z, weight.x * weight.z, weight.x * weight.y);
    }
    const double steepness = glm::length(gradient);
    return steepness > 0 ? gradient / steepness : glm::dvec3(0);
}

std::optional<glm::dvec3> nearestZero(const FieldData& field, const glm::dvec3& point, double reach) noexcept {
    Nearest nearest{.point = point, .best = reach};
    ZeroSearch(field, nearest).run();
    return nearest.found;
}

bool isNearZero(const FieldData& field, const glm::dvec3& point, double reach) noexcept {
    Nearest nearest{.point = point, .best = reach, .anyWillDo = true};
    ZeroSearch(field, nearest).run();
    return nearest.found.has_value();
}

std::optional<ZeroTouch> firstZeroTouch(const FieldData& field, const Path& path, double radius) noexcept {
    SurfaceSample touch{.path = path, .radius = radius, .best = path.length};
    ZeroSearch(field, touch).run();
    if (!touch.found) return std::nullopt;
    return ZeroTouch{touch.best, *touch.found};
}

bool meetsZero(const FieldData& field, const RotatedBox& box) noexcept {
    InBox inBox{box};
    ZeroSearch(field, inBox).run();
    return inBox.found;
}

}  // namespace bilayer::detail
