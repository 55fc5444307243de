#include "sdf/triangle_tree.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/vector_relational.hpp>
#include <limits>

#include "sdf/progress.h"

namespace bilayer {
namespace {

constexpr int mortonBits = 21;  // a coordinate: three fill a word
/// A box test's rounding in double precision, relative to the largest coordinate; generous.
constexpr double roundingOfBoxes = 1e-12;
/// Lines that vote on whether a part lies within another: odd, and more than one against lines along edges.
constexpr std::size_t votes = 3;
constexpr std::size_t boxesPerPoll = 4096;

// Two zero bits before each of the lowest 21 (S. E. Anderson, "Bit Twiddling Hacks").
std::uint64_t spread(std::uint64_t x) {
    x = (x | x << 32) & 0x1f00000000ffffu;
    x = (x | x << 16) & 0x1f0000ff0000ffu;
    x = (x | x << 8) & 0x100f00f00f00f00fu;
    x = (x | x << 4) & 0x10c30c30c30c30c3u;
    return (x | x << 2) & 0x1249249249249249u;
}

std::uint64_t mortonCode(const glm::dvec3& unit) {
    const glm::dvec3 cell = glm::clamp(unit * double(1 << mortonBits), 0.0, double((1 << mortonBits) - 1));
    return spread(std::uint64_t(cell.x)) | spread(std::uint64_t(cell.y)) << 1 | spread(std::uint64_t(cell.z)) << 2;
}

Bounds around(std::span<const Bounds> boxes) {
    Bounds all = boxes[0];
    for (const Bounds& box : boxes) {
        all.lower = glm::min(all.lower, box.lower);
        all.upper = glm::max(all.upper, box.upper);
    }
    return all;
}

bool holds(const Bounds& outer, const Bounds& inner) {
    return glm::all(glm::lessThanEqual(outer.lower, inner.lower)) &&
           glm::all(glm::greaterThanEqual(outer.upper, inner.upper));
}

glm::dvec3 centroid(const Mesh& mesh, unsigned triangle) {
    const glm::uvec3& t = mesh.triangles[triangle];
    return (glm::dvec3(mesh.points[t.x]) + glm::dvec3(mesh.points[t.y]) + glm::dvec3(mesh.points[t.z])) / 3.0;
}

// A line, and the plane across it that triangles are projected on.
struct Line {
    glm::dvec3 origin, direction, inverse, u, v;

    Line(const glm::dvec3& from, const glm::dvec3& along) : origin(from), direction(along), inverse(1.0 / along) {
        const glm::dvec3 helper = std::abs(along.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
        u = glm::normalize(glm::cross(along, helper));
        v = glm::cross(along, u);
    }

    bool meets(const Bounds& box, double slack) const {
        double first = -std::numeric_limits<double>::infinity(), last = -first;
        for (int axis = 0; axis < 3; ++axis) {
            const double a = (double(box.lower[axis]) - slack - origin[axis]) * inverse[axis];
            const double b = (double(box.upper[axis]) + slack - origin[axis]) * inverse[axis];
            first = std::max(first, std::min(a, b));
            last = std::min(last, std::max(a, b));
        }
        return first <= last;
    }

    // Twice the signed area of the projected edge and the origin; exactly its own negative when the edge is reversed.
    double beside(const glm::dvec3& a, const glm::dvec3& b) const {
        return glm::dot(a, u) * glm::dot(b, v) - glm::dot(a, v) * glm::dot(b, u);
    }

    // 0 where it misses; else the sign, and where.
    int cross(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, double& along) const {
        const double bc = beside(b, c), ca = beside(c, a), ab = beside(a, b);
        const bool front = bc > 0 && ca > 0 && ab > 0, back = bc < 0 && ca < 0 && ab < 0;
        if (!front && !back) return 0;
        const double sum = bc + ca + ab;
        along = (bc * glm::dot(a, direction) + ca * glm::dot(b, direction) + ab * glm::dot(c, direction)) / sum;
        return front ? 1 : -1;
    }
};

// The parts that a ray from the point crosses an odd number of times, in order.
std::vector<unsigned> oddParts(const TriangleTree& tree, const glm::dvec3& point, const glm::dvec3& direction,
                               std::span<const unsigned> partOf) {
    std::vector<Crossing> found;
    tree.crossings(point, direction, found);
    std::vector<unsigned> parts, odd;
    for (const Crossing& crossing : found)
        if (crossing.along > 0 && partOf[crossing.triangle] != noPart) parts.push_back(partOf[crossing.triangle]);
    std::sort(parts.begin(), parts.end());
    for (std::size_t i = 0, j; i < parts.size(); i = j) {
        for (j = i; j < parts.size() && parts[j] == parts[i];) ++j;
        if ((j - i) % 2) odd.push_back(parts[i]);
    }
    return odd;
}

std::vector<unsigned> common(const std::vector<unsigned>& a, const std::vector<unsigned>& b) {
    std::vector<unsigned> both;
    std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
    return both;
}

}  // namespace

TriangleTree::TriangleTree(const Mesh& mesh, Progress* progress)
    : mesh_(mesh), boxes_(vectorOf<Bounds>(mesh.triangles.size(), progress)) {
    const Bounds all = bounds(mesh);
    slack_ = roundingOfBoxes * double(std::max(glm::length(all.lower), glm::length(all.upper)));
    auto codes = vectorOf<std::pair<std::uint64_t, unsigned>>(boxes_.size(), progress);
    const double scale = 1 / std::max(double(all.longestSide()), std::numeric_limits<double>::min());
    tbb::parallel_for(std::size_t(0), boxes_.size(), [&](std::size_t i) {
        if (i % boxesPerPoll == 0) poll(progress);
        for (int k = 0; k < 3; ++k) boxes_[i].add(mesh.points[mesh.triangles[i][k]]);
        codes[i] = {mortonCode((glm::dvec3(boxes_[i].centre()) - glm::dvec3(all.lower)) * scale), unsigned(i)};
    });
    tbb::parallel_sort(codes.begin(), codes.end(), polled(std::less<>(), progress));
    order_.reserve(codes.size());
    std::vector<Bounds> sorted;
    sorted.reserve(codes.size());
    for (const std::size_t i : Polled(codes.size(), progress)) {
        order_.push_back(codes[i].second);
        sorted.push_back(boxes_[codes[i].second]);
    }
    std::span<const Bounds> below = sorted;
    while (!below.empty() && (levels_.empty() || below.size() > 1)) {
        std::vector<Bounds> level;
        level.reserve((below.size() + fanOut - 1) / fanOut);
        for (const std::size_t node : Polled((below.size() + fanOut - 1) / fanOut, progress)) {
            const std::size_t first = fanOut * node;
            level.push_back(around(below.subspan(first, std::min(fanOut, below.size() - first))));
        }
        levels_.push_back(std::move(level));
        below = levels_.back();
    }
}

void TriangleTree::crossings(const glm::dvec3& origin, const glm::dvec3& direction,
                             std::vector<Crossing>& found) const {
    const Line line(origin, direction);
    found.clear();
    descend([&](const Bounds& box) { return line.meets(box, slack_); },
            [&](unsigned i) {
                const glm::uvec3& t = mesh_.triangles[i];
                Crossing crossing{i, 0, 0};
                crossing.sign =
                    line.cross(glm::dvec3(mesh_.points[t.x]) - origin, glm::dvec3(mesh_.points[t.y]) - origin,
                               glm::dvec3(mesh_.points[t.z]) - origin, crossing.along);
                if (crossing.sign) found.push_back(crossing);
            });
}

std::vector<glm::dvec3> spreadDirections(std::size_t count) {
    std::vector<glm::dvec3> directions;
    const double golden = glm::pi<double>() * (3 - std::sqrt(5.0));
    for (std::size_t i = 0; i < count; ++i) {
        const double z = (double(i) + 0.5) / double(count), radius = std::sqrt(1 - z * z);
        const double angle = golden * (double(i) + 0.5);
        directions.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
    }
    return directions;
}

std::vector<std::vector<unsigned>> enclosingParts(const Mesh& mesh, const TriangleTree& tree,
                                                  std::span<const unsigned> partOf, std::size_t parts,
                                                  Progress* progress) {
    std::vector<std::vector<unsigned>> members(parts), enclosing(parts);
    std::vector<Bounds> boxes(parts);
    for (const unsigned i : Polled(partOf.size(), progress)) {
        if (partOf[i] == noPart) continue;
        members[partOf[i]].push_back(i);
        for (int k = 0; k < 3; ++k) boxes[partOf[i]].add(mesh.points[mesh.triangles[i][k]]);
    }
    if (parts < 2) return enclosing;
    const std::vector<glm::dvec3> directions = spreadDirections(votes);
    tbb::parallel_for(std::size_t(0), parts, [&](std::size_t part) {
        if (members[part].empty()) return;
        poll(progress);
        for (std::size_t vote = 0; vote < votes; ++vote) {
            const unsigned triangle = members[part][vote * members[part].size() / votes];
            const auto odd = oddParts(tree, centroid(mesh, triangle), directions[vote], partOf);
            enclosing[part] = vote ? common(enclosing[part], odd) : odd;
        }
        std::erase_if(enclosing[part],
                      [&](unsigned outer) { return outer == part || !holds(boxes[outer], boxes[part]); });
    });
    return enclosing;
}

}  // namespace bilayer
