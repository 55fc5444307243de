// SPDX-License-Identifier: Apache-2.0
#include "bench/paper/scatter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <stdexcept>

namespace bilayer::paper {
namespace {

// A directed edge and its triangle, for sorting.
struct Edge {
    std::uint64_t vertices;  // the smaller index first
    std::uint32_t triangle, side;
};

// Normals of faces, edges and vertices (equation 5 of [33]).
class Normals {
  public:
    explicit Normals(const Mesh& mesh)
        : faces(mesh.triangles.size()), edges(mesh.triangles.size()), vertices(mesh.points.size(), glm::dvec3(0)) {
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t) addFace(mesh, t);
        addEdges(mesh);
    }

    std::vector<glm::dvec3> faces;
    std::vector<std::array<glm::dvec3, 3>> edges;  // of a triangle: from its first vertex to its second one, ...
    std::vector<glm::dvec3> vertices;

  private:
    void addFace(const Mesh& mesh, std::size_t t) {
        const glm::uvec3& v = mesh.triangles[t];
        const std::array<glm::dvec3, 3> p{mesh.points[v.x], mesh.points[v.y], mesh.points[v.z]};
        const glm::dvec3 cross = glm::cross(p[1] - p[0], p[2] - p[0]);
        const double length = glm::length(cross);
        if (!(length > 0)) return;
        faces[t] = cross / length;
        for (int k = 0; k < 3; ++k) {
            const glm::dvec3 to = p[(k + 1) % 3] - p[k], from = p[(k + 2) % 3] - p[k];
            const double angle = std::atan2(glm::length(glm::cross(to, from)), glm::dot(to, from));
            vertices[v[k]] += angle * faces[t];
        }
    }

    void addEdges(const Mesh& mesh) {
        std::vector<Edge> all;
        all.reserve(3 * mesh.triangles.size());
        for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
            for (std::uint32_t k = 0; k < 3; ++k) {
                const std::uint64_t a = mesh.triangles[t][int(k)], b = mesh.triangles[t][int((k + 1) % 3)];
                all.push_back({std::min(a, b) << 32 | std::max(a, b), t, k});
            }
        std::sort(all.begin(), all.end(), [](const Edge& a, const Edge& b) { return a.vertices < b.vertices; });
        for (std::size_t i = 0; i < all.size(); i += 2) {
            const bool pair = i + 1 < all.size() && all[i].vertices == all[i + 1].vertices &&
                              (i + 2 == all.size() || all[i + 2].vertices != all[i].vertices);
            if (!pair)
                throw std::invalid_argument("an edge is not one of two triangles: pseudonormals need a closed mesh");
            const glm::dvec3 sum = faces[all[i].triangle] + faces[all[i + 1].triangle];
            for (const Edge& edge : {all[i], all[i + 1]}) edges[edge.triangle][edge.side] = sum;
        }
    }
};

// The closest point of a triangle, and the normal there. C. Ericson, "Real-Time Collision Detection" (2005), 5.1.5.
struct Closest {
    glm::dvec3 point;
    const glm::dvec3* normal;
};

class Scatter {
  public:
    Scatter(const Mesh& mesh, const Lattice& lattice, float band)
        : field{lattice, std::vector<float>(lattice.count(), farAway)}, mesh_(mesh), normals_(mesh), band_(band) {}

    // All lengths are in steps until finish().
    void add(std::size_t t) {
        const glm::uvec3& v = mesh_.triangles[t];
        const double perMetre = 1 / double(field.lattice.step);
        const std::array<glm::dvec3, 3> p{glm::dvec3(mesh_.points[v.x]) * perMetre,
                                          glm::dvec3(mesh_.points[v.y]) * perMetre,
                                          glm::dvec3(mesh_.points[v.z]) * perMetre};
        const glm::dvec3 low = glm::min(p[0], glm::min(p[1], p[2])) - band_,
                         high = glm::max(p[0], glm::max(p[1], p[2])) + band_;
        const glm::ivec3 from = glm::max(glm::ivec3(glm::ceil(low)), 0),
                         to = glm::min(glm::ivec3(glm::floor(high)), field.lattice.nodes - 1);
        for (int i = from.x; i <= to.x; ++i)
            for (int j = from.y; j <= to.y; ++j) {
                float* const row = &field.phi[field.lattice.index(i, j, 0)];
                for (int k = from.z; k <= to.z; ++k) measure(t, p, {i, j, k}, row[k]);
            }
    }

    void finish() {
        for (float& phi : field.phi)
            if (phi != farAway) phi *= field.lattice.step;
        scanConvert(field);
    }

    DenseField field;

  private:
    void measure(std::size_t t, const std::array<glm::dvec3, 3>& p, const glm::dvec3& node, float& phi) const {
        const double limit = std::min(band_, double(std::abs(phi)));
        if (std::abs(glm::dot(normals_.faces[t], node - p[0])) >= limit) return;
        const Closest closest = closestPoint(t, p, node);
        const glm::dvec3 away = node - closest.point;
        const double distance2 = glm::dot(away, away);
        if (distance2 < limit * limit)
            phi = float(std::copysign(std::sqrt(distance2), glm::dot(away, *closest.normal)));
    }

    Closest closestPoint(std::size_t t, const std::array<glm::dvec3, 3>& p, const glm::dvec3& node) const {
        const glm::uvec3& v = mesh_.triangles[t];
        const auto& edges = normals_.edges[t];
        const auto vertex = [&](int k) { return Closest{p[k], &normals_.vertices[v[k]]}; };
        const glm::dvec3 ab = p[1] - p[0], ac = p[2] - p[0], a = node - p[0], b = node - p[1], c = node - p[2];
        const double d1 = glm::dot(ab, a), d2 = glm::dot(ac, a);
        if (d1 <= 0 && d2 <= 0) return vertex(0);
        const double d3 = glm::dot(ab, b), d4 = glm::dot(ac, b);
        if (d3 >= 0 && d4 <= d3) return vertex(1);
        const double vc = d1 * d4 - d3 * d2;
        if (vc <= 0 && d1 >= 0 && d3 <= 0) return {p[0] + d1 / (d1 - d3) * ab, &edges[0]};
        const double d5 = glm::dot(ab, c), d6 = glm::dot(ac, c);
        if (d6 >= 0 && d5 <= d6) return vertex(2);
        const double vb = d5 * d2 - d1 * d6;
        if (vb <= 0 && d2 >= 0 && d6 <= 0) return {p[0] + d2 / (d2 - d6) * ac, &edges[2]};
        const double va = d3 * d6 - d5 * d4;
        if (va <= 0 && d4 >= d3 && d5 >= d6)
            return {p[1] + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (p[2] - p[1]), &edges[1]};
        const double sum = va + vb + vc;
        return {p[0] + vb / sum * ab + vc / sum * ac, &normals_.faces[t]};
    }

    const Mesh& mesh_;
    Normals normals_;
    double band_;
};

}  // namespace

DenseField scatterPseudonormal(const Mesh& mesh, const Lattice& lattice, float band) {
    validate(mesh);
    Scatter scatter(mesh, lattice, band);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) scatter.add(t);
    scatter.finish();
    return std::move(scatter.field);
}

}  // namespace bilayer::paper
