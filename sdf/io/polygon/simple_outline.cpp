// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/polygon/simple_outline.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <set>
#include <vector>

#include "sdf/base/line_side.h"

namespace bilayer::detail {
namespace {

using Point = glm::dvec2;

/// Up to this count of corners, comparing all pairs of edges is faster than the sweep.
constexpr std::size_t fewCorners = 24;

bool isBefore(const Point& a, const Point& b) {
    return a.x < b.x || (a.x == b.x && a.y < b.y);
}

struct OutlineEdge {
    Point left, right;  ///< in sweep order
    std::size_t index;  ///< among the edges
    int winding;        ///< how much more often the outline winds around points above it than around those below
};

enum class Meeting { none, touching, crossing };

Meeting meetingOf(const OutlineEdge& e, const OutlineEdge& f) {
    const int ofEnds = lineSide(e.left, e.right, f.left) * lineSide(e.left, e.right, f.right);
    if (ofEnds > 0) return Meeting::none;
    const int ofOtherEnds = lineSide(f.left, f.right, e.left) * lineSide(f.left, f.right, e.right);
    if (ofOtherEnds > 0) return Meeting::none;
    return ofEnds < 0 && ofOtherEnds < 0 ? Meeting::crossing : Meeting::touching;
}

bool cross(const OutlineEdge& e, const OutlineEdge& f) {
    return meetingOf(e, f) == Meeting::crossing;
}

bool boxesMeet(const OutlineEdge& e, const OutlineEdge& f) {
    return e.left.x <= f.right.x && f.left.x <= e.right.x &&
           std::min(e.left.y, e.right.y) <= std::max(f.left.y, f.right.y) &&
           std::min(f.left.y, f.right.y) <= std::max(e.left.y, e.right.y);
}

// Returns the side of an edge on which a later edge lies, at a position that the sweep line has reached for both.
int sideOf(const OutlineEdge& edge, const OutlineEdge& later) {
    const int side = lineSide(edge.left, edge.right, later.left);
    return side != 0 ? side : lineSide(edge.left, edge.right, later.right);
}

struct IsBelow {
    using is_transparent = void;

    bool operator()(const OutlineEdge* e, const Point& point) const { return lineSide(e->left, e->right, point) > 0; }
    bool operator()(const OutlineEdge* e, const OutlineEdge* f) const {
        const int above = isBefore(e->left, f->left) ? sideOf(*e, *f) : -sideOf(*f, *e);
        return above != 0 ? above > 0 : e->index < f->index;
    }
};

std::vector<OutlineEdge> edgesOf(std::span<const Point> outline) {
    std::vector<OutlineEdge> edges;
    edges.reserve(outline.size());
    for (std::size_t i = 0; i < outline.size(); ++i) {
        Point a = outline[i], b = outline[i + 1 < outline.size() ? i + 1 : 0];
        if (a == b) continue;
        const bool runsLeft = isBefore(b, a);
        if (runsLeft) std::swap(a, b);
        edges.push_back({a, b, edges.size(), runsLeft ? -1 : 1});
    }
    return edges;
}

/// Compares all pairs of edges. Edges that follow each other touch; more pairs that touch than that are reported.
Meeting meetingOfAll(const std::vector<OutlineEdge>& edges) {
    std::size_t meetings = 0;
    for (std::size_t i = 0; i < edges.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) {
            if (!boxesMeet(edges[i], edges[j])) continue;
            const Meeting meeting = meetingOf(edges[i], edges[j]);
            if (meeting == Meeting::crossing) return meeting;
            meetings += meeting == Meeting::touching;
        }
    return meetings > edges.size() ? Meeting::touching : Meeting::none;
}

struct SweepEvent {
    Point at;
    bool begins;
    std::size_t edge;
};

std::vector<SweepEvent> eventsOf(const std::vector<OutlineEdge>& edges) {
    std::vector<SweepEvent> events;
    events.reserve(2 * edges.size());
    for (std::size_t i = 0; i < edges.size(); ++i) {
        events.push_back({edges[i].left, true, i});
        events.push_back({edges[i].right, false, i});
    }
    std::sort(events.begin(), events.end(), [](const SweepEvent& e, const SweepEvent& f) {
        if (e.at != f.at) return isBefore(e.at, f.at);
        return e.begins != f.begins ? f.begins : e.edge < f.edge;
    });
    return events;
}

// The edges on the sweep line, from bottom to top. Edges that become neighbours are compared. Each edge has the count
// of windings of the outline around the points above it, up to the next edge.
class SweepLine {
  public:
    explicit SweepLine(const std::vector<OutlineEdge>& edges)
        : edges_(edges), places_(edges.size(), status_.end()), windings_(edges.size()) {}

    bool findsCrossing() {
        const std::vector<SweepEvent> events = eventsOf(edges_);
        for (std::size_t i = 0; i < events.size();) {
            const Point at = events[i].at;
            for (; i < events.size() && events[i].at == at; ++i)
                if (events[i].begins ? begin(events[i].edge) : end(events[i].edge)) return true;
            if (!windsOnceAround(at)) return true;
        }
        return false;
    }

  private:
    using Status = std::multiset<const OutlineEdge*, IsBelow>;

    bool begin(std::size_t edge) {
        const auto place = status_.insert(&edges_[edge]);
        places_[edge] = place;
        const auto above = std::next(place);
        return (place != status_.begin() && cross(**std::prev(place), **place)) ||
               (above != status_.end() && cross(**place, **above));
    }

    bool end(std::size_t edge) {
        const auto above = status_.erase(places_[edge]);
        return above != status_.begin() && above != status_.end() && cross(**std::prev(above), **above);
    }

    // Counts the windings between the edges that begin at a point or pass through it.
    bool windsOnceAround(const Point& at) {
        auto edge = status_.lower_bound(at);
        int windings = edge == status_.begin() ? 0 : windings_[(*std::prev(edge))->index];
        while (edge != status_.end() && lineSide((*edge)->left, (*edge)->right, at) == 0) {
            const OutlineEdge& below = **edge;
            windings_[below.index] = windings += below.winding;
            ++edge;
            const bool isWide = edge == status_.end() || lineSide(below.left, below.right, (*edge)->left) != 0 ||
                                lineSide(below.left, below.right, (*edge)->right) != 0;
            if (isWide && windings != 0 && windings != 1) return false;
        }
        return true;
    }

    const std::vector<OutlineEdge>& edges_;
    Status status_;
    std::vector<Status::iterator> places_;
    std::vector<int> windings_;
};

}  // namespace

bool enclosesOnce(std::span<const glm::dvec2> outline) {
    const std::vector<OutlineEdge> edges = edgesOf(outline);
    const Meeting meeting = edges.size() <= fewCorners ? meetingOfAll(edges) : Meeting::touching;
    return meeting == Meeting::none || (meeting == Meeting::touching && !SweepLine(edges).findsCrossing());
}

}  // namespace bilayer::detail
