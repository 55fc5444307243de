// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/ear_clipper.h"

#include <algorithm>
#include <cmath>
#include <numbers>

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

// Calls f(previous, corner, next) for each corner, skipping repeated points.
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
        f(outline[before], outline[i], outline[next(i)]);
        before = i;
    }
}

}  // namespace

int EarClipper::side(unsigned a, unsigned b, unsigned p) const {
    return lineSide(corners_[a].at, corners_[b].at, corners_[p].at);
}

bool EarClipper::clip(std::span<const glm::dvec2> outline, std::vector<glm::uvec3>& triangles) {
    link(outline);
    bool fits = true;
    tryAll();
    for (auto rule = Rule::strict; left_ > 3;) {
        fits &= rule < Rule::convex;
        const bool all = tried_.size() == left_;
        if (playRound(rule, triangles))
            rule = Rule::strict;
        else if (all)
            rule = Rule(int(rule) + 1);
        if (next_.empty())
            tryAll();
        else
            tryChanged();
    }
    const auto last =
        unsigned(std::find_if(corners_.begin(), corners_.end(), [](auto& c) { return c.present; }) - corners_.begin());
    fits &= side(corners_[last].before, last, corners_[last].after) >= 0;
    cut(last, triangles);
    return fits;
}

void EarClipper::link(std::span<const glm::dvec2> outline) {
    left_ = unsigned(outline.size());
    round_ = 0;
    corners_.resize(left_);
    obstacles_.reset(outline);
    for (unsigned i = 0; i < left_; ++i)
        corners_[i] = {outline[i], i > 0 ? i - 1 : left_ - 1, i + 1 < left_ ? i + 1 : 0, 0, true, true};
    for (unsigned i = 0; i < left_; ++i) classify(i);
    wasConvex_ = std::all_of(corners_.begin(), corners_.end(), [](const Corner& corner) { return corner.convex; });
    spikes_ = wasConvex_ ? Spikes::inward : spikesOf(outline);
    next_.clear();
}

void EarClipper::tryAll() {
    tried_.clear();
    for (unsigned i = 0; i < corners_.size(); ++i)
        if (corners_[i].present) tried_.push_back(i);
}

void EarClipper::tryChanged() {
    std::swap(tried_, next_);
    next_.clear();
}

// Tries corners of which no neighbour was cut in the same round, so that long fans of triangles at one corner are rare.
// Returns whether any was cut.
bool EarClipper::playRound(Rule rule, std::vector<glm::uvec3>& triangles) {
    ++round_;
    bool any = false;
    for (const unsigned v : tried_) {
        if (left_ == 3) break;
        if (!corners_[v].present || corners_[v].round == round_ || !mayCut(v, rule)) continue;
        cut(v, triangles);
        any = true;
    }
    return any;
}

void EarClipper::cut(unsigned v, std::vector<glm::uvec3>& triangles) {
    Corner& corner = corners_[v];
    triangles.push_back({corner.before, v, corner.after});
    corner.present = false;
    if (!corner.convex) obstacles_.remove(v);
    corners_[corner.before].after = corner.after;
    corners_[corner.after].before = corner.before;
    --left_;
    update(corner.before);
    update(corner.after);
}

void EarClipper::update(unsigned v) {
    classify(v);
    if (corners_[v].round == round_) return;
    corners_[v].round = round_;
    next_.push_back(v);
}

void EarClipper::classify(unsigned v) {
    Corner& corner = corners_[v];
    const bool convex = side(corner.before, v, corner.after) > 0;
    if (convex == corner.convex) return;
    corner.convex = convex;
    if (convex)
        obstacles_.remove(v);
    else
        obstacles_.add(v, corner.at);
}

bool EarClipper::mayCut(unsigned v, Rule rule) const {
    const Corner& corner = corners_[v];
    const glm::dvec2 &a = corners_[corner.before].at, &b = corners_[corner.after].at;
    if (rule == Rule::any || corner.at == a || corner.at == b) return true;
    if (rule == Rule::convex) return corner.convex;
    if (corner.convex) return rule != Rule::flat && isEar(v, rule);
    if (rule == Rule::flat) return lineSide(a, corner.at, b) == 0;
    return reverses(a, corner.at, b) && isOutwardSpike(v);
}

bool EarClipper::isEar(unsigned v, Rule rule) const {
    const Corner& corner = corners_[v];
    if (!keepsAngles(v, rule)) return false;
    return !obstacles_.any(TriangleBoxTest(corners_[corner.before].at, corner.at, corners_[corner.after].at),
                           [&](std::size_t w) { return blocks(unsigned(w), v, rule); });
}

// Returns whether the cut leaves a positive angle at both of its ends. Angles of 180 degrees and more always remain.
bool EarClipper::keepsAngles(unsigned v, Rule rule) const {
    const unsigned a = corners_[v].before, b = corners_[v].after;
    const int minSide = rule == Rule::strict ? 1 : 0;
    return (!corners_[a].convex || side(corners_[a].before, a, b) >= minSide) &&
           (!corners_[b].convex || side(a, b, corners_[b].after) >= minSide);
}

// Returns whether the outline at a corner w enters the triangle of corner v. If w is on the triangle's border, it
// enters if it continues to the inner side of all edges that w lies on. Under the strict rule it must not continue
// along the cut either.
bool EarClipper::blocks(unsigned w, unsigned v, Rule rule) const {
    const unsigned a = corners_[v].before, b = corners_[v].after;
    if (w == a || w == b || w == v) return false;
    const int first = side(a, v, w), second = side(v, b, w), cut = side(b, a, w);
    if (first < 0 || second < 0 || cut < 0) return false;
    if (rule == Rule::strict && cut == 0 && first > 0 && second > 0) return true;
    const auto enters = [&](unsigned to) {
        return (first > 0 || side(a, v, to) > 0) && (second > 0 || side(v, b, to) > 0) &&
               (cut > 0 || side(b, a, to) >= (rule == Rule::strict ? 0 : 1));
    };
    return enters(corners_[w].before) || enters(corners_[w].after);
}

// The total rotation of a simple outline is one revolution to the left. Outward spikes contribute half a revolution to
// the left each, inward spikes half a revolution to the right. The other corners therefore determine the count of each
// kind.
EarClipper::Spikes EarClipper::spikesOf(std::span<const glm::dvec2> outline) {
    long spikes = 0;
    forEachCorner(outline, [&](auto& p, auto& q, auto& r) { spikes += reverses(p, q, r); });
    if (spikes == 0) return Spikes::inward;
    double angle = 0;
    forEachCorner(outline, [&](auto& p, auto& q, auto& r) {
        if (!reverses(p, q, r)) angle += std::atan2(crossOf(q - p, r - q), dotOf(q - p, r - q));
    });
    const long halfRevolutions = std::lround(angle / std::numbers::pi);
    return halfRevolutions == 2 + spikes   ? Spikes::inward
           : halfRevolutions == 2 - spikes ? Spikes::outward
                                           : Spikes::both;
}

// Returns whether a spike lies outside of the rest of the outline. A spike on the border counts as outside.
bool EarClipper::isOutwardSpike(unsigned v) const {
    if (spikes_ != Spikes::both) return spikes_ == Spikes::outward;
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
