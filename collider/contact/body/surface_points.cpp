// SPDX-License-Identifier: Apache-2.0
// Sampling of surface points. Candidates are the vertices, and a lattice on edges and faces that are larger than the
// spacing. They are thinned out in order of decreasing convexity, so that the points that touch first remain. Open
// surfaces have candidates on both sides, and on their borders, where the normals point away from the surface.
#include "collider/contact/body/surface_points.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtx/norm.hpp>
#include <numeric>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>

#include "collider/contact/body/outer_side.h"

namespace bilayer::detail {
namespace {

constexpr double latticePitch = 0.75;      // of candidates on edges and faces [spacings]
constexpr double minGap = 0.7;             // min distance of points with about the same normal [spacings]
constexpr double minLikeCosine = 0.7;      // min cosine between such normals: a cube's edge and its faces have 0.71
constexpr double minProtrusion = 0.035;    // max height of a dropped candidate over such a point [spacings]
constexpr double minCornerGap = 0.1;       // between convex vertices [spacings]: a fraction of a voxel
constexpr double corner = 0.5;             // min convexity of a vertex: a cube's has 0.58
constexpr double sharpConvexity = 0.15;    // min convexity of an edge: a cube's have 0.35
constexpr double borderConvexity = 0.45;   // of the border of an open surface: a sharp edge, and no corner
constexpr double thinnestWall = 0.02;      // what is thinner is an open surface [spacings]
constexpr std::size_t leafPoints = 8;      // max count of points in a leaf of the tree
constexpr float sphereGrowth = 1.000001f;  // growth factor of spheres, against rounding in single precision

struct Candidate {
    glm::dvec3 position;
    glm::dvec3 normal;
    double convexity;  // mean sine of the angle by which the surface recedes around the point; 0 on a plane, negative
                       // in a dent
    bool isInner;      // on the border of an open surface; findInner() decides for the other points
};

struct Edge {
    std::uint32_t low, high;  // vertices
    std::uint32_t triangle;

    bool sameAs(const Edge& other) const { return low == other.low && high == other.high; }
};

double angleBetween(const glm::dvec3& a, const glm::dvec3& b) {
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

// The candidates of a mesh, in a fixed order.
class Candidates {
  public:
    Candidates(const Mesh& mesh, double spacing, const SurfacePoints::IsOutside& isOutside)
        : mesh_(mesh), pitch_(latticePitch * spacing), thinnest_(thinnestWall * spacing), isOutside_(isOutside) {
        for (const glm::uvec3& t : mesh.triangles) {
            const glm::dvec3 normal = glm::cross(at(t.y) - at(t.x), at(t.z) - at(t.x));
            const double length = glm::length(normal);
            normals_.push_back(length > 0 ? normal / length : glm::dvec3(0));
        }
        onBorder_.resize(mesh.points.size());
        addEdges();
        addVertices();
        for (std::size_t i = 0; i < mesh.triangles.size(); ++i) addFace(mesh.triangles[i], normals_[i]);
    }

    std::vector<Candidate> result;

  private:
    glm::dvec3 at(std::uint32_t vertex) const { return glm::dvec3(mesh_.points[vertex]); }

    // Skips places where all triangles are degenerate: they have no outside.
    void add(const glm::dvec3& position, const glm::dvec3& direction, double convexity) {
        const double length = glm::length(direction);
        if (length > 0) result.push_back({position, direction / length, convexity, false});
    }

    void addOnBorder(const glm::dvec3& position, const glm::dvec3& inward) {
        const double length = glm::length(inward);
        if (length > 0) result.push_back({position, -inward / length, borderConvexity, true});
    }

    void addVertices() {
        std::vector<glm::dvec3> directions(mesh_.points.size(), glm::dvec3(0)), neighbours = directions;
        std::vector<int> counts(mesh_.points.size(), 0);
        for (std::size_t i = 0; i < mesh_.triangles.size(); ++i)
            for (int k = 0; k < 3; ++k) {
                const glm::uvec3& t = mesh_.triangles[i];
                const glm::dvec3 ab = at(t[(k + 1) % 3]) - at(t[k]), ac = at(t[(k + 2) % 3]) - at(t[k]);
                directions[t[k]] += angleBetween(ab, ac) * normals_[i];
                neighbours[t[k]] += glm::normalize(ab) + glm::normalize(ac);
                counts[t[k]] += 2;
            }
        for (std::uint32_t v = 0; v < mesh_.points.size(); ++v) {
            const double length = glm::length(directions[v]);
            if (length > 0) add(at(v), directions[v], -glm::dot(neighbours[v], directions[v]) / (length * counts[v]));
            if (onBorder_[v]) addOnBorder(at(v), neighbours[v]);
        }
    }

    void addEdges() {
        std::vector<Edge> edges;
        for (std::uint32_t i = 0; i < mesh_.triangles.size(); ++i)
            for (int k = 0; k < 3; ++k) {
                const auto [low, high] = std::minmax(mesh_.triangles[i][k], mesh_.triangles[i][(k + 1) % 3]);
                if (isOutside_ || glm::distance(at(low), at(high)) > pitch_) edges.push_back({low, high, i});
            }
        std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
            return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
        });
        for (auto edge = edges.begin(); edge != edges.end();) {
            const auto last = std::find_if(edge, edges.end(), [&](const Edge& e) { return !e.sameAs(*edge); });
            addEdge(edge, last);
            edge = last;
        }
    }

    // Adds candidates on the edge that some triangles share, without its ends.
    void addEdge(std::vector<Edge>::const_iterator first, std::vector<Edge>::const_iterator last) {
        const glm::dvec3 a = at(first->low), along = at(first->high) - a;
        glm::dvec3 direction(0);
        for (auto e = first; e != last; ++e) direction += normals_[e->triangle];
        double fall = 0;
        for (auto e = first; e != last; ++e) fall -= glm::dot(inward(*e), direction);
        const double length = glm::length(direction);
        // half of the directions around an edge point are along the edge, where the surface does not recede
        const double convexity = length > 0 ? 0.5 * fall / (length * double(last - first)) : 0;
        const bool border = isBorder(first, last);
        if (border) onBorder_[first->low] = onBorder_[first->high] = true;
        const int parts = int(std::ceil(glm::length(along) / pitch_));
        for (int i = 1; i < parts; ++i) {
            const glm::dvec3 position = a + double(i) / parts * along;
            add(position, direction, convexity);
            if (border) addOnBorder(position, inward(*first));
        }
    }

    // Whether an edge is the border of an open surface.
    bool isBorder(std::vector<Edge>::const_iterator first, std::vector<Edge>::const_iterator last) const {
        if (!isOutside_ || last - first != 1) return false;
        const glm::dvec3 middle = 0.5 * (at(first->low) + at(first->high));
        return isOutside_(middle + thinnest_ * (inward(*first) - normals_[first->triangle]));
    }

    // The conormal of an edge in its triangle.
    glm::dvec3 inward(const Edge& edge) const {
        const glm::uvec3& t = mesh_.triangles[edge.triangle];
        const std::uint32_t opposite = t.x ^ t.y ^ t.z ^ edge.low ^ edge.high;
        const glm::dvec3 along = glm::normalize(at(edge.high) - at(edge.low)), to = at(opposite) - at(edge.low);
        const glm::dvec3 across = to - glm::dot(to, along) * along;
        const double length = glm::length(across);
        return length > 0 ? across / length : glm::dvec3(0);
    }

    // Rows are parallel to the longest edge, so that the count of candidates on slivers is proportional to their area.
    void addFace(const glm::uvec3& t, const glm::dvec3& normal) {
        std::array<glm::dvec3, 3> p{at(t.x), at(t.y), at(t.z)};
        const auto length = [&](int i) { return glm::distance(p[i], p[(i + 1) % 3]); };
        const int longestEdge = length(0) >= length(1) && length(0) >= length(2) ? 0 : length(1) >= length(2) ? 1 : 2;
        std::rotate(p.begin(), p.begin() + longestEdge, p.end());
        const double base = glm::distance(p[0], p[1]);
        const double height = glm::length(glm::cross(p[1] - p[0], p[2] - p[0])) / base;
        const int rows = int(std::ceil(height / pitch_));
        for (int row = 1; row < rows; ++row) {
            const double up = double(row) / rows;
            const glm::dvec3 left = glm::mix(p[0], p[2], up), right = glm::mix(p[1], p[2], up);
            const int parts = int(std::ceil(base * (1 - up) / pitch_));
            for (int i = 1; i < parts; ++i) add(glm::mix(left, right, double(i) / parts), normal, 0);
        }
    }

    const Mesh& mesh_;
    const double pitch_, thinnest_;
    const SurfacePoints::IsOutside& isOutside_;
    std::vector<glm::dvec3> normals_;  // of triangles; 0 if degenerate
    std::vector<bool> onBorder_;       // for each vertex
};

// Points in a hashed grid, for neighbour search within the side of a cell.
class Grid {
  public:
    Grid(double cell, std::size_t maxCount) : cell_(cell), heads_(std::bit_ceil(maxCount + 1), none) {}

    void insert(const Candidate& candidate) {
        std::uint32_t& head = heads_[slot(cellOf(candidate.position))];
        entries_.push_back({candidate.position, candidate.normal, head});
        head = std::uint32_t(entries_.size() - 1);
    }

    // Whether a point within `radius` (at most the side of a cell) has about the same normal. The normal separates the
    // sides of a thin wall. Tips finer than `radius` thus keep points on all their sides.
    bool hasNeighbour(const Candidate& candidate, double radius, double protrusion) const {
        const glm::i64vec3 cell = cellOf(candidate.position);
        for (int i = 0; i < 27; ++i) {
            const glm::i64vec3 neighbour = cell + glm::i64vec3(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1);
            for (std::uint32_t e = heads_[slot(neighbour)]; e != none; e = entries_[e].next)
                if (glm::distance2(entries_[e].position, candidate.position) < radius * radius &&
                    glm::dot(entries_[e].normal, candidate.normal) > minLikeCosine &&
                    glm::dot(candidate.position - entries_[e].position, candidate.normal) < protrusion)
                    return true;
        }
        return false;
    }

  private:
    static constexpr std::uint32_t none = ~0u;
    struct Entry {
        glm::dvec3 position, normal;
        std::uint32_t next;
    };

    glm::i64vec3 cellOf(const glm::dvec3& position) const { return glm::i64vec3(glm::floor(position / cell_)); }
    // M. Teschner et al., "Optimized Spatial Hashing for Collision Detection of Deformable Objects", 2003
    std::size_t slot(const glm::i64vec3& c) const {
        const auto hash =
            std::uint64_t(c.x) * 73856093u ^ std::uint64_t(c.y) * 19349663u ^ std::uint64_t(c.z) * 83492791u;
        return hash & (heads_.size() - 1);
    }

    double cell_;
    std::vector<std::uint32_t> heads_;
    std::vector<Entry> entries_;
};

// Takes candidates in order of decreasing convexity, except those close to a taken one.
std::vector<Candidate> thin(std::vector<Candidate> candidates, double spacing, Grid& grid) {
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.convexity > b.convexity; });
    std::vector<Candidate> taken;
    for (const Candidate& candidate : candidates) {
        const double gap = candidate.convexity >= corner ? minCornerGap : minGap;
        if (grid.hasNeighbour(candidate, gap * spacing, minProtrusion * spacing)) continue;
        grid.insert(candidate);
        taken.push_back(candidate);
    }
    return taken;
}

// The candidates as seen from behind, but for those on borders, where normals are along the surface.
std::vector<Candidate> backsOf(const std::vector<Candidate>& candidates) {
    std::vector<Candidate> backs;
    for (const auto& [position, normal, convexity, onBorder] : candidates)
        if (!onBorder) backs.push_back({position, -normal, -convexity, false});
    return backs;
}

// Removes the candidates for which a test fails.
template <class Test>
void keepIf(std::vector<Candidate>& candidates, Test&& test) {
    std::vector<char> passes(candidates.size());
    tbb::parallel_for(std::size_t(0), candidates.size(), [&](std::size_t i) { passes[i] = test(candidates[i]); });
    std::size_t kept = 0;
    for (std::size_t i = 0; i < candidates.size(); ++i)
        if (passes[i]) candidates[kept++] = candidates[i];
    candidates.resize(kept);
}

// Decides which points of open surfaces are inner ones: fronts that see less than their other side, and backs that do
// not see more than it.
// @param isOpen  whether the outside is behind a front, too
template <class IsOpen>
void findInner(std::vector<Candidate>& fronts, std::vector<Candidate>& backs, const OuterSide& sides, IsOpen&& isOpen) {
    tbb::parallel_for(std::size_t(0), fronts.size(), [&](std::size_t i) {
        Candidate& front = fronts[i];
        if (!front.isInner && isOpen(front)) front.isInner = sides.isInner(front.position, front.normal);
    });
    tbb::parallel_for(std::size_t(0), backs.size(),
                      [&](std::size_t i) { backs[i].isInner = !sides.isInner(backs[i].position, -backs[i].normal); });
}

std::vector<Candidate> pointsOf(const Mesh& mesh, double spacing, const SurfacePoints::IsOutside& isOutside) {
    const std::vector<Candidate> all = Candidates(mesh, spacing, isOutside).result;
    Grid grid(minGap * spacing, 2 * all.size());
    std::vector<Candidate> points = thin(all, spacing, grid);
    if (!isOutside) return points;
    const auto outsideAt = [&](const Candidate& point, double height) {  // [spacings]
        return isOutside(point.position + height * spacing * point.normal);
    };
    std::vector<Candidate> backs = thin(backsOf(all), spacing, grid);
    keepIf(backs, [&](const Candidate& back) { return outsideAt(back, thinnestWall); });
    findInner(points, backs, OuterSide(mesh, spacing),
              [&](const Candidate& front) { return outsideAt(front, -thinnestWall); });
    points.insert(points.end(), backs.begin(), backs.end());
    return points;
}

Bounds boxOf(std::span<const SurfacePoint> points) {
    Bounds box;
    for (const SurfacePoint& point : points) box.add(point.position);
    return box;
}

// Moves the points of lower position along the longest side of their box before the middle.
void sortHalves(std::span<SurfacePoint> points, std::size_t middle) {
    const glm::vec3 size = boxOf(points).size();
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    std::nth_element(
        points.begin(), points.begin() + std::ptrdiff_t(middle), points.end(),
        [axis](const SurfacePoint& a, const SurfacePoint& b) { return a.position[axis] < b.position[axis]; });
}

PointSphere sphereAround(std::span<const SurfacePoint> points) {
    PointSphere sphere{boxOf(points).centre(), 0};
    for (const SurfacePoint& point : points)
        sphere.radius = std::max(sphere.radius, glm::distance(sphere.centre, point.position));
    sphere.radius *= sphereGrowth;
    return sphere;
}

}  // namespace

SurfacePoints::SurfacePoints(const Mesh& mesh, float spacing, const IsOutside& isOutside) {
    if (!(spacing > 0 && std::isfinite(spacing)))
        throw std::invalid_argument("the spacing is " + std::to_string(spacing) + ", and must be positive and finite");
    validate(mesh);
    const Mesh welded = weld(mesh);
    for (const Candidate& point : pointsOf(welded, spacing, isOutside))
        points_.push_back(
            {glm::vec3(point.position), glm::vec3(point.normal), point.convexity >= sharpConvexity, point.isInner});
    if (points_.empty()) throw std::invalid_argument("all triangles of the mesh are degenerate");
    buildTree([&](std::size_t begin, std::size_t middle, std::size_t end) {
        sortHalves(std::span(points_).subspan(begin, end - begin), middle - begin);
    });
}

SurfacePoints::SurfacePoints(std::vector<SurfacePoint> ordered) : points_(std::move(ordered)) {
    buildTree([](std::size_t, std::size_t, std::size_t) {});
}

template <class Split>
void SurfacePoints::buildTree(const Split& split) {
    tree_.build(points_.size(), leafPoints, split, [&](std::uint32_t node) {
        return sphereAround(std::span(points_).subspan(tree_[node].begin, tree_[node].end - tree_[node].begin));
    });
}

}  // namespace bilayer::detail
