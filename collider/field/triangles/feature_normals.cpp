// SPDX-License-Identifier: Apache-2.0
#include "collider/field/triangles/feature_normals.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <set>
#include <span>

#include "sdf/mesh/topology.h"

namespace bilayer::detail {
namespace {

/// Count of triangles per task.
constexpr std::size_t featuresPerTask = 4096;

// The contribution of a triangle to its features.
struct Face {
    glm::dvec3 normal{0};            // zero: it has no area
    std::array<double, 3> angles{};  // [rad]
    bool counts = false;             // it has area and is no duplicate
};

Face faceOf(const Mesh& mesh, const glm::uvec3& t, double thinnest) {
    const std::array<glm::dvec3, 3> c{mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]};
    const glm::dvec3 n = glm::cross(c[1] - c[0], c[2] - c[0]);
    const double area = glm::length(n);
    const double longest = std::max({glm::distance(c[0], c[1]), glm::distance(c[1], c[2]), glm::distance(c[2], c[0])});
    Face face;
    if (!(area > thinnest * longest)) return face;
    face.normal = n / area;
    face.counts = true;
    for (std::size_t i = 0; i < 3; ++i)
        face.angles[i] = std::atan2(area, glm::dot(c[(i + 1) % 3] - c[i], c[(i + 2) % 3] - c[i]));
    return face;
}

// Whether two triangles with the same vertices have the same orientation.
bool sameOrientation(const glm::uvec3& a, const glm::uvec3& b) {
    for (int k = 0; k < 3; ++k)
        if (a.x == b[k] && a.y == b[(k + 1) % 3] && a.z == b[(k + 2) % 3]) return true;
    return false;
}

// The faces of a mesh. Of those with the same vertices, one counts per orientation.
class Faces {
  public:
    Faces(const Mesh& mesh, const Topology& topology, double thinnest) : faces_(topology.triangles.size()) {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, faces_.size(), featuresPerTask), [&](const auto& range) {
            for (std::size_t i = range.begin(); i < range.end(); ++i)
                if (topology.proper(i)) faces_[i] = faceOf(mesh, topology.triangles[i], thinnest);
        });
        std::set<unsigned> backs;  // first triangles that have a reverse
        for (std::size_t i = 0; i < faces_.size(); ++i) {
            const unsigned first = topology.original[i];
            if (first == i) continue;
            const bool back = !sameOrientation(topology.triangles[i], topology.triangles[first]);
            faces_[i].counts = faces_[i].counts && back && backs.insert(first).second;
        }
        for (std::size_t i = 0; i < faces_.size(); ++i)
            if (isThin(i) || backs.count(topology.original[i])) flat_.push_back(std::uint32_t(i));
    }

    const Face& operator[](std::size_t i) const { return faces_[i]; }
    std::size_t size() const { return faces_.size(); }
    bool isThin(std::size_t i) const { return faces_[i].normal == glm::dvec3(0); }
    const std::vector<std::uint32_t>& flat() const { return flat_; }

  private:
    std::vector<Face> faces_;
    std::vector<std::uint32_t> flat_;
};

// A sum of normals and of their weights; unknown if a triangle without area is involved.
struct Sum {
    glm::dvec3 normals{0};
    double weights = 0;
    bool known = true;

    void add(const Face& face, double weight) {
        normals += weight * face.normal;
        weights += weight;
    }
    glm::vec3 mean() const { return known && weights > 0 ? glm::vec3(normals / weights) : glm::vec3(0); }
};

int cornerOf(const glm::uvec3& triangle, unsigned vertex) {
    return triangle.x == vertex ? 0 : triangle.y == vertex ? 1 : 2;
}

std::vector<glm::vec3> edgeNormals(const Topology& topology, const Faces& faces) {
    std::vector<glm::vec3> normals(3 * faces.size());
    const auto visit = [&](std::span<const EdgeUse> uses) {
        Sum sum;
        for (const EdgeUse& use : uses) {
            if (faces.isThin(use.triangle)) sum.known = false;
            if (faces[use.triangle].counts) sum.add(faces[use.triangle], 1);
        }
        const glm::vec3 mean = sum.mean();
        for (const EdgeUse& use : uses) {
            const int from = cornerOf(topology.triangles[use.triangle], use.forward ? use.low : use.high);
            normals[3 * std::size_t(use.triangle) + std::size_t(from)] = mean;
        }
    };
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, topology.edges.size(), featuresPerTask),
                      [&](const auto& range) { topology.forEdges(range.begin(), range.end(), visit); });
    return normals;
}

std::vector<glm::vec3> vertexNormals(const Mesh& mesh, const Topology& topology, const Faces& faces) {
    std::vector<Sum> sums(mesh.points.size());
    for (std::size_t i = 0; i < faces.size(); ++i)
        for (int k = 0; k < 3; ++k) {
            Sum& sum = sums[topology.triangles[i][k]];
            if (faces.isThin(i)) sum.known = false;
            if (faces[i].counts) sum.add(faces[i], faces[i].angles[std::size_t(k)]);
        }
    std::vector<glm::vec3> normals(mesh.points.size());
    for (std::size_t i = 0; i < faces.size(); ++i)
        for (int k = 0; k < 3; ++k) normals[mesh.triangles[i][k]] = sums[topology.triangles[i][k]].mean();
    return normals;
}

}  // namespace

FeatureNormals::FeatureNormals(const Mesh& mesh, double thinnest) {
    const Topology topology(mesh);
    const Faces faces(mesh, topology, thinnest);
    tbb::parallel_invoke([&] { edges_ = edgeNormals(topology, faces); },
                         [&] { vertices_ = vertexNormals(mesh, topology, faces); });
    flat_ = faces.flat();
}

bool FeatureNormals::hasNoNormal(std::uint32_t triangle) const {
    return !flat_.empty() && std::binary_search(flat_.begin(), flat_.end(), triangle);
}

std::size_t FeatureNormals::memoryBytes() const {
    return (edges_.size() + vertices_.size()) * sizeof(glm::vec3) + flat_.size() * sizeof(std::uint32_t);
}

}  // namespace bilayer::detail
