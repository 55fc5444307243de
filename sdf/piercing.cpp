#include "sdf/piercing.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>

#include <cmath>
#include <functional>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace bilayer {
namespace {

/// Rounding of a volume computed in double precision, relative to the sum of the sizes of its products: a generous
/// bound (J. R. Shewchuk, "Adaptive Precision Floating-Point Arithmetic", 1997, has 7.8e-16 for exact differences).
constexpr double roundingOfVolume = 2e-15;

/// Room around a plane against rounding in double precision, relative to the largest coordinate; generous.
constexpr double roundingOfPlane = 1e-12;

// Which boxes a triangle may reach: those that meet its own box and its plane. The plane rules out most of what lies in
// the box of a long slanted triangle.
struct Reach {
    Bounds box;
    glm::dvec3 point, normal;
    double slack;

    Reach(const Mesh& mesh, const glm::uvec3& t, const Bounds& own) : box(own), point(mesh.points[t.x]) {
        normal = glm::cross(glm::dvec3(mesh.points[t.y]) - point, glm::dvec3(mesh.points[t.z]) - point);
        const double length = glm::length(normal);
        // without a normal, the plane is everywhere
        normal = length > 0 ? normal / length : glm::dvec3(0);
        slack = roundingOfPlane * (glm::length(glm::dvec3(box.lower)) + glm::length(glm::dvec3(box.upper)));
    }

    bool operator()(const Bounds& other) const {
        if (!(box.lower.x <= other.upper.x && other.lower.x <= box.upper.x && box.lower.y <= other.upper.y &&
              other.lower.y <= box.upper.y && box.lower.z <= other.upper.z && other.lower.z <= box.upper.z))
            return false;
        const glm::dvec3 lower = glm::dvec3(other.lower) - point, upper = glm::dvec3(other.upper) - point;
        const double distance = 0.5 * std::abs(glm::dot(normal, lower + upper));
        return distance <= 0.5 * glm::dot(glm::abs(normal), upper - lower) + slack;
    }
};

class Pairs {
  public:
    explicit Pairs(const Mesh& mesh) : mesh_(mesh) {}

    bool pierce(unsigned first, unsigned second) const {
        const glm::uvec3 &a = mesh_.triangles[first], &b = mesh_.triangles[second];
        if (shared(a, b) > 1) return false;
        const glm::ivec3 aside = sides(b, a);
        if (sameSide(aside)) return false;
        const glm::ivec3 bside = sides(a, b);
        return !sameSide(bside) && (anyEdgeThrough(a, aside, b) || anyEdgeThrough(b, bside, a));
    }

  private:
    static int shared(const glm::uvec3& a, const glm::uvec3& b) {
        int count = 0;
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k) count += a[i] == b[k];
        return count;
    }

    static bool sameSide(const glm::ivec3& s) {
        return (s.x >= 0 && s.y >= 0 && s.z >= 0) || (s.x <= 0 && s.y <= 0 && s.z <= 0);
    }

    // On which side of the plane of a triangle another's vertices lie.
    glm::ivec3 sides(const glm::uvec3& plane, const glm::uvec3& t) const {
        return {side(plane.x, plane.y, plane.z, t.x), side(plane.x, plane.y, plane.z, t.y),
                side(plane.x, plane.y, plane.z, t.z)};
    }

    bool anyEdgeThrough(const glm::uvec3& edges, const glm::ivec3& side, const glm::uvec3& t) const {
        for (int k = 0; k < 3; ++k)
            if (side[k] * side[(k + 1) % 3] < 0 && within(edges[k], edges[(k + 1) % 3], t)) return true;
        return false;
    }

    // Whether the line through p and q passes strictly between the edges of a triangle.
    bool within(unsigned p, unsigned q, const glm::uvec3& t) const {
        const int x = side(p, q, t.x, t.y);
        return x != 0 && side(p, q, t.y, t.z) == x && side(p, q, t.z, t.x) == x;
    }

    // The sign of the volume of four vertices; 0 where one comes twice.
    int side(unsigned a, unsigned b, unsigned c, unsigned d) const {
        if (a == c || b == c || d == a || d == b || d == c) return 0;
        const glm::dvec3 origin = mesh_.points[a], u = glm::dvec3(mesh_.points[b]) - origin,
                         v = glm::dvec3(mesh_.points[c]) - origin, w = glm::dvec3(mesh_.points[d]) - origin;
        const double volume = glm::dot(glm::cross(u, v), w);
        const glm::dvec3 products(std::abs(u.y * v.z) + std::abs(u.z * v.y), std::abs(u.z * v.x) + std::abs(u.x * v.z),
                                  std::abs(u.x * v.y) + std::abs(u.y * v.x));
        if (std::abs(volume) > roundingOfVolume * glm::dot(products, glm::abs(w))) return volume > 0 ? 1 : -1;
        using Precise = glm::vec<3, long double>;
        const long double precise = glm::dot(glm::cross(Precise(u), Precise(v)), Precise(w));
        return precise > 0 ? 1 : precise < 0 ? -1 : 0;
    }

    const Mesh& mesh_;
};

}  // namespace

std::size_t countPiercingPairs(const Mesh& welded, const TriangleTree& tree) {
    const Pairs pairs(welded);
    return tbb::parallel_reduce(
        tbb::blocked_range<unsigned>(0, unsigned(welded.triangles.size()), 256), std::size_t(0),
        [&](const auto& range, std::size_t count) {
            for (unsigned i = range.begin(); i < range.end(); ++i)
                tree.descend(Reach(welded, welded.triangles[i], tree.boxOf(i)),
                             [&](unsigned other) { count += other > i && pairs.pierce(i, other); });
            return count;
        },
        std::plus<>());
}

}  // namespace bilayer
