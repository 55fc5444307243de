// SPDX-License-Identifier: Apache-2.0
// Outlines that touch themselves, at random, with integer coordinates.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "tests/sdf/outlines.h"

namespace bilayer::test {

/// A closed walk along the borders of some triangles of a lattice. It winds around each point of them once, and not
/// around others, and never crosses itself where borders meet. Squares that meet at corners, holes that touch the
/// border, and stars with a pinched centre are among them.
///
/// Edges that are walked both ways are walls inside, ties outside, and bridges to holes.
class LatticeWalk {
  public:
    LatticeWalk(int size, int triangles, int edgesBothWays, std::mt19937& random) : size_(size), random_(random) {
        for (int i = 0; i < triangles; ++i) addTriangle({below(size_), below(size_)}, below(2) == 0);
        for (int i = 0; i < edgesBothWays; ++i) addBothWays();
        for (auto& [ends, edges] : bundles_) order(ends, edges);
        for (std::size_t edge = 0; edge < edges_.size(); ++edge) {
            halves_[edges_[edge].from].push_back({edge, true});
            halves_[edges_[edge].to].push_back({edge, false});
        }
        next_.resize(edges_.size());
        for (auto& [point, halves] : halves_) joinNeighbours(point, halves);
        joinWalks();
    }

    /// The walk that begins with the first edge; empty if there is none.
    Outline outline() const {
        Outline corners;
        if (edges_.empty()) return corners;
        const std::size_t first = std::size_t(std::min_element(edges_.begin(), edges_.end()) - edges_.begin());
        std::size_t edge = first;
        do {
            corners.push_back(edges_[edge].from);
            edge = next_[edge];
        } while (edge != first);
        return corners;
    }

    /// Whether the outline is all there is. If not, edges both ways may lie on the wrong side of others.
    bool isWhole() const { return outline().size() == edges_.size(); }

  private:
    struct Edge {
        Point from, to;
        int rank = 0;  ///< among the edges between the same two points, from right to left as seen from the lower one
        auto operator<=>(const Edge&) const = default;
    };
    /// The end of an edge at a point, which it leaves or reaches.
    struct HalfEdge {
        std::size_t edge;
        bool leaves;
    };

    int below(int count) { return int(random_() % unsigned(count)); }

    void addTriangle(const Point& a, bool upper) {
        if (!triangles_.insert({a, upper}).second) return;
        const Point b{a.x + 1, a.y}, c{a.x + 1, a.y + 1}, d{a.x, a.y + 1};
        const std::array<Point, 3> corners = upper ? std::array{a, c, d} : std::array{a, b, c};
        for (std::size_t k = 0; k < 3; ++k) {
            const Point &from = corners[k], &to = corners[(k + 1) % 3];
            std::vector<Edge>& bundle = bundles_[std::minmax(from, to)];
            if (bundle.empty())
                bundle.push_back({from, to});
            else
                bundle.clear();  // the edge between two triangles
        }
    }

    void addBothWays() {
        const Point from{below(size_), below(size_)};
        const std::array<Point, 3> steps{{{1, 0}, {0, 1}, {1, 1}}};
        const Point step = steps[std::size_t(below(3))], to{from.x + step.x, from.y + step.y};
        std::vector<Edge>& bundle = bundles_[std::minmax(from, to)];
        if (bundle.empty()) bundle = {{from, to}, {to, from}};
    }

    /// Whether the triangle to the right of the edge between two points of the lattice is one of the walk's.
    bool isInside(const Point& lower, const Point& upper) const {
        const Point step{upper.x - lower.x, upper.y - lower.y};
        if (step == Point{1, 1}) return triangles_.count({lower, false});
        if (step == Point{1, 0}) return triangles_.count({{lower.x, lower.y - 1}, true});
        return triangles_.count({lower, true});
    }

    /// Ranks the edges between two points so that their directions alternate.
    void order(const std::pair<Point, Point>& ends, std::vector<Edge>& edges) {
        const auto isUp = [&](const Edge& edge) { return edge.from == ends.first; };
        std::array<int, 2> next = isInside(ends.first, ends.second) ? std::array{0, 1} : std::array{1, 0};
        for (Edge& edge : edges) {
            edge.rank = std::exchange(next[isUp(edge) ? 1 : 0], next[isUp(edge) ? 1 : 0] + 2);
            edges_.push_back(edge);
        }
    }

    /// Sorts the edges around a point counter-clockwise, and continues each one that arrives along the one before it,
    /// with the inside between them.
    void joinNeighbours(const Point& point, std::vector<HalfEdge>& halves) {
        const auto key = [&](const HalfEdge& half) {
            const Edge& edge = edges_[half.edge];
            const Point& to = half.leaves ? edge.to : edge.from;
            const int x = int(to.x - point.x), y = int(to.y - point.y);
            static constexpr std::array<std::array<int, 3>, 3> angle{{{5, 6, 7}, {4, -1, 0}, {3, 2, 1}}};
            return std::pair(angle[std::size_t(y + 1)][std::size_t(x + 1)], point < to ? edge.rank : -edge.rank);
        };
        std::sort(halves.begin(), halves.end(), [&](const HalfEdge& a, const HalfEdge& b) { return key(a) < key(b); });
        for (std::size_t i = 0; i < halves.size(); ++i)
            if (!halves[i].leaves) next_[halves[i].edge] = halves[(i + halves.size() - 1) % halves.size()].edge;
    }

    /// Joins walks that meet at a point, where that makes no crossing.
    void joinWalks() {
        std::vector<Point> points;
        for (const auto& [point, halves] : halves_) points.push_back(point);
        std::shuffle(points.begin(), points.end(), random_);
        std::vector<std::size_t> walks = walksOfEdges();
        for (const Point& point : points) {
            std::vector<std::size_t> arriving;
            for (const HalfEdge& half : halves_[point])
                if (!half.leaves) arriving.push_back(half.edge);
            for (std::size_t tries = 0; tries < arriving.size() * arriving.size(); ++tries) {
                const std::size_t a = arriving[tries % arriving.size()], b = arriving[tries / arriving.size()];
                if (walks[a] == walks[b]) continue;
                std::swap(next_[a], next_[b]);
                if (crosses(halves_[point])) {
                    std::swap(next_[a], next_[b]);
                    continue;
                }
                std::replace(walks.begin(), walks.end(), std::size_t(walks[b]), std::size_t(walks[a]));
                tries = std::size_t(-1);
            }
        }
    }

    std::vector<std::size_t> walksOfEdges() const {
        std::vector<std::size_t> walks(edges_.size(), edges_.size());
        for (std::size_t first = 0; first < edges_.size(); ++first)
            for (std::size_t edge = first; walks[edge] == edges_.size(); edge = next_[edge]) walks[edge] = first;
        return walks;
    }

    bool crosses(const std::vector<HalfEdge>& halves) const {
        std::vector<std::pair<std::size_t, std::size_t>> joints;
        for (std::size_t i = 0; i < halves.size(); ++i)
            for (std::size_t j = 0; j < halves.size(); ++j)
                if (!halves[i].leaves && halves[j].leaves && next_[halves[i].edge] == halves[j].edge)
                    joints.push_back(std::minmax({i, j}));
        for (const auto& [a, b] : joints)
            for (const auto& [c, d] : joints)
                if (a < c && c < b && b < d) return true;
        return false;
    }

    int size_;
    std::mt19937& random_;
    std::set<std::pair<Point, bool>> triangles_;                    // lower left corner; upper or lower half
    std::map<std::pair<Point, Point>, std::vector<Edge>> bundles_;  // edges between two points, the lower one first
    std::vector<Edge> edges_;
    std::vector<std::size_t> next_;  // the edge that follows each edge
    std::map<Point, std::vector<HalfEdge>> halves_;
};

}  // namespace bilayer::test
