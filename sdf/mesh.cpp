#include "sdf/mesh.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <stdexcept>
#include <tuple>

namespace bilayer {
namespace {

constexpr unsigned unseen = std::numeric_limits<unsigned>::max();

bool finite(const glm::vec3& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

// For each vertex, the first vertex with equal coordinates.
std::vector<unsigned> firstOfEqual(const std::vector<glm::vec3>& points) {
    std::vector<unsigned> order(points.size()), first(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) order[i] = unsigned(i);
    const auto key = [&](unsigned i) { return std::tuple(points[i].x, points[i].y, points[i].z, i); };
    std::sort(order.begin(), order.end(), [&](unsigned a, unsigned b) { return key(a) < key(b); });
    for (std::size_t i = 0; i < order.size(); ++i) {
        const bool same = i > 0 && points[order[i]] == points[order[i - 1]];
        first[order[i]] = same ? first[order[i - 1]] : order[i];
    }
    return first;
}

}  // namespace

float Bounds::longestSide() const { return empty() ? 0.f : std::max({size().x, size().y, size().z}); }

void Bounds::add(const glm::vec3& point) {
    lower = glm::min(lower, point);
    upper = glm::max(upper, point);
}

Bounds bounds(const Mesh& mesh) {
    Bounds box;
    for (const auto& triangle : mesh.triangles)
        for (int k = 0; k < 3; ++k) box.add(mesh.points[triangle[k]]);
    return box;
}

void validate(const Mesh& mesh) {
    if (mesh.triangles.empty()) throw std::invalid_argument("the mesh has no triangle");
    if (mesh.points.size() >= unseen || mesh.triangles.size() >= std::size_t(std::numeric_limits<int>::max()))
        throw std::invalid_argument(fmt::format("the mesh is too large: {} vertices, {} triangles; at most 2^31 - 2",
                                                mesh.points.size(), mesh.triangles.size()));
    for (std::size_t i = 0; i < mesh.points.size(); ++i)
        if (!finite(mesh.points[i]))
            throw std::invalid_argument(fmt::format("vertex {} is not finite: ({}, {}, {})", i, mesh.points[i].x,
                                                    mesh.points[i].y, mesh.points[i].z));
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
        for (int k = 0; k < 3; ++k)
            if (mesh.triangles[i][k] >= mesh.points.size())
                throw std::invalid_argument(fmt::format("triangle {} uses vertex {}, but there are only {} vertices", i,
                                                        mesh.triangles[i][k], mesh.points.size()));
}

Mesh weld(const Mesh& mesh) {
    const std::vector<unsigned> first = firstOfEqual(mesh.points);
    std::vector<unsigned> number(mesh.points.size(), unseen);
    std::vector<bool> used(mesh.points.size(), false);
    Mesh welded;
    welded.triangles.reserve(mesh.triangles.size());
    for (const auto& triangle : mesh.triangles) {
        const glm::uvec3 t{first[triangle.x], first[triangle.y], first[triangle.z]};
        if (t.x == t.y || t.y == t.z || t.z == t.x) continue;
        used[t.x] = used[t.y] = used[t.z] = true;
        welded.triangles.push_back(t);
    }
    for (std::size_t i = 0; i < mesh.points.size(); ++i)
        if (used[i]) {
            number[i] = unsigned(welded.points.size());
            welded.points.push_back(mesh.points[i]);
        }
    for (auto& t : welded.triangles) t = {number[t.x], number[t.y], number[t.z]};
    return welded;
}

Mesh transformed(const Mesh& mesh, const glm::mat4& map) {
    Mesh result = mesh;
    for (auto& point : result.points) point = glm::vec3(map * glm::vec4(point, 1.f));
    if (glm::determinant(glm::mat3(map)) < 0)
        for (auto& triangle : result.triangles) std::swap(triangle.y, triangle.z);
    return result;
}

std::uint64_t hash(const Mesh& mesh) {
    constexpr std::uint64_t offset = 14695981039346656037ull, prime = 1099511628211ull;
    std::uint64_t value = offset;
    // a word at a time, least significant byte first whatever the machine's order
    const auto mix = [&](std::uint32_t word) {
        for (int byte = 0; byte < 4; ++byte) value = (value ^ ((word >> (8 * byte)) & 0xffu)) * prime;
    };
    for (const auto& point : mesh.points)
        for (int k = 0; k < 3; ++k) mix(std::bit_cast<std::uint32_t>(point[k]));
    for (const auto& triangle : mesh.triangles)
        for (int k = 0; k < 3; ++k) mix(triangle[k]);
    return value;
}

}  // namespace bilayer
