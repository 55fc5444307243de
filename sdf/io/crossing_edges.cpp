// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/crossing_edges.h"

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
    std::size_t index;
};

bool cross(const OutlineEdge& e, const OutlineEdge& f) {
    return lineSide(e.left, e.right, f.left) * lineSide(e.left, e.right, f.right) < 0 &&
           lineSide(f.left, f.right, e.left) * lineSide(f.left, f.right, e.right) < 0;
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
        if (isBefore(b, a)) std::swap(a, b);
        edges.push_back({a, b, i});
    }
    return edges;
}

bool anyPairCrosses(const std::vector<OutlineEdge>& edges) {
    for (std::size_t i = 0; i < edges.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
            if (boxesMeet(edges[i], edges[j]) && cross(edges[i], edges[j])) return true;
    return false;
}

// The edges on the sweep line, from bottom to top. Edges that become neighbours are compared.
class SweepLine {
  public:
    explicit SweepLine(const std::vector<OutlineEdge>& edges) : edges_(edges), places_(edges.size(), status_.end()) {}

    bool findsCrossing() {
        struct Event {
            Point at;
            bool begins;
            std::size_t edge;
        };
        std::vector<Event> events;
        events.reserve(2 * edges_.size());
        for (std::size_t i = 0; i < edges_.size(); ++i) {
            events.push_back({edges_[i].left, true, i});
            events.push_back({edges_[i].right, false, i});
        }
        std::sort(events.begin(), events.end(), [](const Event& e, const Event& f) {
            if (e.at != f.at) return isBefore(e.at, f.at);
            return e.begins != f.begins ? f.begins : e.edge < f.edge;
        });
        return std::any_of(events.begin(), events.end(),
                           [&](const Event& event) { return event.begins ? begin(event.edge) : end(event.edge); });
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

    const std::vector<OutlineEdge>& edges_;
    Status status_;
    std::vector<Status::iterator> places_;
};

}  // namespace

bool hasCrossingEdges(std::span<const glm::dvec2> outline) {
    const std::vector<OutlineEdge> edges = edgesOf(outline);
    return edges.size() <= fewCorners ? anyPairCrosses(edges) : SweepLine(edges).findsCrossing();
}

}  // namespace bilayer::detail
