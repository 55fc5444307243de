// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/mesh_recipe.h"

#include <bitset>
#include <cmath>
#include <utility>
#include <vector>

#include "demos/shared/shapes.h"
#include "tests/support/cells.h"

namespace bilayer::test {
namespace {

constexpr unsigned maxPoints = 16, maxTriangles = 40;  // of a mesh of arbitrary triangles
constexpr int cellsAlong = 3;                          // of a solid of cells
constexpr unsigned maxDamages = 6;
constexpr int maxMagnitude = 12;  // of a translation, as a power of two, relative to the size

Mesh arbitraryTriangles(ByteSource& bytes) {
    Mesh mesh;
    const unsigned points = 3 + bytes.below(maxPoints - 3), triangles = bytes.below(maxTriangles);
    // few different coordinates make edges cross and faces share planes
    const float steps = bytes.flag() ? 3 : 127;
    for (unsigned i = 0; i < points; ++i) mesh.points.push_back(glm::round(steps * bytes.latticePoint()) / steps);
    for (unsigned i = 0; i < triangles; ++i) {
        const unsigned a = bytes.byte() % points, b = bytes.byte() % points, c = bytes.byte() % points;
        mesh.triangles.push_back({a, b, c});
    }
    return mesh;
}

Mesh tetrahedron(ByteSource& bytes) {
    Mesh mesh{{}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
    for (int i = 0; i < 4; ++i) mesh.points.push_back(bytes.latticePoint());
    return mesh;
}

Mesh cellSolid(ByteSource& bytes) {
    Planes planes;
    for (auto& along : planes) {
        float at = -1;
        for (int i = 0; i <= cellsAlong; ++i, at += 0.02f + 0.6f * float(bytes.byte()) / 255) along.push_back(at);
    }
    const std::bitset<32> filled(bytes.number<std::uint32_t>());
    return solidOf(
        planes, [&](const glm::ivec3& c) { return filled[std::size_t(c.x + cellsAlong * (c.y + cellsAlong * c.z))]; });
}

Mesh shape(ByteSource& bytes) {
    const float size = 0.05f + 0.9f * float(bytes.byte()) / 255;
    switch (bytes.below(8)) {
        case 0:
            return shapes::box({size, 0.5f, 1 - size});
        case 1:
            return shapes::sphere(size, int(bytes.below(3)));
        case 2:
            return shapes::torus(0.7f, 0.3f * size, 12, 8);
        case 3:
            return shapes::cone(size, 1, 3 + int(bytes.below(20)));
        case 4:
            return shapes::cylinder(size, 1, 3 + int(bytes.below(20)));
        case 5:
            return shapes::box({1, 0.001f * size, 1}, 2);
        case 6:
            return cellSolid(bytes);
        default:
            return tetrahedron(bytes);
    }
}

Mesh joined(ByteSource& bytes) {
    std::vector<Mesh> parts;
    for (unsigned count = 1 + bytes.below(3); count > 0; --count) {
        Mesh part = shapes::moved(shape(bytes), 0.5f * bytes.latticePoint());
        parts.push_back(bytes.byte() % 4 ? std::move(part) : shapes::flipped(std::move(part)));
    }
    return shapes::join(parts);
}

void damageOnce(Mesh& mesh, ByteSource& bytes) {
    const unsigned kind = bytes.below(8), t = bytes.below(unsigned(mesh.triangles.size())),
                   p = bytes.below(unsigned(mesh.points.size())), q = bytes.below(unsigned(mesh.points.size()));
    glm::uvec3& triangle = mesh.triangles[t];
    switch (kind) {
        case 0:
            mesh.points[p] = bytes.latticePoint();
            break;
        case 1:
            mesh.points[p] = mesh.points[q];
            break;
        case 2:
            std::swap(triangle.y, triangle.z);
            break;
        case 3:
            mesh.triangles.erase(mesh.triangles.begin() + t);
            break;
        case 4:
            mesh.triangles.push_back(glm::uvec3(triangle));
            break;
        case 5: {  // splits one side of an edge, which leaves a crack without width
            const auto middle = unsigned(mesh.points.size());
            mesh.points.push_back(0.5f * (mesh.points[triangle.x] + mesh.points[triangle.y]));
            mesh.triangles.push_back({middle, triangle.y, triangle.z});
            mesh.triangles[t].y = middle;
            break;
        }
        case 6:
            mesh.points[p] += 1e-3f * bytes.latticePoint();
            break;
        default:
            mesh.points[p] = 0.5f * (mesh.points[p] + mesh.points[q]);
            break;
    }
}

}  // namespace

void damageMesh(Mesh& mesh, ByteSource& bytes) {
    for (unsigned count = bytes.below(maxDamages); count > 0 && !mesh.triangles.empty(); --count)
        damageOnce(mesh, bytes);
}

Mesh meshOf(ByteSource& bytes) {
    const unsigned kind = bytes.below(4);
    Mesh mesh = kind == 0 ? arbitraryTriangles(bytes) : joined(bytes);
    if (kind == 1) damageMesh(mesh, bytes);
    const float scale = std::exp2(float(int(bytes.below(21)) - 6));
    const bool isFar = bytes.byte() % 8 == 0;
    const glm::vec3 shift = isFar ? std::exp2(float(bytes.below(maxMagnitude))) * bytes.latticePoint() : glm::vec3(0);
    for (glm::vec3& point : mesh.points) point = scale * (point + shift);
    return mesh;
}

}  // namespace bilayer::test
