// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/mesh.h>

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_reduce.h>

#include <fmt/format.h>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "sdf/base/equal_points.h"
#include "sdf/base/finite.h"
#include "sdf/base/hash.h"
#include "sdf/base/large_array.h"
#include "sdf/base/parallel_parts.h"
#include "sdf/base/welding.h"

namespace bilayer {

using namespace detail;

namespace {

/// Vertices or triangles per task.
constexpr std::size_t itemsPerRun = 1 << 14;

// Calls body(run, begin, end) for runs of the indices below n, in parallel.
template <class Body>
void forEachRun(std::size_t n, Body body) {
    inParallel((n + itemsPerRun - 1) / itemsPerRun,
               [&](std::size_t run) { body(run, run * itemsPerRun, std::min(n, (run + 1) * itemsPerRun)); });
}

// Keeps the items for which keeps(index) returns true, in order. Returns the new start of each run. keeps() is called
// once per item and may modify that item.
template <class Item, class Keeps>
std::vector<std::size_t> keepWhere(std::vector<Item>& items, Keeps keeps) {
    std::vector<std::size_t> places((items.size() + itemsPerRun - 1) / itemsPerRun + 1, 0);
    forEachRun(items.size(), [&](std::size_t run, std::size_t begin, std::size_t end) {
        std::size_t kept = begin;
        for (std::size_t i = begin; i < end; ++i)
            if (keeps(i)) items[kept++] = items[i];
        places[run + 1] = kept - begin;
    });
    for (std::size_t run = 0; run + 1 < places.size(); ++run) {
        const auto from = items.begin() + std::ptrdiff_t(run * itemsPerRun);
        const auto to = items.begin() + std::ptrdiff_t(places[run]);
        if (from != to) std::copy_n(from, places[run + 1], to);
        places[run + 1] += places[run];
    }
    items.resize(places.back());
    return places;
}

// Sets a flag that other threads may set at the same time.
void mark(std::uint8_t& flag) {
    const std::atomic_ref<std::uint8_t> shared(flag);
    if (!shared.load(std::memory_order_relaxed)) shared.store(1, std::memory_order_relaxed);
}

bool areAllSet(const std::vector<std::uint8_t>& flags) {
    return flags.empty() || !std::memchr(flags.data(), 0, flags.size());
}

bool isCollapsed(const glm::uvec3& t) {
    return t.x == t.y || t.y == t.z || t.z == t.x;
}

// Replaces each vertex by the first equal one, then removes triangles that use a vertex twice. `first` is empty if no
// vertices are equal. Returns one byte per vertex: whether a triangle uses it.
std::vector<std::uint8_t> keepProper(Mesh& mesh, const LargeArray<unsigned>& first) {
    std::vector<std::uint8_t> used(mesh.points.size(), 0);
    keepWhere(mesh.triangles, [&](std::size_t i) {
        glm::uvec3& t = mesh.triangles[i];
        if (first.size() > 0) t = {first[t.x], first[t.y], first[t.z]};
        if (isCollapsed(t)) return false;
        for (int k = 0; k < 3; ++k) mark(used[t[k]]);
        return true;
    });
    return used;
}

// Removes unused vertices and renumbers the others.
void keepUsed(Mesh& mesh, const std::vector<std::uint8_t>& used) {
    if (areAllSet(used)) return;
    LargeArray<unsigned> number(mesh.points.size());
    const std::vector<std::size_t> places = keepWhere(mesh.points, [&](std::size_t i) { return used[i] != 0; });
    forEachRun(used.size(), [&](std::size_t run, std::size_t begin, std::size_t end) {
        std::size_t place = places[run];
        for (std::size_t i = begin; i < end; ++i)
            if (used[i]) number[i] = unsigned(place++);
    });
    forEachRun(mesh.triangles.size(), [&](std::size_t, std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            glm::uvec3& t = mesh.triangles[i];
            t = {number[t.x], number[t.y], number[t.z]};
        }
    });
    mesh.points.shrink_to_fit();
}

// Returns the first index below n for which `holds` returns true; n if there is none.
template <class Holds>
std::size_t firstWhere(std::size_t n, Holds holds) {
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, n, itemsPerRun), n,
        [&](const auto& range, std::size_t found) {
            std::size_t i = range.begin();
            while (i < range.end() && !holds(i)) ++i;
            return i < range.end() ? std::min(found, i) : found;
        },
        [](std::size_t a, std::size_t b) { return std::min(a, b); });
}

// Hashes runs of fixed length, so that the runs can be hashed in parallel.
std::uint64_t hashOfRuns(std::span<const std::uint32_t> words) {
    constexpr std::size_t run = 1 << 15;
    std::vector<std::uint64_t> hashes((words.size() + run - 1) / run, 0);
    tbb::parallel_for(std::size_t(0), hashes.size(), [&](std::size_t i) {
        for (const std::uint32_t word : words.subspan(i * run, std::min(run, words.size() - i * run)))
            hashes[i] = mixedHash(hashes[i], word);
    });
    std::uint64_t all = words.size();
    for (const std::uint64_t hash : hashes) all = mixedHash(all, hash);
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
    const std::size_t points = mesh.points.size(), triangles = mesh.triangles.size();
    if (triangles == 0) throw std::invalid_argument("the mesh has no triangle");
    if (points >= std::numeric_limits<unsigned>::max() || triangles >= std::size_t(std::numeric_limits<int>::max()))
        throw std::invalid_argument(fmt::format(
            "the mesh is too large: {} vertices, of at most 2^32 - 2, and {} triangles, of at most 2^31 - 2", points,
            triangles));
    const std::size_t p = firstWhere(points, [&](std::size_t i) { return !isFinite(mesh.points[i]); });
    if (p < points)
        throw std::invalid_argument(fmt::format("vertex {} is not finite: ({}, {}, {})", p, mesh.points[p].x,
                                                mesh.points[p].y, mesh.points[p].z));
    const auto outside = [&](unsigned vertex) { return vertex >= points; };
    const std::size_t t = firstWhere(triangles, [&](std::size_t i) {
        const glm::uvec3& triangle = mesh.triangles[i];
        return outside(triangle.x) || outside(triangle.y) || outside(triangle.z);
    });
    if (t == triangles) return;
    const glm::uvec3& triangle = mesh.triangles[t];
    const unsigned vertex = outside(triangle.x) ? triangle.x : outside(triangle.y) ? triangle.y : triangle.z;
    throw std::invalid_argument(
        fmt::format("triangle {} uses vertex {}, but there are only {} vertices", t, vertex, points));
}

VertexUse detail::vertexUse(const std::vector<glm::uvec3>& triangles, std::size_t vertices) {
    VertexUse use{std::vector<std::uint8_t>(vertices, 0)};
    std::atomic<bool> repeats = false;
    forEachRun(triangles.size(), [&](std::size_t, std::size_t begin, std::size_t end) {
        bool repeatsHere = false;
        for (std::size_t i = begin; i < end; ++i) {
            const glm::uvec3& t = triangles[i];
            for (int k = 0; k < 3; ++k) {
                if (t[k] >= vertices)
                    throw std::runtime_error(
                        fmt::format("a face refers to vertex {}, but there are {}, counted from 0", t[k], vertices));
                mark(use.used[t[k]]);
            }
            repeatsHere |= isCollapsed(t);
        }
        if (repeatsHere) repeats.store(true, std::memory_order_relaxed);
    });
    use.repeats = repeats;
    return use;
}

Mesh weld(Mesh mesh) {
    keepUsed(mesh, keepProper(mesh, firstOfEqual(mesh.points)));
    return mesh;
}

Mesh detail::weld(Mesh mesh, const VertexUse& use) {
    const LargeArray<unsigned> first = firstOfEqual(mesh.points);
    if (first.size() > 0 || use.repeats)
        keepUsed(mesh, keepProper(mesh, first));
    else
        keepUsed(mesh, use.used);
    return mesh;
}

std::optional<Mesh> detail::weldUnlessDone(const Mesh& mesh) {
    const LargeArray<unsigned> first = firstOfEqual(mesh.points);
    if (first.size() == 0) {
        const VertexUse use = vertexUse(mesh.triangles, mesh.points.size());
        if (!use.repeats && areAllSet(use.used)) return std::nullopt;
    }
    Mesh welded = mesh;
    keepUsed(welded, keepProper(welded, first));
    return welded;
}

Mesh transformed(const Mesh& mesh, const glm::mat4& map) {
    Mesh result = mesh;
    const bool isFar = mesh.origin != glm::dvec3(0);
    const glm::mat4 near = isFar ? glm::mat4(glm::mat3(map)) : map;
    for (std::size_t i = 0; i < result.points.size(); ++i) {
        glm::vec3& point = result.points[i];
        const bool wasFinite = isFinite(point);
        point = glm::vec3(near * glm::vec4(point, 1.f));
        if (wasFinite && !isFinite(point))
            throw std::invalid_argument(fmt::format("transformed(): vertex {} would be beyond the range of float", i));
    }
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
    return mixedHash(mixedHash(mesh.points.size(), points), triangles);
}

}  // namespace bilayer
