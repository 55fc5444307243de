#include "demos/shared/shapes.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>

namespace bilayer::shapes {
namespace {

constexpr float pi = glm::pi<float>();

// Two triangles for the quadrilateral a b c d, counter-clockwise.
void addQuad(Mesh& mesh, unsigned a, unsigned b, unsigned c, unsigned d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
}

// A grid of around x across quadrilaterals that closes on itself both ways.
void addTorusFaces(Mesh& mesh, int around, int across) {
    const auto vertex = [&](int i, int j) { return unsigned((i % around) * across + j % across); };
    for (int i = 0; i < around; ++i)
        for (int j = 0; j < across; ++j)
            addQuad(mesh, vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1));
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
            const float u = 2 * pi * float(i) / float(around), v = 2 * pi * float(j) / float(across);
            const float r = major + minor * std::cos(v);
            mesh.points.push_back({r * std::cos(u), r * std::sin(u), minor * std::sin(v)});
        }
    addTorusFaces(mesh, around, across);
    return mesh;
}

Mesh torusKnot(int p, int q, float radius, float thickness, int along, int across) {
    const auto curve = [&](float s) {
        const float u = 2 * pi * float(p) * s, v = 2 * pi * float(q) * s;
        const float r = radius * (1.f + 0.4f * std::cos(v));
        return glm::vec3(r * std::cos(u), r * std::sin(u), 0.4f * radius * std::sin(v));
    };
    Mesh mesh;
    for (int i = 0; i < along; ++i) {
        const float s = float(i) / float(along), step = 0.25f / float(along);
        const glm::vec3 centre = curve(s), before = curve(s - step), after = curve(s + step);
        const glm::vec3 tangent = glm::normalize(after - before);
        // the axis of the torus never runs along the curve, so this frame does not twist as it closes
        const glm::vec3 side = glm::normalize(glm::cross(tangent, glm::vec3(centre.x, centre.y, 0)));
        const glm::vec3 up = glm::cross(side, tangent);
        for (int j = 0; j < across; ++j) {
            const float w = 2 * pi * float(j) / float(across);
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
            const float u = 2 * pi * float(i) / float(segments);
            mesh.points.push_back({point.x * std::cos(u), point.x * std::sin(u), point.y});
        }
    // poles come out as equal points whatever the angle, and weld() drops the triangles that collapse there
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
    const auto at = [](float r, float angle) {  // angles from the bottom
        return glm::vec2(angle == 0 ? 0.f : r * std::sin(angle), -r * std::cos(angle));
    };
    std::vector<glm::vec2> profile;
    if (foot > 0) {
        const float bottom = -radius - wall / 2, bevel = wall / 8;
        profile = {{0, bottom}, {foot - bevel, bottom}, {foot, bottom + bevel}};
    }
    for (int i = 0; i <= arc; ++i) {  // outside, from the bottom to the rim
        const glm::vec2 point = at(radius, opening * float(i) / float(arc));
        if (foot <= 0 || point.x >= foot) profile.push_back(point);
    }
    const glm::vec2 outward = at(1, opening), onward(-outward.y, outward.x);
    for (int i = 1; i < rim; ++i) {  // over the round rim
        const float angle = pi * float(i) / float(rim);
        profile.push_back(middle * outward + wall / 2 * (std::cos(angle) * outward + std::sin(angle) * onward));
    }
    for (int i = arc; i >= 0; --i) profile.push_back(at(inner, opening * float(i) / float(arc)));  // inside, back down
    return revolve(profile, segments);
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
