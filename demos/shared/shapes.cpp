// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/shapes.h"

#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <stdexcept>
#include <utility>

namespace bilayer::shapes {
namespace {

// Two triangles for the quadrilateral a b c d, counter-clockwise.
void addQuad(Mesh& mesh, unsigned a, unsigned b, unsigned c, unsigned d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
}

// Adds a grid of around x across quadrilaterals that is closed in both directions.
void addTorusFaces(Mesh& mesh, int around, int across) {
    const auto vertex = [&](int i, int j) { return unsigned((i % around) * across + j % across); };
    for (int i = 0; i < around; ++i)
        for (int j = 0; j < across; ++j)
            addQuad(mesh, vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1));
}

// Smooth step from 0 at `low` to 1 at `high`, with zero slope at both.
float smoothStep(float low, float high, float x) {
    const float t = glm::clamp((x - low) / (high - low), 0.f, 1.f);
    return t * t * (3 - 2 * t);
}

// 1 between `low` and `high`, 0 beyond a `margin` around them.
float window(float low, float high, float margin, float x) {
    return smoothStep(low - margin, low, x) * (1 - smoothStep(high, high + margin, x));
}

// Maps the square [-1, 1]^2 to the unit disc, and square rings to circles. P. Shirley, K. Chiu, "A low distortion map
// between disk and square", 1997.
glm::vec2 onDisc(const glm::vec2& square) {
    const bool flat = std::abs(square.x) >= std::abs(square.y);
    const float r = flat ? square.x : square.y;
    if (r == 0) return {0, 0};
    const float turn = glm::pi<float>() / 4 * (flat ? square.y : square.x) / r;
    return flat ? glm::vec2(r * std::cos(turn), r * std::sin(turn)) : glm::vec2(r * std::sin(turn), r * std::cos(turn));
}

// The surface of the carved box with lid radius 1 and rims at -0.6 and 0.6.
namespace carved {

constexpr float halfHeight = 0.6f, dome = 0.08f;
constexpr float footRadius = 0.92f, bodyRadius = 0.9f, lidRadius = 1;
constexpr float wallDepth = 0.03f, topDepth = 0.02f;  // topDepth must not exceed the height of the dome

// Carving depth of a lozenge pattern: 0 on the lozenges, 1 between them.
float pattern(float a, float b) {
    return 1 - smoothStep(-0.25f, 0.25f, std::sin(a) * std::sin(b));
}

float wallRadius(float angle, float rise) {
    const float foot = 1 - smoothStep(0.03f, 0.06f, rise), lid = smoothStep(0.72f, 0.75f, rise);
    const float body = pattern(12 * angle + 20 * rise, 12 * angle - 20 * rise) * window(0.12f, 0.65f, 0.03f, rise);
    const float beads = pattern(24 * angle, 8 * glm::pi<float>() * (rise - 0.805f)) * window(0.82f, 0.92f, 0.02f, rise);
    return bodyRadius + (footRadius - bodyRadius) * foot + (lidRadius - bodyRadius) * lid - wallDepth * (body + beads);
}

float topHeight(const glm::vec2& point) {
    const float r2 = glm::dot(point, point), r = std::sqrt(r2), angle = r > 0 ? std::atan2(point.y, point.x) : 0.f;
    const float rosette = pattern(6 * angle + 16 * r, 6 * angle - 16 * r) * window(0.15f, 0.75f, 0.05f, r);
    return halfHeight + dome * (1 - r2) - topDepth * rosette;
}

}  // namespace carved

// The surface vertices of a cube's grid of across x across x up cells: the top, the bottom, the wall.
struct CubeGrid {
    int across, up;

    int around() const { return 4 * across; }
    int capSize() const { return (across + 1) * (across + 1); }
    unsigned cap(bool top, int i, int j) const { return unsigned((top ? 0 : capSize()) + i * (across + 1) + j); }
    // Returns the k-th column and row of a cap's border, counter-clockwise.
    glm::ivec2 border(int k) const {
        const int side = k / across, step = k % across;
        if (side == 0) return {step, 0};
        if (side == 1) return {across, step};
        return side == 2 ? glm::ivec2(across - step, across) : glm::ivec2(0, across - step);
    }
    unsigned wall(int k, int row) const {
        const int column = k % around();
        const glm::ivec2 at = border(column);
        if (row == 0 || row == up) return cap(row == up, at.x, at.y);
        return unsigned(2 * capSize() + (row - 1) * around() + column);
    }
    glm::vec2 disc(int i, int j) const { return onDisc(glm::vec2(2 * i - across, 2 * j - across) / float(across)); }
};

// Cuts each cell of a cap along the diagonal that points towards the centre. At a corner of the square, which becomes a
// part of the circle, the other diagonal would lie on the rim.
void addCap(Mesh& mesh, const CubeGrid& grid, bool top) {
    const int n = grid.across;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            unsigned a = grid.cap(top, i, j), b = grid.cap(top, i + 1, j), c = grid.cap(top, i + 1, j + 1),
                     d = grid.cap(top, i, j + 1);
            if (!top) std::swap(b, d);
            const bool rising = (2 * i + 1 > n) == (2 * j + 1 > n);
            rising ? addQuad(mesh, a, b, c, d) : addQuad(mesh, b, c, d, a);
        }
}

// Adds triangles between two rings of vertices, the second one above the first. It always advances on the ring whose
// next vertex comes first.
void addStrip(Mesh& mesh, unsigned low, int lowCount, float lowTurn, unsigned high, int highCount, float highTurn) {
    const auto angle = [](int i, int count, float turn) { return (float(i) + turn) / float(count); };
    const auto at = [](unsigned begin, int i, int count) { return begin + unsigned(i % count); };
    for (int i = 0, j = 0; i < lowCount || j < highCount;) {
        const bool onLow =
            j == highCount || (i < lowCount && angle(i + 1, lowCount, lowTurn) <= angle(j + 1, highCount, highTurn));
        const unsigned a = at(low, i, lowCount), b = at(high, j, highCount);
        if (onLow)
            mesh.triangles.push_back({a, at(low, ++i, lowCount), b});
        else
            mesh.triangles.push_back({a, at(high, ++j, highCount), b});
    }
}

// A unit sphere of vertex rings between two poles. The count of vertices of each ring keeps triangles similar.
Mesh ringedSphere(std::size_t triangles) {
    const float height =
        std::sqrt(std::sqrt(3.f) * 4 * glm::pi<float>() / float(triangles));  // height of an equilateral triangle
    const int rings = std::max(3, int(std::lround(glm::pi<float>() / height)) - 1);
    const auto slope = [&](int ring) { return glm::pi<float>() * float(ring + 1) / float(rings + 1); };
    float sines = 0;
    for (int i = 0; i < rings; ++i) sines += std::sin(slope(i));
    std::vector<int> counts;
    int rest = int(triangles / 2);
    for (int i = 0; i < rings; ++i) {
        counts.push_back(std::max(3, int(std::lround(float(triangles / 2) * std::sin(slope(i)) / sines))));
        rest -= counts.back();
    }
    counts[std::size_t(rings / 2)] += rest;  // the remainder from rounding goes to the longest ring

    Mesh mesh{{{0, 0, -1}}, {}};
    std::vector<unsigned> begins;
    const auto turn = [](std::size_t ring) { return ring % 2 ? 0.5f : 0.f; };
    for (std::size_t ring = 0; ring < counts.size(); ++ring) {
        begins.push_back(unsigned(mesh.points.size()));
        const float across = std::sin(slope(int(ring))), up = -std::cos(slope(int(ring)));
        for (int i = 0; i < counts[ring]; ++i) {
            const float angle = glm::two_pi<float>() * (float(i) + turn(ring)) / float(counts[ring]);
            mesh.points.push_back({across * std::cos(angle), across * std::sin(angle), up});
        }
    }
    const auto top = unsigned(mesh.points.size());
    mesh.points.push_back({0, 0, 1});
    const auto next = [&](std::size_t ring, int i) { return begins[ring] + unsigned((i + 1) % counts[ring]); };
    for (int i = 0; i < counts.front(); ++i) mesh.triangles.push_back({0, next(0, i), begins[0] + unsigned(i)});
    for (std::size_t ring = 0; ring + 1 < counts.size(); ++ring)
        addStrip(mesh, begins[ring], counts[ring], turn(ring), begins[ring + 1], counts[ring + 1], turn(ring + 1));
    for (int i = 0; i < counts.back(); ++i)
        mesh.triangles.push_back({begins.back() + unsigned(i), next(counts.size() - 1, i), top});
    return mesh;
}

// Maps the unit sphere to itself conformally. It projects the sphere from its highest point to the plane that touches
// the lowest point, scales the plane by `scale`, and projects back.
Mesh grownBelow(Mesh mesh, float scale) {
    for (glm::vec3& p : mesh.points) {
        const float above = scale * scale * (1 + p.z), below = 1 - p.z;
        p = glm::vec3(2 * scale * p.x, 2 * scale * p.y, above - below) / (above + below);
    }
    return mesh;
}

double deviationOfAreas(const Mesh& mesh) {
    double sum = 0, squares = 0;
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
        const double area = 0.5 * glm::length(glm::cross(b - a, c - a));
        sum += area;
        squares += area * area;
    }
    const double count = double(mesh.triangles.size()), mean = sum / count;
    return std::sqrt(squares / count - mean * mean);
}

}  // namespace

Mesh box(const glm::vec3& halfExtents, int cells) {
    Mesh mesh;
    for (int axis = 0; axis < 3; ++axis)
        for (int side = -1; side <= 1; side += 2) {
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            const auto base = unsigned(mesh.points.size());
            for (int i = 0; i <= cells; ++i)
                for (int j = 0; j <= cells; ++j) {
                    glm::vec3 point;
                    point[axis] = float(side) * halfExtents[axis];
                    point[u] = (2.f * float(i) / float(cells) - 1.f) * halfExtents[u];
                    point[v] = (2.f * float(j) / float(cells) - 1.f) * halfExtents[v];
                    mesh.points.push_back(point);
                }
            const auto vertex = [&](int i, int j) { return base + unsigned(i * (cells + 1) + j); };
            for (int i = 0; i < cells; ++i)
                for (int j = 0; j < cells; ++j) {
                    if (side > 0)
                        addQuad(mesh, vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1));
                    else
                        addQuad(mesh, vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1), vertex(i + 1, j));
                }
        }
    return weld(mesh);
}

Mesh sphere(float radius, int levels) {
    const float t = (1.f + std::sqrt(5.f)) / 2.f;
    Mesh mesh;
    mesh.points = {{-1, t, 0},  {1, t, 0},  {-1, -t, 0}, {1, -t, 0}, {0, -1, t},  {0, 1, t},
                   {0, -1, -t}, {0, 1, -t}, {t, 0, -1},  {t, 0, 1},  {-t, 0, -1}, {-t, 0, 1}};
    mesh.triangles = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                      {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                      {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
    for (auto& point : mesh.points) point = radius * glm::normalize(point);
    for (int level = 0; level < levels; ++level) {
        Mesh finer;
        for (const auto& triangle : mesh.triangles) {
            const glm::vec3 a = mesh.points[triangle.x], b = mesh.points[triangle.y], c = mesh.points[triangle.z];
            const auto base = unsigned(finer.points.size());
            for (const auto& point : {a, b, c, a + b, b + c, c + a})
                finer.points.push_back(radius * glm::normalize(point));
            finer.triangles.push_back({base, base + 3, base + 5});
            finer.triangles.push_back({base + 3, base + 1, base + 4});
            finer.triangles.push_back({base + 5, base + 4, base + 2});
            finer.triangles.push_back({base + 3, base + 4, base + 5});
        }
        mesh = weld(finer);
    }
    return mesh;
}

Mesh torus(float major, float minor, int around, int across) {
    Mesh mesh;
    for (int i = 0; i < around; ++i)
        for (int j = 0; j < across; ++j) {
            const float u = glm::two_pi<float>() * float(i) / float(around),
                        v = glm::two_pi<float>() * float(j) / float(across);
            const float r = major + minor * std::cos(v);
            mesh.points.push_back({r * std::cos(u), r * std::sin(u), minor * std::sin(v)});
        }
    addTorusFaces(mesh, around, across);
    return mesh;
}

Mesh torusKnot(int p, int q, float radius, float thickness, int along, int across) {
    const auto curve = [&](float s) {
        const float u = glm::two_pi<float>() * float(p) * s, v = glm::two_pi<float>() * float(q) * s;
        const float r = radius * (1.f + 0.4f * std::cos(v));
        return glm::vec3(r * std::cos(u), r * std::sin(u), 0.4f * radius * std::sin(v));
    };
    Mesh mesh;
    for (int i = 0; i < along; ++i) {
        const float s = float(i) / float(along), step = 0.25f / float(along);
        const glm::vec3 centre = curve(s), before = curve(s - step), after = curve(s + step);
        const glm::vec3 tangent = glm::normalize(after - before);
        // the axis of the torus is never parallel to the curve, so this frame closes without twist
        const glm::vec3 side = glm::normalize(glm::cross(tangent, glm::vec3(centre.x, centre.y, 0)));
        const glm::vec3 up = glm::cross(side, tangent);
        for (int j = 0; j < across; ++j) {
            const float w = glm::two_pi<float>() * float(j) / float(across);
            mesh.points.push_back(centre + thickness * (std::cos(w) * side + std::sin(w) * up));
        }
    }
    addTorusFaces(mesh, along, across);
    return mesh;
}

Mesh revolve(const std::vector<glm::vec2>& profile, int segments) {
    Mesh mesh;
    const int count = int(profile.size());
    for (int i = 0; i < segments; ++i)
        for (const auto& point : profile) {
            const float u = glm::two_pi<float>() * float(i) / float(segments);
            mesh.points.push_back({point.x * std::cos(u), point.x * std::sin(u), point.y});
        }
    // poles become equal points at all angles, and weld() removes the triangles that collapse there
    for (auto& point : mesh.points)
        if (std::abs(point.x) + std::abs(point.y) == 0.f) point.x = point.y = 0.f;
    addTorusFaces(mesh, segments, count);
    return weld(mesh);
}

Mesh cylinder(float radius, float height, int segments) {
    return revolve({{0, -height / 2}, {radius, -height / 2}, {radius, height / 2}, {0, height / 2}}, segments);
}

Mesh cone(float radius, float height, int segments) {
    return revolve({{0, -height / 2}, {radius, -height / 2}, {0, height / 2}}, segments);
}

Mesh bowl(float radius, float wall, int segments, float opening, float foot) {
    const float inner = radius - wall, middle = radius - wall / 2;
    const int arc = segments / 4, rim = std::max(4, arc / 8);
    const auto at = [](float r, float angle) {  // angles are measured from the bottom
        return glm::vec2(angle == 0 ? 0.f : r * std::sin(angle), -r * std::cos(angle));
    };
    std::vector<glm::vec2> profile;
    if (foot > 0) {
        const float bottom = -radius - wall / 2, bevel = wall / 8;
        profile = {{0, bottom}, {foot - bevel, bottom}, {foot, bottom + bevel}};
    }
    for (int i = 0; i <= arc; ++i) {  // outer wall, from the bottom to the rim
        const glm::vec2 point = at(radius, opening * float(i) / float(arc));
        if (foot <= 0 || point.x >= foot) profile.push_back(point);
    }
    const glm::vec2 outward = at(1, opening), onward(-outward.y, outward.x);
    for (int i = 1; i < rim; ++i) {  // over the round rim
        const float angle = glm::pi<float>() * float(i) / float(rim);
        profile.push_back(middle * outward + wall / 2 * (std::cos(angle) * outward + std::sin(angle) * onward));
    }
    for (int i = arc; i >= 0; --i) profile.push_back(at(inner, opening * float(i) / float(arc)));  // inside, back down
    return revolve(profile, segments);
}

Mesh carvedBox(std::size_t triangles, float radius) {
    if (triangles < 100) throw std::invalid_argument("a carved box has at least 100 triangles");
    // 4 n^2 triangles on the caps, 8 n m on the wall, whose cells are square: 2 pi around, 2 halfHeight up
    const float upPerAcross = 4 * 2 * carved::halfHeight / (glm::two_pi<float>());
    const int n = int(std::lround(std::sqrt(double(triangles) / (4 + 8 * double(upPerAcross)))));
    const CubeGrid grid{n, int(std::lround((double(triangles) / (4 * n) - n) / 2))};

    Mesh mesh;
    mesh.points.reserve(std::size_t(2 * grid.capSize()) + std::size_t(grid.around()) * std::size_t(grid.up - 1));
    mesh.triangles.reserve(std::size_t(4 * n) * std::size_t(n + 2 * grid.up));
    for (const bool top : {true, false})
        for (int i = 0; i <= n; ++i)
            for (int j = 0; j <= n; ++j) {
                const glm::vec2 p = grid.disc(i, j) * (top ? carved::lidRadius : carved::footRadius);
                mesh.points.push_back(glm::vec3(p, top ? carved::topHeight(p) : -carved::halfHeight));
            }
    for (int row = 1; row < grid.up; ++row)
        for (int k = 0; k < grid.around(); ++k) {
            const glm::ivec2 at = grid.border(k);
            const glm::vec2 outward = grid.disc(at.x, at.y);
            const float rise = float(row) / float(grid.up);
            mesh.points.push_back(glm::vec3(outward * carved::wallRadius(std::atan2(outward.y, outward.x), rise),
                                            carved::halfHeight * (2 * rise - 1)));
        }
    for (auto& point : mesh.points) point *= radius;

    for (const bool top : {true, false}) addCap(mesh, grid, top);
    for (int row = 0; row < grid.up; ++row)
        for (int k = 0; k < grid.around(); ++k)
            addQuad(mesh, grid.wall(k, row), grid.wall(k + 1, row), grid.wall(k + 1, row + 1), grid.wall(k, row + 1));
    return mesh;
}

Mesh unevenSphere(float deviation, std::size_t triangles) {
    if (triangles < 100 || triangles % 2)
        throw std::invalid_argument("an uneven sphere needs an even count of at least 100 triangles");
    const Mesh even = ringedSphere(triangles);
    float low = 1, high = 16;
    if (!(deviation >= deviationOfAreas(even) && deviation <= deviationOfAreas(grownBelow(even, high))))
        throw std::invalid_argument("no such sphere has areas of that deviation");
    for (int i = 0; i < 30; ++i) {
        const float middle = (low + high) / 2;
        (deviationOfAreas(grownBelow(even, middle)) < deviation ? low : high) = middle;
    }
    return grownBelow(even, low);
}

Mesh moved(Mesh mesh, const glm::vec3& by) {
    for (glm::vec3& point : mesh.points) point += by;
    return mesh;
}

Mesh flipped(Mesh mesh) {
    for (glm::uvec3& t : mesh.triangles) std::swap(t.y, t.z);
    return mesh;
}

Mesh join(const std::vector<Mesh>& meshes) {
    Mesh all;
    for (const Mesh& mesh : meshes) {
        const auto base = unsigned(all.points.size());
        all.points.insert(all.points.end(), mesh.points.begin(), mesh.points.end());
        for (const auto& triangle : mesh.triangles) all.triangles.push_back(triangle + base);
    }
    return all;
}

}  // namespace bilayer::shapes
