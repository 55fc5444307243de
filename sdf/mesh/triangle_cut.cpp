// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/triangle_cut.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <iterator>
#include <utility>

namespace bilayer::detail {
namespace {

/// Above this count, segments are first divided by lines across the polygon. Otherwise segments in convex position
/// would be split off one by one.
constexpr std::size_t fewSegments = 8;
/// Such a line is useful if neither side has more than this share of the segments.
constexpr double usefulPart = 0.75;
/// In units of the slack: parts of segments closer to a line lie on it. Much less than 1, so that segments also cut
/// pieces that are hardly wider than the slack.
constexpr double onLine = 1.0 / 1024;

/// A line in the polygon's plane, given by a point and the normal direction within the plane.
struct CuttingLine {
    glm::dvec3 point, across;

    double height(const glm::dvec3& p) const { return glm::dot(across, p - point); }
};

glm::dvec3 crossing(const glm::dvec3& a, double atA, const glm::dvec3& b, double atB) {
    return a + atA / (atA - atB) * (b - a);
}

/// Items on the two sides of a line: 0 where heights are negative, 1 where they are positive.
template <class Item>
using Halves = std::array<Item, 2>;

Halves<Polygon> split(const Polygon& polygon, const CuttingLine& line) {
    Halves<Polygon> halves;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        const glm::dvec3 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
        const double atA = line.height(a), atB = line.height(b);
        if (atA <= 0) halves[0].push_back(a);
        if (atA >= 0) halves[1].push_back(a);
        if (atA * atB >= 0) continue;
        const glm::dvec3 between = crossing(a, atA, b, atB);
        for (Polygon& half : halves) half.push_back(between);
    }
    return halves;
}

/// The part of a segment within a polygon, and the line of the whole segment.
struct Cut {
    Segment segment;
    CuttingLine line;
};

/// Splits segments. Parts along the line are on neither side.
Halves<std::vector<Cut>> split(const std::vector<Cut>& cuts, const CuttingLine& line, double slack) {
    Halves<std::vector<Cut>> halves;
    for (const Cut& cut : cuts) {
        const Segment& s = cut.segment;
        const double from = line.height(s.from), to = line.height(s.to);
        for (const int side : {0, 1}) {
            const double a = side ? from : -from, b = side ? to : -to;
            if (std::max(a, b) <= onLine * slack) continue;
            Segment part = s;
            if (a < 0) part.from = crossing(s.from, a, s.to, b);
            if (b < 0) part.to = crossing(s.from, a, s.to, b);
            halves[std::size_t(side)].push_back({part, cut.line});
        }
    }
    return halves;
}

bool isThin(const Polygon& polygon, const CuttingLine& line, double slack) {
    return std::none_of(polygon.begin(), polygon.end(),
                        [&](const glm::dvec3& p) { return std::abs(line.height(p)) > slack; });
}

glm::dvec3 centroid(const Polygon& polygon) {
    glm::dvec3 weighted(0);
    double total = 0;
    for (std::size_t i = 2; i < polygon.size(); ++i) {
        const double area = glm::length(glm::cross(polygon[i - 1] - polygon[0], polygon[i] - polygon[0]));
        weighted += area / 3 * (polygon[0] + polygon[i - 1] + polygon[i]);
        total += area;
    }
    return total > 0 ? weighted / total : polygon[0];
}

class Cutter {
  public:
    /// Pieces that cover a polygon. A polygon without area has none.
    using Pieces = std::vector<LabelledPiece>;

    Cutter(const glm::dvec3& normal, double slack, const std::function<int(const glm::dvec3&)>& labelOf)
        : normal_(normal), slack_(slack), labelOf_(labelOf) {}

    Pieces divide(const Polygon& polygon, const std::vector<Segment>& segments) const {
        std::vector<Cut> cuts;
        for (const Segment& s : segments)
            if (Segment part = s; clip(part, polygon, normal_, slack_))
                cuts.push_back({part, {s.from, glm::normalize(glm::cross(normal_, s.to - s.from))}});
        return divide(polygon, std::move(cuts));
    }

  private:
    Pieces divide(Polygon polygon, std::vector<Cut> cuts) const {
        // a line across all of them is tried again once many of them have gone
        for (std::size_t tryAgainAt = cuts.size(); !cuts.empty();) {
            Split halves;
            if (cuts.size() > fewSegments && cuts.size() <= tryAgainAt) {
                halves = splitBy(middle(cuts), polygon, cuts);
                tryAgainAt = std::size_t(usefulPart * double(cuts.size()));
            }
            if (!isUseful(halves, cuts.size())) {
                const CuttingLine line = cuts.back().line;
                cuts.pop_back();
                halves = splitBy(line, polygon, cuts);
            }
            // a segment along the border divides nothing
            if (halves.thin) continue;
            return joined(std::move(polygon), divide(std::move(halves.polygons[0]), std::move(halves.cuts[0])),
                          divide(std::move(halves.polygons[1]), std::move(halves.cuts[1])));
        }
        return labelled(std::move(polygon));
    }

    struct Split {
        Halves<Polygon> polygons;
        Halves<std::vector<Cut>> cuts;
        bool thin = true;  // one half is not wider than the slack
    };

    Split splitBy(const CuttingLine& line, const Polygon& polygon, const std::vector<Cut>& cuts) const {
        Split halves{split(polygon, line), {}};
        if (isThin(halves.polygons[0], line, slack_) || isThin(halves.polygons[1], line, slack_)) return halves;
        halves.cuts = split(cuts, line, slack_);
        halves.thin = false;
        return halves;
    }

    static bool isUseful(const Split& halves, std::size_t segments) {
        const std::size_t more = std::max(halves.cuts[0].size(), halves.cuts[1].size());
        return !halves.thin && double(more) <= usefulPart * double(segments);
    }

    /// Returns a line across the longer side of the segments' bounding box, with half of their midpoints on each side.
    CuttingLine middle(const std::vector<Cut>& cuts) const {
        std::vector<glm::dvec3> middles;
        for (const Cut& cut : cuts) middles.push_back(0.5 * (cut.segment.from + cut.segment.to));
        glm::dvec3 lower = middles[0], upper = middles[0];
        for (const glm::dvec3& p : middles) lower = glm::min(lower, p), upper = glm::max(upper, p);
        const glm::dvec3 size = upper - lower;
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        const auto half = middles.begin() + std::ptrdiff_t(middles.size() / 2);
        std::nth_element(middles.begin(), half, middles.end(),
                         [axis](const glm::dvec3& a, const glm::dvec3& b) { return a[axis] < b[axis]; });
        glm::dvec3 unit(0);
        unit[axis] = 1;
        const glm::dvec3 inPlane = unit - glm::dot(unit, normal_) * normal_;
        const double length = glm::length(inPlane);
        return {*half, length > 0 ? inPlane / length : unit};
    }

    Pieces labelled(Polygon polygon) const {
        if (polygon.size() < 3) return {};
        const int label = labelOf_(centroid(polygon));
        return {{std::move(polygon), label}};
    }

    static Pieces joined(Polygon whole, Pieces a, Pieces b) {
        std::move(b.begin(), b.end(), std::back_inserter(a));
        const bool uniform =
            std::all_of(a.begin(), a.end(), [&](const auto& piece) { return piece.label == a[0].label; });
        if (a.empty() || !uniform) return a;
        return {{std::move(whole), a[0].label}};
    }

    const glm::dvec3 normal_;
    const double slack_;
    const std::function<int(const glm::dvec3&)>& labelOf_;
};

}  // namespace

bool clip(Segment& segment, const Polygon& polygon, const glm::dvec3& normal, double slack) {
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        const glm::dvec3 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
        const glm::dvec3 inward = glm::normalize(glm::cross(normal, b - a));
        const double from = glm::dot(inward, segment.from - a) + slack, to = glm::dot(inward, segment.to - a) + slack;
        if (from < 0 && to < 0) return false;
        const Segment whole = segment;
        if (from < 0) segment.from = crossing(whole.from, from, whole.to, to);
        if (to < 0) segment.to = crossing(whole.from, from, whole.to, to);
    }
    return true;
}

std::vector<LabelledPiece> cut(const Polygon& polygon, const glm::dvec3& normal, const std::vector<Segment>& segments,
                               double slack, const std::function<int(const glm::dvec3& inside)>& labelOf) {
    return Cutter(normal, slack, labelOf).divide(polygon, segments);
}

}  // namespace bilayer::detail
