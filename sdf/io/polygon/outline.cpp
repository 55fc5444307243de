// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/polygon/outline.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "sdf/base/line_side.h"

namespace bilayer::detail {
namespace {

/// Margin for rounding in tests of boxes against lines, relative to the products; generous.
constexpr double roundingOfLine = 1e-15;

// Tests which boxes a triangle may overlap.
class TriangleBoxTest {
  public:
    TriangleBoxTest(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c)
        : box_{glm::min(glm::min(a, b), c), glm::max(glm::max(a, b), c)}, corners_{a, b, c} {}

    bool operator()(const Box2& box) const {
        return box_.meets(box) && !isBeyond(box, corners_[0], corners_[1]) &&
               !isBeyond(box, corners_[1], corners_[2]) && !isBeyond(box, corners_[2], corners_[0]);
    }

  private:
    // Returns whether a box lies entirely to the right of a line.
    static bool isBeyond(const Box2& box, const glm::dvec2& a, const glm::dvec2& b) {
        const glm::dvec2 edge = b - a;
        const double left = edge.x * ((edge.x > 0 ? box.upper.y : box.lower.y) - a.y);
        const double right = edge.y * ((edge.y > 0 ? box.lower.x : box.upper.x) - a.x);
        return left - right < -roundingOfLine * (std::abs(left) + std::abs(right));
    }

    Box2 box_;
    glm::dvec2 corners_[3];
};

double crossOf(const glm::dvec2& p, const glm::dvec2& q) {
    return p.x * q.y - p.y * q.x;
}

double dotOf(const glm::dvec2& p, const glm::dvec2& q) {
    return p.x * q.x + p.y * q.y;
}

// Returns whether an outline reverses at q: it leaves for r along the line from which it came, back towards p.
bool reverses(const glm::dvec2& p, const glm::dvec2& q, const glm::dvec2& r) {
    return dotOf(p - q, r - q) > 0 && lineSide(p, q, r) == 0;
}

// Returns whether p lies between two other points of the same line.
bool isBetween(const glm::dvec2& a, const glm::dvec2& p, const glm::dvec2& b) {
    return dotOf(a - p, b - p) < 0;
}

// Compares directions from a point by their angles from a first one, counter-clockwise.
class AngleOrder {
  public:
    AngleOrder(const glm::dvec2& centre, const glm::dvec2& first) : centre_(centre), first_(first) {}

    bool isZero(const glm::dvec2& p) const { return sector(p) == 0; }
    bool isLess(const glm::dvec2& p, const glm::dvec2& q) const {
        const int ofP = sector(p), ofQ = sector(q);
        return ofP != ofQ ? ofP < ofQ : ofP % 2 == 1 && lineSide(centre_, p, q) > 0;
    }

  private:
    // 0: along the first direction; 1: to its left; 2: opposite; 3: to its right
    int sector(const glm::dvec2& p) const {
        const int side = lineSide(centre_, first_, p);
        if (side != 0) return side > 0 ? 1 : 3;
        return dotOf(first_ - centre_, p - centre_) > 0 ? 0 : 2;
    }

    glm::dvec2 centre_, first_;
};

// Returns whether an outline that only turns left does so by one revolution: there is one corner that is leftmost among
// its neighbours.
bool turnsOnce(std::span<const glm::dvec2> outline) {
    const std::size_t n = outline.size();
    const auto isLeft = [&](std::size_t i, std::size_t j) {
        const glm::dvec2 &p = outline[i % n], &q = outline[j % n];
        return p.x < q.x || (p.x == q.x && p.y < q.y);
    };
    std::size_t leftmost = 0;
    for (std::size_t i = n; i < 2 * n; ++i) leftmost += isLeft(i, i - 1) && isLeft(i, i + 1);
    return leftmost == 1;
}

// Calls f(previous, corner, next) with the index of each corner, skipping repeated points.
template <typename F>
void forEachCorner(std::span<const glm::dvec2> outline, const F& f) {
    const std::size_t n = outline.size();
    const auto next = [&](std::size_t i) { return i + 1 < n ? i + 1 : 0; };
    std::size_t before = 0;
    while (before < n && outline[before] == outline[next(before)]) ++before;
    if (before == n) return;
    for (std::size_t i = before, count = 0; count < n; ++count) {
        i = next(i);
        if (outline[i] == outline[next(i)]) continue;
        f(unsigned(before), unsigned(i), unsigned(next(i)));
        before = i;
    }
}

}  // namespace

int Outline::side(unsigned a, unsigned b, unsigned p) const {
    return lineSide(corners_[a].at, corners_[b].at, corners_[p].at);
}

void Outline::reset(std::span<const glm::dvec2> points) {
    left_ = unsigned(points.size());
    corners_.resize(left_);
    obstacles_.reset(points);
    for (unsigned i = 0; i < left_; ++i)
        corners_[i] = {points[i], i > 0 ? i - 1 : left_ - 1, i + 1 < left_ ? i + 1 : 0, true, true, false, i, false};
    for (unsigned i = 0; i < left_; ++i) classify(i);
    wasConvex_ = std::all_of(corners_.begin(), corners_.end(), [](const Corner& corner) { return corner.convex; }) &&
                 turnsOnce(points);
    if (!wasConvex_) findFullAngles(points);
}

void Outline::cut(unsigned v) {
    const unsigned a = corners_[v].before, b = corners_[v].after;
    narrowAngle(a, v, b);
    narrowAngle(b, v, a);
    corners_[a].after = b;
    corners_[b].before = a;
    remove(v);
}

void Outline::remove(unsigned v) {
    corners_[v].present = false;
    if (!corners_[v].convex) obstacles_.remove(v);
    --left_;
}

void Outline::split(unsigned v, unsigned w) {
    std::swap(corners_[v].before, corners_[w].before);
    for (const unsigned corner : {v, w}) {
        corners_[corners_[corner].before].after = corner;
        corners_[corner].full = false;
    }
}

void Outline::classify(unsigned v) {
    Corner& corner = corners_[v];
    const bool convex = side(corner.before, v, corner.after) > 0;
    if (convex == corner.convex) return;
    corner.convex = convex;
    if (convex)
        obstacles_.remove(v);
    else
        obstacles_.add(v, corner.at);
}

// Updates whether the interior angle at a corner is 360 degrees, before its edge to v becomes one to the corner behind
// v.
void Outline::narrowAngle(unsigned at, unsigned v, unsigned to) {
    Corner& corner = corners_[at];
    const glm::dvec2 &from = corner.at, &across = corners_[v].at, &end = corners_[to].at;
    if (from == across)
        corner.full &= corners_[v].full;
    else if (corners_[v].convex || dotOf(across - from, end - from) < 0)
        corner.full = false;
}

bool Outline::isPinched(unsigned v, unsigned w) {
    const Corner &corner = corners_[v], &other = corners_[w];
    if (v == w || !corner.present || !other.present || corner.after == w || other.after == v) return false;
    const AngleOrder order(corner.at, corners_[corner.after].at);
    const glm::dvec2 &end = corners_[corner.before].at, &in = corners_[other.before].at,
                     &out = corners_[other.after].at;
    if (order.isZero(out) || order.isLess(out, in)) return false;
    if (!order.isLess(in, out) && !other.full) return false;
    if (order.isZero(end)) return corner.full;
    if (order.isLess(out, end)) return true;
    return !order.isLess(end, out) && (!order.isZero(in) || leavesInside(v, w));
}

// For a corner w that runs along both edges of a corner v, the other way: follows the outline from w on and from v back
// to the place where they part. Returns whether w leaves on the inner side of v there. The corners on the way note
// their partners and the answer, so that edges both ways with many corners are followed once.
bool Outline::leavesInside(unsigned v, unsigned w) {
    path_.clear();
    glm::dvec2 at = corners_[v].at;
    int side = 0;
    while (corners_[v].partner != w && side == 0 && path_.size() < corners_.size()) {
        path_.emplace_back(v, w);
        const glm::dvec2 from = at, &p = corners_[corners_[v].before].at, &q = corners_[corners_[w].after].at;
        at = isBetween(from, q, p) ? q : p;
        if (at == p) v = corners_[v].before;
        if (at == q) w = corners_[w].after;
        side = leavingSide(v, w, at, from);
    }
    const bool isInside = side > 0 || (side == 0 && corners_[v].partner == w && corners_[v].partnerIsInside);
    for (const auto& [a, b] : path_) {
        corners_[a].partner = b;
        corners_[b].partner = a;
        corners_[a].partnerIsInside = corners_[b].partnerIsInside = isInside;
    }
    return isInside;
}

// The outline passes a place twice: towards it by v and away from it by w. On the line to `from`, both paths coincide.
// Returns 1 if the path by w then continues inside of that by v, -1 if outside, and 0 if they coincide further.
int Outline::leavingSide(unsigned v, unsigned w, const glm::dvec2& at, const glm::dvec2& from) const {
    const Corner &corner = corners_[v], &other = corners_[w];
    const glm::dvec2 &end = corners_[corner.before].at, &out = corners_[other.after].at;
    const AngleOrder order(at, from);
    if (v == w) return corner.full ? -1 : 1;
    if (order.isZero(end)) return corner.full ? 1 : -1;
    if (order.isZero(out)) return other.full ? 1 : -1;
    return int(order.isLess(out, end)) - int(order.isLess(end, out));
}

bool Outline::isEmpty(unsigned v) const {
    const Corner& corner = corners_[v];
    return !corner.full && !corner.convex && reverses(corners_[corner.before].at, corner.at, corners_[corner.after].at);
}

bool Outline::mayCut(unsigned v, EarRule rule) const {
    const Corner& corner = corners_[v];
    const glm::dvec2 &a = corners_[corner.before].at, &b = corners_[corner.after].at;
    if (rule == EarRule::any) return true;
    if (rule == EarRule::convex) return corner.convex;
    if (corner.convex) return rule != EarRule::flat && isEar(v, rule);
    return rule == EarRule::flat && lineSide(a, corner.at, b) == 0 && !corner.full;
}

bool Outline::isEar(unsigned v, EarRule rule) const {
    const Corner& corner = corners_[v];
    if (!keepsAngles(v, rule)) return false;
    return !obstacles_.any(TriangleBoxTest(corners_[corner.before].at, corner.at, corners_[corner.after].at),
                           [&](std::size_t w) { return blocks(unsigned(w), v, rule); });
}

// Returns whether the cut leaves a positive angle at both of its ends. Angles of 180 degrees and more always remain.
bool Outline::keepsAngles(unsigned v, EarRule rule) const {
    const unsigned a = corners_[v].before, b = corners_[v].after;
    if (isEmpty(a) || isEmpty(b)) return false;
    const int minSide = rule == EarRule::strict ? 1 : 0;
    return (!corners_[a].convex || side(corners_[a].before, a, b) >= minSide) &&
           (!corners_[b].convex || side(a, b, corners_[b].after) >= minSide);
}

// Returns whether the outline at a corner w enters the triangle of corner v. If w is on the triangle's border, it
// enters if it continues to the inner side of all edges that w lies on. Under the strict rule it must not continue
// along the cut either.
bool Outline::blocks(unsigned w, unsigned v, EarRule rule) const {
    const unsigned a = corners_[v].before, b = corners_[v].after;
    if (w == a || w == b || w == v) return false;
    const int first = side(a, v, w), second = side(v, b, w), cut = side(b, a, w);
    if (first < 0 || second < 0 || cut < 0) return false;
    if (rule == EarRule::strict && cut == 0 && first > 0 && second > 0) return true;
    const auto enters = [&](unsigned to) {
        return (first > 0 || side(a, v, to) > 0) && (second > 0 || side(v, b, to) > 0) &&
               (cut > 0 || side(b, a, to) >= (rule == EarRule::strict ? 0 : 1));
    };
    return enters(corners_[w].before) || enters(corners_[w].after);
}

// Finds the corners whose interior angle is 360 degrees. The total rotation of a simple outline is one revolution to
// the left. Outward spikes contribute half a revolution to the left each, inward spikes half a revolution to the right.
// The other corners therefore determine the count of each kind.
void Outline::findFullAngles(std::span<const glm::dvec2> points) {
    long spikes = 0;
    double angle = 0;
    forEachCorner(points, [&](unsigned i, unsigned j, unsigned k) {
        const glm::dvec2 &p = points[i], &q = points[j], &r = points[k];
        if (reverses(p, q, r))
            ++spikes;
        else
            angle += std::atan2(crossOf(q - p, r - q), dotOf(q - p, r - q));
    });
    if (spikes == 0) return;
    const long halfRevolutions = std::lround(angle / std::numbers::pi);
    if (halfRevolutions == 2 - spikes) return;
    forEachCorner(points, [&](unsigned i, unsigned j, unsigned k) {
        if (reverses(points[i], points[j], points[k]) && (halfRevolutions == 2 + spikes || !isOutward(j)))
            for (unsigned v = j; v != i && points[v] == points[j]; v = corners_[v].before) corners_[v].full = true;
    });
}

// Returns whether a spike lies outside of the rest of the outline. A spike on the border counts as outside.
bool Outline::isOutward(unsigned v) const {
    const glm::dvec2& point = corners_[v].at;
    int windings = 0;
    const unsigned first = corners_[v].after, last = corners_[v].before;
    for (unsigned i = first;; i = corners_[i].after) {
        const glm::dvec2 &p = corners_[i].at, &q = corners_[i == last ? first : corners_[i].after].at;
        const int side = lineSide(p, q, point);
        if (side == 0 && dotOf(p - point, q - point) <= 0) return true;
        if (p.y <= point.y && q.y > point.y && side > 0) ++windings;
        if (p.y > point.y && q.y <= point.y && side < 0) --windings;
        if (i == last) return windings <= 0;
    }
}

}  // namespace bilayer::detail
