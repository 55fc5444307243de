#include "sdf/mesh.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_reduce.h>

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <span>
#include <stdexcept>
#include <tuple>

namespace bilayer {
namespace {

constexpr unsigned unseen = std::numeric_limits<unsigned>::max();

bool finite(const glm::vec3& p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

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

// Mixes a word into a hash: FNV-1a's step on 64 bits at once, with the high bits folded down.
std::uint64_t mixed(std::uint64_t hash, std::uint64_t word) {
    constexpr std::uint64_t prime = 1099511628211ull;
    const std::uint64_t product = (hash ^ word) * prime;
    return product ^ (product >> 32);
}

// A hash of runs of fixed length, so that they can be hashed side by side.
std::uint64_t hashOfRuns(std::span<const std::uint32_t> words) {
    constexpr std::size_t run = 1 << 15;
    std::vector<std::uint64_t> hashes((words.size() + run - 1) / run, 0);
    tbb::parallel_for(std::size_t(0), hashes.size(), [&](std::size_t i) {
        for (const std::uint32_t word : words.subspan(i * run, std::min(run, words.size() - i * run)))
            hashes[i] = mixed(hashes[i], word);
    });
    std::uint64_t all = words.size();
    for (const std::uint64_t hash : hashes) all = mixed(all, hash);
    return all;
}

}  // namespace

float Bounds::longestSide() const {
    return empty() ? 0.f : std::max({size().x, size().y, size().z});
}

Bounds bounds(const Mesh& mesh) {
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, mesh.triangles.size(), 4096), Bounds{},
        [&](const auto& range, Bounds box) {
            for (std::size_t i = range.begin(); i < range.end(); ++i)
                for (int k = 0; k < 3; ++k) box.add(mesh.points[mesh.triangles[i][k]]);
            return box;
        },
        [](const Bounds& a, const Bounds& b) {
            return Bounds{glm::min(a.lower, b.lower), glm::max(a.upper, b.upper)};
        });
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
    const bool isFar = mesh.origin != glm::dvec3(0);
    const glm::mat4 near = isFar ? glm::mat4(glm::mat3(map)) : map;
    for (auto& point : result.points) point = glm::vec3(near * glm::vec4(point, 1.f));
    if (isFar) result.origin = glm::dvec3(glm::dmat4(map) * glm::dvec4(mesh.origin, 1));
    if (glm::determinant(glm::mat3(map)) < 0)
        for (auto& triangle : result.triangles) std::swap(triangle.y, triangle.z);
    return result;
}

std::uint64_t hash(const Mesh& mesh) {
    const auto words = [](const auto& items) {
        return std::span(reinterpret_cast<const std::uint32_t*>(items.data()), 3 * items.size());
    };
    const std::uint64_t points = hashOfRuns(words(mesh.points)), triangles = hashOfRuns(words(mesh.triangles));
    return mixed(mixed(mesh.points.size(), points), triangles);
}

}  // namespace bilayer
