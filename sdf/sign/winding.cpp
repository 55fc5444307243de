#include "sdf/sign/winding.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>
#include <optional>
#include <span>

#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/mesh/topology.h"
#include "sdf/sign/octree_cells.h"

namespace bilayer::detail {
namespace {

using Symmetric2 = std::array<double, 6>;
using Symmetric3 = std::array<double, 10>;

constexpr int brickSide = 64;  // region that one task signs [voxels]
constexpr std::size_t leafTriangles = 12;
/// Smaller ranges of triangles or edges are processed by one task.
constexpr std::size_t taskItems = 4096;
/// An expansion with a larger error bound is not used: the node is opened. This also keeps the sums of errors accurate.
constexpr double uselessError = 10;
/// Error of an estimate whose sign is propagated to other voxels, as a fraction of its distance to one half.
constexpr double handOn = 0.5;
/// The same where only the side of one half matters: 1, less a margin for rounding.
constexpr double onlySide = 0.999;
/// Tolerance for the rounding of floats in sums of distances [voxels].
constexpr float slack = 1e-3f;
/// Where the winding number may change by more than this per voxel, it is evaluated in smaller regions.
constexpr double calmSlope = 0.02;
/// Reserved part of the distance to one half, for voxels near the surface: two links of at most sqrt(3) voxels each.
constexpr double reserve = 2 * 1.7320508075688772 * calmSlope;
/// Offset of the query point for a voxel away from the surface, in a closed mesh [voxels]. Without it, query points
/// often lie on cancelling walls inside a union. It is shorter than the free half voxel, and not along a simple plane.
const glm::dvec3 beside(0.113, 0.071, 0.167);
const double halfDiagonal = std::sqrt(3.0) / 2;  // of a cube with side 1

// Median split of items along the longest side of their bounds; returns the middle.
template <class Item>
std::size_t split(std::vector<Item>& items, std::size_t begin, std::size_t end, Progress* progress) {
    poll(progress);
    glm::vec3 lower = items[begin].at, upper = lower;
    for (std::size_t i = begin; i < end; ++i) {
        lower = glm::min(lower, items[i].at);
        upper = glm::max(upper, items[i].at);
    }
    const glm::vec3 size = upper - lower;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const std::size_t middle = begin + (end - begin) / 2;
    const auto less = [axis](const Item& a, const Item& b) {
        return a.at[axis] != b.at[axis] ? a.at[axis] < b.at[axis] : a.index < b.index;
    };
    std::nth_element(items.begin() + std::ptrdiff_t(begin), items.begin() + std::ptrdiff_t(middle),
                     items.begin() + std::ptrdiff_t(end), polled(less, progress));
    return middle;
}

// Returns the node count of the tree over n items. It depends only on n, so every node's position is known before the
// node is built.
std::size_t nodesOver(std::size_t n, std::size_t leaf) {
    if (n <= leaf) return 1;
    // Halves differ by at most one, so the sizes on a level are two consecutive integers.
    std::size_t nodes = 0, small = n, fewer = 1, more = 0;  // `fewer` nodes of `small` items, `more` of small + 1
    while (fewer + more > 0) {
        nodes += fewer + more;
        std::size_t nextFewer = 0, nextMore = 0;
        const std::size_t half = small / 2;
        const auto halve = [&](std::size_t size, std::size_t count) {
            if (size <= leaf) return;
            for (const std::size_t part : {size / 2, size - size / 2}) (part == half ? nextFewer : nextMore) += count;
        };
        halve(small, fewer);
        halve(small + 1, more);
        small = half;
        fewer = nextFewer;
        more = nextMore;
    }
    return nodes;
}

template <class Left, class Right>
void both(std::size_t items, const Left& left, const Right& right) {
    if (items > taskItems)
        tbb::parallel_invoke(left, right);
    else {
        left();
        right();
    }
}

double determinant(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    return glm::dot(a, glm::cross(b, c));
}

double solidAngle(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
    const double below = la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb;
    return 2 * std::atan2(determinant(a, b, c), below);
}

// Returns the symmetric part of a b^T: xx, yy, zz, xy, yz, zx.
Symmetric2 product(const glm::dvec3& a, const glm::dvec3& b) {
    return {a.x * b.x,
            a.y * b.y,
            a.z * b.z,
            0.5 * (a.x * b.y + a.y * b.x),
            0.5 * (a.y * b.z + a.z * b.y),
            0.5 * (a.z * b.x + a.x * b.z)};
}

// Returns the symmetric part of m (x) v: xxx, yyy, zzz, xxy, xxz, yyx, yyz, zzx, zzy, xyz.
Symmetric3 product(const Symmetric2& m, const glm::dvec3& v) {
    const auto& [xx, yy, zz, xy, yz, zx] = m;
    const double third = 1.0 / 3;
    return {xx * v.x,
            yy * v.y,
            zz * v.z,
            third * (xx * v.y + 2 * xy * v.x),
            third * (xx * v.z + 2 * zx * v.x),
            third * (yy * v.x + 2 * xy * v.y),
            third * (yy * v.z + 2 * yz * v.y),
            third * (zz * v.x + 2 * zx * v.z),
            third * (zz * v.y + 2 * yz * v.z),
            third * (xy * v.z + yz * v.x + zx * v.y)};
}

template <std::size_t n>
void add(std::array<double, n>& sum, const std::array<double, n>& part, double times = 1) {
    for (std::size_t i = 0; i < n; ++i) sum[i] += times * part[i];
}

// Returns a tensor applied to one vector in all places, and its trace applied to that vector.
double cubic(const Symmetric3& t, const glm::dvec3& u) {
    return t[0] * u.x * u.x * u.x + t[1] * u.y * u.y * u.y + t[2] * u.z * u.z * u.z +
           3 * (u.x * u.x * (t[3] * u.y + t[4] * u.z) + u.y * u.y * (t[5] * u.x + t[6] * u.z) +
                u.z * u.z * (t[7] * u.x + t[8] * u.y)) +
           6 * t[9] * u.x * u.y * u.z;
}
double trace(const Symmetric3& t, const glm::dvec3& u) {
    return (t[0] + t[5] + t[7]) * u.x + (t[1] + t[3] + t[8]) * u.y + (t[2] + t[4] + t[6]) * u.z;
}

// Touching counts as an intersection. The determinants of a shared edge are exact negatives of each other, so no
// segment passes between two triangles.
bool segmentMeets(const glm::dvec3& from, const glm::dvec3& to, const std::array<glm::vec3, 3>& corners) {
    const glm::dvec3 way = to - from;
    const glm::dvec3 a = glm::dvec3(corners[0]) - from, b = glm::dvec3(corners[1]) - from,
                     c = glm::dvec3(corners[2]) - from;
    const double ab = glm::dot(way, glm::cross(a, b)), bc = glm::dot(way, glm::cross(b, c)),
                 ca = glm::dot(way, glm::cross(c, a));
    if (!((ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0))) return false;
    const double start = determinant(a, b, c), end = determinant(a - way, b - way, c - way);
    return !((start > 0 && end > 0) || (start < 0 && end < 0));
}

}  // namespace

struct WindingNumber::Item {
    glm::vec3 at;
    std::uint32_t index;
};

WindingNumber::WindingNumber(const Mesh& mesh, Progress* progress) {
    validate(mesh);
    const std::size_t count = mesh.triangles.size();
    auto items = vectorOf<Item>(count, progress);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, taskItems), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            const glm::uvec3 t = mesh.triangles[i];
            items[i] = {(mesh.points[t.x] + mesh.points[t.y] + mesh.points[t.z]) / 3.f, std::uint32_t(i)};
        }
    });
    nodes_ = vectorOf<Node>(nodesOver(count, leafTriangles), progress);
    triangles_ = vectorOf<Corners>(count, progress);
    // Corners are copied once the ranges are final. Sums are computed on the way back up.
    struct Builder {
        WindingNumber& tree;
        const Mesh& mesh;
        std::vector<Item>& items;
        Progress* progress;
        Bounds operator()(std::size_t at, std::size_t begin, std::size_t end) const {
            Node& node = tree.nodes_[at];
            node.begin = std::uint32_t(begin);
            node.end = std::uint32_t(end);
            if (end - begin <= leafTriangles) {
                std::sort(items.begin() + std::ptrdiff_t(begin), items.begin() + std::ptrdiff_t(end),
                          [](const Item& a, const Item& b) { return a.index < b.index; });
                for (std::size_t i = begin; i < end; ++i) {
                    const glm::uvec3 t = mesh.triangles[items[i].index];
                    tree.triangles_[i] = {mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]};
                }
                node.right = 0;
                return tree.sumTriangles(node);
            }
            const std::size_t middle = split(items, begin, end, progress), left = at + 1;
            const std::size_t right = left + nodesOver(middle - begin, leafTriangles);
            node.right = std::uint32_t(right);
            Bounds box, other;
            both(
                end - begin, [&] { box = (*this)(left, begin, middle); }, [&] { other = (*this)(right, middle, end); });
            box.add(other.lower);
            box.add(other.upper);
            tree.sumChildren(node, tree.nodes_[left], tree.nodes_[right], box);
            return box;
        }
    };
    Builder{*this, mesh, items, progress}(0, 0, count);
}

Bounds WindingNumber::sumTriangles(Node& node) const {
    const std::span triangles(triangles_.data() + node.begin, triangles_.data() + node.end);
    glm::dvec3 weighted(0), plain(0);
    node.total = 0;
    node.area = glm::dvec3(0);
    for (const Corners& t : triangles) {
        const glm::dvec3 a(t[0]), b(t[1]), c(t[2]), n = 0.5 * glm::cross(b - a, c - a), middle = (a + b + c) / 3.0;
        node.total += glm::length(n);
        node.area += n;
        weighted += glm::length(n) * middle;
        plain += middle;
    }
    node.centre = node.total > 0 ? weighted / node.total : plain / double(triangles.size());
    node.radius = node.spread = 0;
    node.moment = {};
    node.moment2 = {};
    Bounds box;
    for (const Corners& t : triangles) {
        const glm::dvec3 a = glm::dvec3(t[0]) - node.centre, b = glm::dvec3(t[1]) - node.centre,
                         c = glm::dvec3(t[2]) - node.centre;
        const glm::dvec3 n = 0.5 * glm::cross(b - a, c - a), s = (a + b + c) / 3.0;
        node.radius = std::max({node.radius, glm::length(a), glm::length(b), glm::length(c)});
        // The integral of x x^T over a triangle: area / 12 (a a^T + b b^T + c c^T + 9 s s^T).
        Symmetric2 second{};
        for (const glm::dvec3& corner : {a, b, c}) add(second, product(corner, corner), 1.0 / 12);
        add(second, product(s, s), 9.0 / 12);
        node.spread += glm::length(n) * (second[0] + second[1] + second[2]);
        add(node.moment, product(s, n));
        add(node.moment2, product(second, n));
        for (const glm::vec3& corner : t) box.add(corner);
    }
    return box;
}

void WindingNumber::sumChildren(Node& node, const Node& left, const Node& right, const Bounds& box) const {
    node.total = left.total + right.total;
    node.centre = node.total > 0 ? (left.total * left.centre + right.total * right.centre) / node.total
                                 : 0.5 * (left.centre + right.centre);
    node.area = left.area + right.area;
    node.moment = {};
    node.moment2 = {};
    node.spread = 0;
    double radius = 0;
    for (const Node* child : {&left, &right}) {
        const glm::dvec3 s = child->centre - node.centre;
        radius = std::max(radius, glm::length(s) + child->radius);
        node.spread += child->spread + child->total * glm::dot(s, s);
        add(node.moment, child->moment);
        add(node.moment, product(s, child->area));
        add(node.moment2, child->moment2);
        add(node.moment2, product(child->moment, s), 2);
        add(node.moment2, product(product(s, s), child->area));
    }
    const glm::dvec3 corner = glm::max(node.centre - glm::dvec3(box.lower), glm::dvec3(box.upper) - node.centre);
    node.radius = std::min(radius, glm::length(corner));
}

double WindingNumber::solidAngles(const Node& node, const glm::dvec3& point) const {
    double angle = 0;
    for (std::uint32_t i = node.begin; i < node.end; ++i) {
        const Corners& t = triangles_[i];
        angle += solidAngle(glm::dvec3(t[0]) - point, glm::dvec3(t[1]) - point, glm::dvec3(t[2]) - point);
    }
    return angle / (4 * glm::pi<double>());
}

// The kernel n . (x - q) / |x - q|^3 is expanded in s = x - centre to second order. The term of order k - 1 is the
// gradient of a solid harmonic of degree k, at most k |s|^(k - 1) / R^(k + 1) (Bernstein's inequality), with R =
// |centre - q|. For |s| <= t R the truncated terms sum to at most t |s|^2 / R^4 (4 - 3 t) / (1 - t)^2.
WindingNumber::Estimate WindingNumber::expansion(const Node& node, const glm::dvec3& point) const {
    const glm::dvec3 way = node.centre - point;
    const double squared = glm::dot(way, way), distance = std::sqrt(squared);
    if (!(node.radius < distance)) return {0, std::numeric_limits<double>::infinity()};
    const double t = node.radius / distance, unit = 1 / (4 * glm::pi<double>() * squared);
    const double error = unit * node.spread / squared * t * (4 - 3 * t) / ((1 - t) * (1 - t));
    if (!(error < uselessError)) return {0, error};
    const glm::dvec3 u = way / distance;
    const Symmetric2& m = node.moment;
    const double along = m[0] * u.x * u.x + m[1] * u.y * u.y + m[2] * u.z * u.z +
                         2 * (m[3] * u.x * u.y + m[4] * u.y * u.z + m[5] * u.z * u.x);
    const double first = (m[0] + m[1] + m[2] - 3 * along) / distance;
    const double second = (7.5 * cubic(node.moment2, u) - 4.5 * trace(node.moment2, u)) / squared;
    return {unit * (glm::dot(node.area, u) + first + second), error};
}

WindingNumber::Estimate WindingNumber::estimate(const glm::dvec3& point, double share) const {
    struct Far {
        Estimate estimate;
        std::uint32_t node;
        bool operator<(const Far& other) const { return estimate.error < other.estimate.error; }
    };
    Estimate sum{0, 0};
    std::vector<Far> heap;  // clusters that currently represent their triangles, the largest error on top
    std::vector<std::uint32_t> open{0};
    for (;;) {
        while (!open.empty()) {
            const std::uint32_t at = open.back();
            open.pop_back();
            const Node& node = nodes_[at];
            const Estimate far = expansion(node, point);
            if (far.error < uselessError) {
                sum.value += far.value;
                sum.error += far.error;
                heap.push_back({far, at});
                std::push_heap(heap.begin(), heap.end());
            } else
                refine(node, at, point, sum, open);
        }
        if (heap.empty()) return {sum.value, 0};
        if (sum.error < share * std::abs(sum.value - 0.5)) return {sum.value, std::max(sum.error, 0.0)};
        std::pop_heap(heap.begin(), heap.end());
        const Far worst = heap.back();
        heap.pop_back();
        sum.value -= worst.estimate.value;
        sum.error -= worst.estimate.error;
        refine(nodes_[worst.node], worst.node, point, sum, open);
    }
}

void WindingNumber::refine(const Node& node, std::uint32_t at, const glm::dvec3& point, Estimate& sum,
                           std::vector<std::uint32_t>& open) const {
    if (node.right == 0)
        sum.value += solidAngles(node, point);
    else {
        open.push_back(node.right);
        open.push_back(at + 1);
    }
}

bool WindingNumber::meets(const glm::dvec3& from, const glm::dvec3& to) const {
    const glm::dvec3 middle = 0.5 * (from + to);
    const double half = 0.5 * glm::length(to - from) * (1 + 1e-9);
    std::vector<std::uint32_t> open{0};
    while (!open.empty()) {
        const std::uint32_t at = open.back();
        open.pop_back();
        const Node& node = nodes_[at];
        if (glm::length(node.centre - middle) > node.radius * (1 + 1e-9) + half) continue;
        if (node.right != 0) {
            open.push_back(node.right);
            open.push_back(at + 1);
            continue;
        }
        for (std::uint32_t i = node.begin; i < node.end; ++i)
            if (segmentMeets(from, to, triangles_[i])) return true;
    }
    return false;
}

WindingSlope::WindingSlope(const Mesh& mesh, Progress* progress) {
    Topology(mesh, progress).forEachEdge([&](std::span<const EdgeUse> uses) {
        int times = 0;
        for (const EdgeUse& use : uses) times += use.direction();
        const glm::vec3 from = mesh.points[uses[0].low], to = mesh.points[uses[0].high];
        if (times != 0)
            edges_.push_back({from, to, std::abs(double(times)), 0.5f * (from + to), std::uint32_t(edges_.size())});
    });
    if (edges_.empty()) return;
    nodes_.resize(nodesOver(edges_.size(), leafEdges));
    build(0, 0, edges_.size(), progress);
}

double WindingSlope::operator()(const glm::dvec3& centre, double radius) const {
    return nodes_.empty() ? 0 : bound(0, centre, radius) / (4 * glm::pi<double>());
}

void WindingSlope::build(std::size_t at, std::size_t begin, std::size_t end, Progress* progress) {
    Node& node = nodes_[at];
    node = {glm::dvec3(edges_[begin].at), 0, 0, begin, end, 0};
    for (std::size_t i = begin; i < end; ++i) {
        const Edge& edge = edges_[i];
        node.length += edge.times * glm::length(edge.to - edge.from);
        node.radius = std::max({node.radius, glm::length(edge.from - node.centre), glm::length(edge.to - node.centre)});
    }
    if (end - begin <= leafEdges) return;
    const std::size_t middle = split(edges_, begin, end, progress);
    node.right = at + 1 + nodesOver(middle - begin, leafEdges);
    both(
        end - begin, [&] { build(at + 1, begin, middle, progress); },
        [&] { build(node.right, middle, end, progress); });
}

double WindingSlope::bound(std::size_t at, const glm::dvec3& centre, double radius) const {
    const Node& node = nodes_[at];
    const double gap = glm::length(node.centre - centre) - node.radius - radius;
    if (gap > 2 * node.radius) return node.length / (gap * gap);
    double sum = 0;
    if (node.right != 0) return bound(at + 1, centre, radius) + bound(node.right, centre, radius);
    for (std::size_t i = node.begin; i < node.end; ++i) sum += ofEdge(edges_[i], centre, radius);
    return sum;
}

double WindingSlope::ofEdge(const Edge& edge, const glm::dvec3& centre, double radius) {
    const glm::dvec3 way = edge.to - edge.from;
    const double squared = glm::dot(way, way);
    const double along = squared > 0 ? std::clamp(glm::dot(centre - edge.from, way) / squared, 0.0, 1.0) : 0.0;
    const double gap = glm::length(edge.from + along * way - centre) - radius;
    if (gap <= 0) return std::numeric_limits<double>::infinity();
    // An infinite straight line gives 2 / gap.
    return edge.times * std::min(std::sqrt(squared) / (gap * gap), 2 / gap);
}

namespace {

// The input for the signs of one brick.
struct Question {
    const WindingNumber& winding;
    const WindingSlope* slope;  // null: the number changes only across the surface
    double voxelSize;
    Progress* progress;

    glm::dvec3 at(const openvdb::Coord& voxel) const { return glm::dvec3(voxel.x(), voxel.y(), voxel.z()) * voxelSize; }
    glm::dvec3 clearOfWalls(const glm::dvec3& point) const { return slope ? point : point + voxelSize * beside; }
    glm::dvec3 centre(const openvdb::Coord& origin, std::int32_t side) const {
        return (glm::dvec3(origin.x(), origin.y(), origin.z()) + 0.5 * (side - 1)) * voxelSize;
    }
    // Returns the maximum change of the winding number per voxel in a ball [1/voxel].
    double slopeIn(const glm::dvec3& ball, double radiusVoxels) const {
        return slope ? (*slope)(ball, radiusVoxels * voxelSize) * voxelSize : 0;
    }
};

struct Answer {
    bool inside;
    double margin;  // lower bound of the winding number's distance to one half
};

Answer ask(const Question& question, const glm::dvec3& point) {
    poll(question.progress);
    const WindingNumber::Estimate e = question.winding.estimate(point, question.slope ? handOn : onlySide);
    // If the number changes only across the surface, an answer is valid up to the surface.
    const double margin =
        question.slope ? std::max(std::abs(e.value - 0.5) - e.error, 0.0) : std::numeric_limits<double>::infinity();
    return {e.value > 0.5, margin};
}

// The signs of one brick: of leaves voxel by voxel, of each cell between leaves at once.
class BrickSigns {
  public:
    BrickSigns(const Question& question, std::span<const OctreeCell> cells,
               std::vector<openvdb::CoordBBox>& insideBoxes);
    void sign(const BandWidths& widths);

  private:
    struct State {
        BandLeaf* leaf;
        double slope;      // [1/voxel], for links that start in this leaf
        BlockMask open{};  // voxels between which no link can cross the surface
        BlockMask known{}, inside{};
        BlockMask firm{};  // with `reserve` left to one half
        BlockMask front{};
        bool calm() const { return slope <= calmSlope; }
    };
    struct Empty {
        OctreeCell cell;
        double slope;   // [1/voxel]
        double margin;  // at the centre; negative: unknown
        bool inside;
    };

    void signEmpty();
    void spreadEmpty(std::size_t seed);
    void settle(const openvdb::Coord& origin, std::int32_t side, const Answer& answer, double slope);
    void spreadCalm(std::size_t leaf, unsigned voxel);
    void signRough(State& state);
    void spreadIn(State& state, const BlockMask& region, double slope, unsigned voxel);
    void signNear();
    bool copyNear(State& state, unsigned voxel, BlockMask& firm);
    Answer decide(State& state, unsigned voxel);
    int slot(const openvdb::Coord& voxel) const;

    const Question& question_;
    std::vector<openvdb::CoordBBox>& insideBoxes_;
    openvdb::Coord origin_;
    std::vector<State> leaves_;
    std::vector<Empty> empties_;
    std::array<std::int16_t, blockVoxels> slots_;  // per block of the brick: a leaf's index, or -1 - an empty cell's
};

BrickSigns::BrickSigns(const Question& question, std::span<const OctreeCell> cells,
                       std::vector<openvdb::CoordBBox>& insideBoxes)
    : question_(question), insideBoxes_(insideBoxes), origin_(cells.front().origin) {
    const float open = (0.5f + slack) * float(question.voxelSize);
    for (const OctreeCell& cell : cells) {
        const glm::dvec3 centre = question.centre(cell.origin, cell.side);
        // Links extend one voxel beyond a leaf.
        const double reach = halfDiagonal * (cell.leaf ? cell.side + 1 : cell.side);
        const double slope = question.slopeIn(centre, reach);
        const int index = cell.leaf ? int(leaves_.size()) : -1 - int(empties_.size());
        if (cell.leaf)
            leaves_.push_back({.leaf = cell.leaf, .slope = slope, .open = farther(*cell.leaf, open)});
        else
            empties_.push_back({cell, slope, -1, false});
        if (cell.side > brickSide || cells.size() == 1) continue;
        const openvdb::Coord o = cell.origin - origin_;
        const int blocks = cell.side / blockSide;
        for (int x = 0; x < blocks; ++x)
            for (int y = 0; y < blocks; ++y)
                for (int z = 0; z < blocks; ++z)
                    slots_[std::size_t(((o.x() / 8 + x) * 8 + o.y() / 8 + y) * 8 + o.z() / 8 + z)] =
                        std::int16_t(index);
    }
}

// Returns the slot of the cell that contains a voxel. Valid only inside the brick.
int BrickSigns::slot(const openvdb::Coord& voxel) const {
    const openvdb::Coord o = voxel - origin_;
    return slots_[std::size_t(((o.x() / 8) * 8 + o.y() / 8) * 8 + o.z() / 8)];
}

void BrickSigns::sign(const BandWidths& widths) {
    poll(question_.progress);
    signEmpty();
    for (std::size_t i = 0; i < leaves_.size(); ++i) {
        State& state = leaves_[i];
        if (!state.calm()) {
            signRough(state);
            continue;
        }
        for (unsigned voxel = 0; voxel < blockVoxels; ++voxel)
            if (test(state.open, voxel) && !test(state.known, voxel)) spreadCalm(i, voxel);
    }
    signNear();
    for (State& state : leaves_) signLeaf(*state.leaf, state.inside, widths);
}

void BrickSigns::signEmpty() {
    for (std::size_t i = 0; i < empties_.size(); ++i)
        if (empties_[i].margin < 0) spreadEmpty(i);
    for (const Empty& e : empties_) settle(e.cell.origin, e.cell.side, {e.inside, e.margin}, e.slope);
}

// Propagates the sign from the centre of a cell to its neighbours' centres, as long as the number certainly stays on
// its side.
void BrickSigns::spreadEmpty(std::size_t seed) {
    const auto halfWay = [](const Empty& e) { return halfDiagonal * e.cell.side * e.slope; };
    const glm::dvec3 centre = question_.centre(empties_[seed].cell.origin, empties_[seed].cell.side);
    const Answer answer = ask(question_, question_.clearOfWalls(centre));
    empties_[seed].margin = answer.margin;
    empties_[seed].inside = answer.inside;
    if (empties_.size() == 1) return;
    std::deque<std::size_t> queue{seed};
    const openvdb::CoordBBox brick = openvdb::CoordBBox::createCube(origin_, brickSide);
    while (!queue.empty()) {
        const Empty from = empties_[queue.front()];
        queue.pop_front();
        const int blocks = from.cell.side / blockSide;
        for (int face = 0; face < 6; ++face)
            for (int i = 0; i < blocks * blocks; ++i) {
                openvdb::Coord at = from.cell.origin;
                at[face / 2] += face % 2 ? from.cell.side : -1;
                at[(face / 2 + 1) % 3] += i / blocks * blockSide;
                at[(face / 2 + 2) % 3] += i % blocks * blockSide;
                if (!brick.isInside(at) || slot(at) >= 0) continue;
                Empty& to = empties_[std::size_t(-1 - slot(at))];
                const double margin = from.margin - halfWay(from) - halfWay(to);
                if (to.margin >= 0 || !(margin > 0)) continue;
                to.margin = margin;
                to.inside = from.inside;
                queue.push_back(std::size_t(-1 - slot(at)));
            }
    }
}

// Gives a cell the sign of its centre, or divides it if the number may cross one half inside it.
void BrickSigns::settle(const openvdb::Coord& origin, std::int32_t side, const Answer& answer, double slope) {
    if (side == blockSide || answer.margin > halfDiagonal * side * slope) {
        if (answer.inside) insideBoxes_.push_back(openvdb::CoordBBox::createCube(origin, side));
        return;
    }
    for (int octant = 0; octant < 8; ++octant) {
        const std::int32_t half = side / 2;
        const openvdb::Coord corner =
            origin.offsetBy(octant & 1 ? half : 0, octant & 2 ? half : 0, octant & 4 ? half : 0);
        const glm::dvec3 centre = question_.centre(corner, half);
        settle(corner, half, ask(question_, centre), question_.slopeIn(centre, halfDiagonal * half));
    }
}

Answer BrickSigns::decide(State& state, unsigned voxel) {
    const glm::dvec3 point = question_.at(state.leaf->offsetToGlobalCoord(voxel));
    const Answer answer = ask(question_, test(state.open, voxel) ? question_.clearOfWalls(point) : point);
    set(state.known, voxel);
    if (answer.inside) set(state.inside, voxel);
    return answer;
}

// Propagates over the open voxels of calm leaves, one step at a time, until the number may be too close to one half.
void BrickSigns::spreadCalm(std::size_t leaf, unsigned voxel) {
    const Answer answer = decide(leaves_[leaf], voxel);
    double left = answer.margin - reserve;
    if (left <= 0) return;
    set(leaves_[leaf].firm, voxel);
    set(leaves_[leaf].front, voxel);
    std::vector<std::size_t> wave{leaf};
    const openvdb::CoordBBox brick = openvdb::CoordBBox::createCube(origin_, brickSide);
    while (!wave.empty()) {
        double steepest = 0;
        for (const std::size_t i : wave) steepest = std::max(steepest, leaves_[i].slope);
        left -= steepest;
        std::vector<std::pair<std::size_t, BlockMask>> arrivals;
        for (const std::size_t i : wave) {
            State& from = leaves_[i];
            arrivals.emplace_back(i, grown(from.front));
            for (int face = 0; face < 6; ++face) {
                openvdb::Coord at = from.leaf->origin();
                at[face / 2] += face % 2 ? blockSide : -blockSide;
                if (!brick.isInside(at) || slot(at) < 0) continue;
                const BlockMask over = across(from.front, face / 2, face % 2);
                if (any(over)) arrivals.emplace_back(std::size_t(slot(at)), over);
            }
            from.front = {};
        }
        wave.clear();
        if (left < 0) return;
        for (const auto& [i, mask] : arrivals) {
            State& to = leaves_[i];
            if (!to.calm()) continue;
            const bool waits = any(to.front);
            for (std::size_t x = 0; x < blockSide; ++x) {
                const std::uint64_t fresh = mask[x] & to.open[x] & ~to.known[x];
                to.front[x] |= fresh;
                to.known[x] |= fresh;
                to.firm[x] |= fresh;
                if (answer.inside) to.inside[x] |= fresh;
            }
            if (!waits && any(to.front)) wave.push_back(i);
        }
    }
}

// Near a hole: regions of 4x4x4 voxels, each with its own slope.
void BrickSigns::signRough(State& state) {
    constexpr int side = blockSide / 2;
    for (int octant = 0; octant < 8; ++octant) {
        const int x = octant & 4 ? side : 0, y = octant & 2 ? side : 0, z = octant & 1 ? side : 0;
        BlockMask region{};
        for (int i = 0; i < side * side * side; ++i)
            set(region, unsigned(((x + i / 16) * blockSide + y + i / 4 % 4) * blockSide + z + i % 4));
        const openvdb::Coord corner = state.leaf->origin().offsetBy(x, y, z);
        const double slope = question_.slopeIn(question_.centre(corner, side), halfDiagonal * (side - 1));
        for (unsigned voxel = 0; voxel < blockVoxels; ++voxel)
            if (test(region, voxel) && !test(state.known, voxel)) spreadIn(state, region, slope, voxel);
    }
}

void BrickSigns::spreadIn(State& state, const BlockMask& region, double slope, unsigned voxel) {
    const Answer answer = decide(state, voxel);
    if (!test(state.open, voxel)) return;
    BlockMask front{};
    set(front, voxel);
    for (double left = answer.margin - slope; left > 0 && any(front); left -= slope) {
        front = grown(front);
        for (std::size_t x = 0; x < blockSide; ++x) {
            front[x] &= region[x] & state.open[x] & ~state.known[x];
            state.known[x] |= front[x];
            if (answer.inside) state.inside[x] |= front[x];
        }
    }
}

// Voxels near the surface take the sign of a neighbour that no surface can separate from them. The few others are
// evaluated.
void BrickSigns::signNear() {
    for (int pass = 0; pass < 2; ++pass) {
        std::vector<BlockMask> firm(leaves_.size());
        for (std::size_t i = 0; i < leaves_.size(); ++i) {
            firm[i] = leaves_[i].firm;
            for (unsigned voxel = 0; leaves_[i].calm() && voxel < blockVoxels; ++voxel)
                if (!test(leaves_[i].known, voxel)) copyNear(leaves_[i], voxel, firm[i]);
        }
        for (std::size_t i = 0; i < leaves_.size(); ++i) leaves_[i].firm = firm[i];
    }
    for (State& state : leaves_)
        for (unsigned voxel = 0; voxel < blockVoxels; ++voxel)
            if (!test(state.known, voxel)) decide(state, voxel);
}

bool BrickSigns::copyNear(State& state, unsigned voxel, BlockMask& firm) {
    const openvdb::Coord here = state.leaf->offsetToGlobalCoord(voxel);
    const openvdb::CoordBBox brick = openvdb::CoordBBox::createCube(origin_, brickSide);
    const double h = question_.voxelSize, distance = double(state.leaf->buffer().data()[voxel]);
    for (int link = 0; link < 27; ++link) {
        const openvdb::Coord step(link / 9 - 1, link / 3 % 3 - 1, link % 3 - 1), there = here + step;
        if (link == 13 || !brick.isInside(there) || slot(there) < 0) continue;
        const State& other = leaves_[std::size_t(slot(there))];
        const unsigned at = BandLeaf::coordToOffset(there);
        if (!test(other.firm, at)) continue;
        const double length =
            std::sqrt(double(step.x() * step.x() + step.y() * step.y() + step.z() * step.z())) + double(slack);
        if (distance + double(other.leaf->buffer().data()[at]) <= length * h) continue;
        set(state.known, voxel);
        set(firm, voxel);
        if (test(other.inside, at)) set(state.inside, voxel);
        return true;
    }
    return false;
}

// Returns the region where an open mesh's winding number can exceed one half.
// At a distance R the number is at most area / (4 pi R^2).
openvdb::CoordBBox spaceOf(const std::vector<BandLeaf*>& leaves, const Question& question) {
    constexpr double farthest = 1e9;  // [voxels], as coordinates in a build
    openvdb::CoordBBox box;
    for (const BandLeaf* leaf : leaves) box.expand(leaf->getNodeBoundingBox());
    if (!question.slope) return box;
    const double reach = std::sqrt(question.winding.area() / (2 * glm::pi<double>())) / question.voxelSize;
    const auto margin = std::int32_t(std::min(std::ceil(reach), farthest));
    for (int axis = 0; axis < 3; ++axis) {
        box.min()[axis] = std::int32_t(std::max(double(box.min()[axis]) - margin, -farthest));
        box.max()[axis] = std::int32_t(std::min(double(box.max()[axis]) + margin, farthest));
    }
    return box;
}

}  // namespace

void signByWinding(openvdb::FloatGrid& grid, const Mesh& mesh, const BandWidths& widths, bool closed,
                   Progress* progress) {
    const WindingNumber winding(mesh, progress);
    std::optional<WindingSlope> slope;
    if (!closed) slope.emplace(mesh, progress);
    const Question question{winding, slope ? &*slope : nullptr, double(widths.voxelSize), progress};
    const std::vector<BandLeaf*> leaves = leavesOf(grid);
    tbb::enumerable_thread_specific<std::vector<openvdb::CoordBBox>> found;
    if (!leaves.empty()) {
        const OctreeCells cells(leaves, spaceOf(leaves, question), progress);
        const std::span bricks = cells.bricks();
        tbb::parallel_for(std::size_t(0), bricks.size() - 1, [&](std::size_t b) {
            BrickSigns(question, cells.all().subspan(bricks[b], bricks[b + 1] - bricks[b]), found.local()).sign(widths);
        });
    }
    std::vector<openvdb::CoordBBox> inside;
    for (const auto& boxes : found) inside.insert(inside.end(), boxes.begin(), boxes.end());
    assemble(grid, inside, widths, progress);
}

}  // namespace bilayer::detail
