#include "sdf/pseudonormal.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>

#include "sdf/progress.h"
#include "sdf/tree_query.h"
#include "sdf/wide_tree.h"

namespace bilayer {
namespace {

/// A feature nearer to the closest point than this holds it: far above the rounding of doubles [voxels].
constexpr double onFeature = 1e-7;
/// One task fills the blocks of a cube with this side: enough work, and many tasks [voxels].
constexpr int taskSide = 32;

using Corners = std::array<glm::dvec3, 3>;  // relative to the voxel [voxels]

// The point of a segment nearest to a point.
glm::dvec3 closestOnSegment(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& p) {
    const glm::dvec3 edge = b - a;
    const double length2 = glm::dot(edge, edge);
    return length2 > 0 ? a + std::clamp(glm::dot(p - a, edge) / length2, 0.0, 1.0) * edge : a;
}

// The point of a triangle nearest to a point.
glm::dvec3 closestOnTriangle(const Corners& c, const glm::dvec3& p) {
    glm::dvec3 best = closestOnSegment(c[0], c[1], p);
    for (std::size_t i = 1; i < 3; ++i) {
        const glm::dvec3 other = closestOnSegment(c[i], c[(i + 1) % 3], p);
        if (glm::distance(other, p) < glm::distance(best, p)) best = other;
    }
    const glm::dvec3 normal = glm::cross(c[1] - c[0], c[2] - c[0]);
    for (std::size_t i = 0; i < 3; ++i)
        if (!(glm::dot(glm::cross(normal, c[(i + 1) % 3] - c[i]), p - c[i]) > 0)) return best;
    const glm::dvec3 foot = p - normal * (glm::dot(normal, p - c[0]) / glm::dot(normal, normal));
    return glm::distance(foot, p) < glm::distance(best, p) ? foot : best;
}

// The angle under which the triangle is seen from a point of its own: its weight in the pseudonormal there.
double angleAround(const Corners& c, const glm::dvec3& p) {
    if (glm::distance(closestOnTriangle(c, p), p) > onFeature) return 0;
    for (std::size_t i = 0; i < 3; ++i)
        if (glm::distance(c[i], p) <= onFeature) {
            const glm::dvec3 a = c[(i + 1) % 3] - c[i], b = c[(i + 2) % 3] - c[i];
            return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
        }
    for (std::size_t i = 0; i < 3; ++i)
        if (glm::distance(closestOnSegment(c[i], c[(i + 1) % 3], p), p) <= onFeature) return glm::pi<double>();
    return glm::two_pi<double>();
}

// Begins with the least corner and keeps the order around, so that equal faces have equal corners.
Corners fromLeast(Corners c) {
    const auto less = [](const glm::dvec3& a, const glm::dvec3& b) {
        return std::lexicographical_compare(&a.x, &a.x + 3, &b.x, &b.x + 3);
    };
    std::rotate(c.begin(), std::min_element(c.begin(), c.end(), less), c.end());
    return c;
}

class Filler {
  public:
    explicit Filler(const MeshJob& job) : job_(job), tree_(makeWideTree(job.mesh, job.voxelSize, &job.progress)) {}

    void fill() {
        const int margin = int(std::ceil(job_.reach)) / blockSide * blockSide + blockSide;
        const glm::ivec3 first(-margin);
        const glm::ivec3 extent = tree_.size + 2 * margin;
        int side = taskSide;
        while (side < std::max({extent.x, extent.y, extent.z})) side *= 2;
        descend(first, side, wholeTree(tree_));
    }

  private:
    // What a thread works in.
    struct Scratch {
        NodeList half, block;
        BlockAnswer answer;
        std::vector<glm::ivec3> origins;
        std::vector<float> distances;
        std::vector<std::int32_t> triangles;
        std::vector<Corners> faces;
    };

    void narrowTo(const NodeList& from, const glm::ivec3& origin, int side, NodeList& to) const {
        const glm::vec3 lower(origin);
        narrow(tree_, from, {lower, lower + float(side - 1)}, job_.reach, float(side), to);
    }

    static glm::ivec3 octant(int i, int side) { return side * glm::ivec3(i >> 2, i >> 1 & 1, i & 1); }

    void descend(const glm::ivec3& origin, int side, const NodeList& list) {
        if (side == taskSide) return fillTask(origin, list);
        tbb::parallel_for(0, 8, [&](int i) {
            const glm::ivec3 child = origin + octant(i, side / 2);
            NodeList narrowed;
            narrowTo(list, child, side / 2, narrowed);
            if (narrowed.count > 0) descend(child, side / 2, narrowed);
        });
    }

    void fillTask(const glm::ivec3& origin, const NodeList& list) {
        Scratch& scratch = scratch_.local();
        scratch.origins.clear();
        scratch.distances.clear();
        scratch.triangles.clear();
        scratch.answer.lastWinner = 0;
        for (int i = 0; i < 8; ++i) {
            const glm::ivec3 half = origin + octant(i, taskSide / 2);
            narrowTo(list, half, taskSide / 2, scratch.half);
            if (scratch.half.count == 0) continue;
            for (int j = 0; j < 8; ++j) {
                const glm::ivec3 block = half + octant(j, blockSide);
                narrowTo(scratch.half, block, blockSide, scratch.block);
                if (scratch.block.count > 0) fillBlock(block, scratch);
            }
        }
        if (!scratch.origins.empty()) job_.sink({scratch.origins, scratch.distances, scratch.triangles});
    }

    void fillBlock(const glm::ivec3& block, Scratch& scratch) {
        job_.progress.poll();
        const std::size_t before = scratch.origins.size() * blockVoxels;
        scratch.distances.resize(before + blockVoxels);
        if (job_.triangles) scratch.triangles.resize(before + blockVoxels);
        scratch.answer.distances = scratch.distances.data() + before;
        scratch.answer.triangles = job_.triangles ? scratch.triangles.data() + before : nullptr;
        answerBlock(tree_, scratch.block, glm::vec3(block), job_.reach, job_.sign, scratch.answer);
        if (!scratch.answer.any) {
            scratch.distances.resize(before);
            if (job_.triangles) scratch.triangles.resize(before);
            return;
        }
        scratch.origins.push_back(block + tree_.base);
        if (!job_.sign) return;
        for (const Doubt& doubt : scratch.answer.doubts)
            if (inside(doubt, block, scratch)) scratch.answer.distances[doubt.voxel] *= -1;
        spreadSigns(scratch.answer.distances);
    }

    // Whether a voxel is inside by the pseudonormal at its closest point.
    bool inside(const Doubt& doubt, const glm::ivec3& block, Scratch& scratch) const {
        const int v = doubt.voxel;
        const glm::dvec3 voxel(block + tree_.base +
                               glm::ivec3(v / (blockSide * blockSide), v / blockSide % blockSide, v % blockSide));
        auto& faces = scratch.faces;
        faces.clear();
        for (std::uint32_t i = doubt.begin; i < doubt.end; ++i) {
            const glm::uvec3& t = job_.mesh.triangles[scratch.answer.candidates[i]];
            const auto corner = [&](unsigned p) {
                return glm::dvec3(job_.mesh.points[p]) / double(job_.voxelSize) - voxel;
            };
            const Corners face = fromLeast({corner(t.x), corner(t.y), corner(t.z)});
            if (std::find(faces.begin(), faces.end(), face) == faces.end()) faces.push_back(face);
        }
        glm::dvec3 closest(std::numeric_limits<double>::max());
        for (const Corners& face : faces) {
            const glm::dvec3 point = closestOnTriangle(face, glm::dvec3(0));
            if (glm::length(point) < glm::length(closest)) closest = point;
        }
        glm::dvec3 sum(0);
        for (const Corners& face : faces) {
            const glm::dvec3 normal = glm::cross(face[1] - face[0], face[2] - face[0]);
            const double length = glm::length(normal);
            if (length > 0) sum += angleAround(face, closest) / length * normal;
        }
        return glm::dot(sum, closest) > 0;  // the voxel is the origin here
    }

    // Voxels beyond the reach have the sign of the voxels beside them.
    static void spreadSigns(float* distances) {
        std::array<std::uint64_t, blockSide> known{}, negative{};  // a word a plane of equal x
        for (int i = 0; i < blockVoxels; ++i) {
            const std::uint64_t bit = std::uint64_t(1) << i % 64;
            if (distances[i] < farAway) known[std::size_t(i / 64)] |= bit;
            if (distances[i] < 0) negative[std::size_t(i / 64)] |= bit;
        }
        const auto plane = [](auto& words, int x) { return x < 0 || x >= blockSide ? 0 : words[std::size_t(x)]; };
        for (bool more = true; more;) {
            more = false;
            for (int x = 0; x < blockSide; ++x) {
                std::uint64_t &k = known[std::size_t(x)], &n = negative[std::size_t(x)];
                if (k == ~std::uint64_t(0)) continue;
                constexpr std::uint64_t first = 0x0101010101010101, last = first << 7;
                const auto around = [&](auto& words) {
                    const std::uint64_t w = words[std::size_t(x)];
                    return std::array{plane(words, x - 1), plane(words, x + 1), w << 8, w >> 8,
                                      (w & ~last) << 1,    (w & ~first) >> 1};
                };
                const auto k6 = around(known), n6 = around(negative);
                for (std::size_t i = 0; i < k6.size(); ++i) {
                    const std::uint64_t fresh = k6[i] & ~k;
                    n |= fresh & n6[i];
                    k |= fresh;
                    more = more || fresh != 0;
                }
            }
        }
        for (int i = 0; i < blockVoxels; ++i)
            if (distances[i] == farAway && negative[std::size_t(i / 64)] >> i % 64 & 1) distances[i] = -farAway;
    }

    const MeshJob& job_;
    WideTree tree_;
    tbb::enumerable_thread_specific<Scratch> scratch_;
};

}  // namespace

void fillPseudonormal(const MeshJob& job) {
    Filler(job).fill();
}

}  // namespace bilayer
