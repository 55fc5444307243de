// SPDX-License-Identifier: Apache-2.0
#include "bench/paper/dense.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace bilayer::paper {
namespace {

// Sections 3.1 and 3.2: both layers, as squared distances.
class Layers {
  public:
    Layers(const Lattice& lattice, const DenseOptions& options)
        : inner(lattice.count(), farAway),
          outer(lattice.count(), farAway),
          lattice_(lattice),
          options_(options),
          delta_(double(options.delta) * double(lattice.step)),
          epsilon_(double(options.epsilon) * double(lattice.step) * double(lattice.step)) {}

    // Positions are double until they are rounded to nodes, so that the subdivision of a triangle does not depend on
    // rounding.
    void add(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
        const glm::dvec3 cross = glm::cross(b - a, c - a);
        const double length = glm::length(cross), area = length / 2;
        if (!(length > 0)) return;
        offset_ = glm::vec3(cross * (delta_ / length));
        const std::size_t before = samples;
        if (options_.subdivision == Subdivision::rows)
            rows(a, b, c, area);
        else
            recurse(a, b, c, area);
        most = std::max(most, samples - before);
    }

    std::vector<float> inner, outer;  // D_I and D_E, squared
    std::size_t samples = 0, most = 0;

  private:
    // Algorithm 1.
    void rows(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, double area) {
        const int n = std::min(std::max(1, int(std::ceil(std::sqrt(area / epsilon_)))), options_.maxSubdivision);
        const glm::dvec3 s1 = (b - a) / double(n), s2 = (c - b) / double(n), s3 = (c - a) / double(n);
        glm::dvec3 start = a + (s1 + s3) / 3.0;
        choose(start);
        for (int i = 2; i <= n; ++i) {
            start += s1;
            choose(start);
            glm::dvec3 p = start;
            for (int j = 2; j <= i; ++j) {
                p += s2;
                choose(p);
            }
        }
    }

    // Fig. 2.
    void recurse(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, double area) {
        if (area <= epsilon_) return choose((a + b + c) / 3.0);
        if (area <= 2 * epsilon_) return halve(a, b, c, area);
        const glm::dvec3 m = (a + b) / 2.0, n = (b + c) / 2.0, p = (c + a) / 2.0;
        recurse(a, m, p, area / 4);
        recurse(b, n, m, area / 4);
        recurse(c, p, n, area / 4);
        recurse(m, n, p, area / 4);
    }

    void halve(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, double area) {
        const double ab = glm::length(b - a), bc = glm::length(c - b), ca = glm::length(a - c);
        if (bc > ab && bc >= ca) return halve(b, c, a, area);
        if (ca > ab && ca > bc) return halve(c, a, b, area);
        const glm::dvec3 m = (a + b) / 2.0;
        recurse(a, m, c, area / 2);
        recurse(m, b, c, area / 2);
    }

    // Eq. 2, and the (2K + 1)^3 nodes around the sample.
    void choose(const glm::dvec3& place) {
        const glm::vec3 p(place);
        ++samples;
        const glm::ivec3 nearest(glm::floor(p / lattice_.step + options_.half));
        const glm::ivec3 from = glm::max(nearest - options_.neighbourhood, 0),
                         to = glm::min(nearest + options_.neighbourhood, lattice_.nodes - 1);
        if (options_.shareRows) {
            updateRows(inner, p - offset_, from, to);
            updateRows(outer, p + offset_, from, to);
        } else {
            updateNodes(inner, p - offset_, from, to);
            updateNodes(outer, p + offset_, from, to);
        }
    }

    void updateNodes(std::vector<float>& grid, const glm::vec3& p, const glm::ivec3& from, const glm::ivec3& to) const {
        for (int i = from.x; i <= to.x; ++i)
            for (int j = from.y; j <= to.y; ++j)
                for (int k = from.z; k <= to.z; ++k) {
                    const glm::vec3 d = glm::vec3(i, j, k) * lattice_.step - p;
                    float& best = grid[lattice_.index(i, j, k)];
                    best = std::min(best, d.x * d.x + d.y * d.y + d.z * d.z);
                }
    }

    // Section 4.2: N^3 + N^2 + N products instead of 3 N^3.
    void updateRows(std::vector<float>& grid, const glm::vec3& p, const glm::ivec3& from, const glm::ivec3& to) const {
        for (int i = from.x; i <= to.x; ++i) {
            const float dx = float(i) * lattice_.step - p.x, x2 = dx * dx;
            for (int j = from.y; j <= to.y; ++j) {
                const float dy = float(j) * lattice_.step - p.y, xy2 = x2 + dy * dy;
                float* const row = &grid[lattice_.index(i, j, 0)];
                for (int k = from.z; k <= to.z; ++k) {
                    const float dz = float(k) * lattice_.step - p.z;
                    row[k] = std::min(row[k], xy2 + dz * dz);
                }
            }
        }
    }

    const Lattice& lattice_;
    const DenseOptions& options_;
    double delta_, epsilon_;
    glm::vec3 offset_{0};  // delta times the outward normal
};

}  // namespace

DenseField denseDoubleLayer(const Mesh& mesh, const Lattice& lattice, const DenseOptions& options) {
    validate(mesh);
    Layers layers(lattice, options);
    for (const glm::uvec3& t : mesh.triangles) layers.add(mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]);
    const float delta = options.delta * lattice.step;
    std::vector<float>& phi = layers.outer;  // reuses its memory (section 4.2)
    for (std::size_t i = 0; i < phi.size(); ++i) {
        const float inner2 = layers.inner[i], outer2 = layers.outer[i];
        if (inner2 == farAway || outer2 == farAway)
            phi[i] = farAway;
        else
            phi[i] = inner2 <= outer2 ? std::min(0.f, delta - std::sqrt(outer2))
                                      : std::max(0.f, std::sqrt(inner2) - delta);  // Eq. 3
    }
    DenseField field{lattice, std::move(phi), layers.samples, layers.most};
    scanConvert(field);
    return field;
}

void scanConvert(DenseField& field) {
    const Lattice& lattice = field.lattice;
    for (int i = 0; i < lattice.nodes.x; ++i)
        for (int j = 0; j < lattice.nodes.y; ++j) {
            float* const row = &field.phi[lattice.index(i, j, 0)];
            for (int k = 0; k + 1 < lattice.nodes.z; ++k)
                if (row[k] < 0 && row[k + 1] == farAway) row[k + 1] = -farAway;
        }
}

}  // namespace bilayer::paper
