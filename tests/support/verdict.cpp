// SPDX-License-Identifier: Apache-2.0
#include "tests/support/verdict.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <random>

#include "sdf/base/openvdb.h"

namespace bilayer::test {
namespace {

constexpr double farFromSurface = 0.1;   // [voxels]: threshold of Verdict::wrongFar
constexpr std::size_t maxWitnesses = 3;  // per kind of fault: enough for a diagnosis
constexpr int margin = 10;               // voxels beyond the band: one leaf plus a few

using Random = std::mt19937_64;

double uniform(Random& random, double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
}

glm::dvec3 randomDirection(Random& random) {
    const double z = uniform(random, -1, 1), angle = uniform(random, 0, 2 * glm::pi<double>());
    const double radius = std::sqrt(1 - z * z);
    return {radius * std::cos(angle), radius * std::sin(angle), z};
}

openvdb::Coord randomIn(const openvdb::CoordBBox& box, Random& random) {
    openvdb::Coord at;
    for (int axis = 0; axis < 3; ++axis)
        at[axis] = std::uniform_int_distribution<int>(box.min()[axis], box.max()[axis])(random);
    return at;
}

openvdb::CoordBBox boxAround(const Mesh& mesh, const Band& band, double voxelSize) {
    const Bounds box = bounds(mesh);
    const int around = int(std::ceil(std::max(band.exterior, band.interior))) + margin;
    openvdb::CoordBBox result;
    for (int axis = 0; axis < 3; ++axis) {
        result.min()[axis] = int(std::floor(double(box.lower[axis]) / voxelSize)) - around;
        result.max()[axis] = int(std::ceil(double(box.upper[axis]) / voxelSize)) + around;
    }
    return result;
}

// Draws voxels for a field; all kinds go into one list.
class Chooser {
  public:
    Chooser(const openvdb::FloatGrid& grid, const Mesh& mesh, const Band& band, unsigned seed)
        : grid_(grid),
          mesh_(mesh),
          band_(band),
          h_(grid.voxelSize()[0]),
          box_(boxAround(mesh, band, h_)),
          random_(seed) {}

    std::vector<openvdb::Coord> choose(std::size_t count) {
        if (box_.volume() <= count) {
            for (auto at = box_.begin(); at; ++at) chosen_.push_back(*at);
            return std::move(chosen_);
        }
        drawActive(count);
        drawInactive(count / 4);
        drawNearTriangles(count / 4);
        for (std::size_t i = 0; i < count / 4; ++i) chosen_.push_back(randomIn(box_, random_));
        std::sort(chosen_.begin(), chosen_.end());
        chosen_.erase(std::unique(chosen_.begin(), chosen_.end()), chosen_.end());
        return std::move(chosen_);
    }

  private:
    // Draws `count` active voxels, or all if there are fewer; and for every fourth one a voxel just beyond the band.
    void drawActive(std::size_t count) {
        const double part = double(count) / double(grid_.activeVoxelCount());
        for (auto voxel = grid_.cbeginValueOn(); voxel; ++voxel)
            if (part >= 1 || uniform(random_, 0, 1) < part) {
                chosen_.push_back(voxel.getCoord());
                if (random_() % 4 == 0) chosen_.push_back(beyondBand(voxel.getCoord()));
            }
    }

    // Draws inactive voxels among the active ones; fewer if almost none is inactive.
    void drawInactive(std::size_t count) {
        std::vector<const openvdb::FloatTree::LeafNodeType*> leaves;
        grid_.tree().getNodes(leaves);
        if (leaves.empty()) return;
        std::uniform_int_distribution<std::size_t> anyLeaf(0, leaves.size() - 1);
        std::uniform_int_distribution<openvdb::Index> anyVoxel(0, openvdb::FloatTree::LeafNodeType::SIZE - 1);
        for (std::size_t draw = 0; draw < 4 * count && count > 0; ++draw) {
            const auto& leaf = *leaves[anyLeaf(random_)];
            const openvdb::Index voxel = anyVoxel(random_);
            if (leaf.isValueOn(voxel)) continue;
            chosen_.push_back(leaf.offsetToGlobalCoord(voxel));
            --count;
        }
    }

    // The first inactive voxel along an axis from here.
    openvdb::Coord beyondBand(openvdb::Coord at) {
        const auto values = grid_.getConstAccessor();
        const int axis = int(random_() % 3), step = random_() % 2 ? 1 : -1;
        while (values.isValueOn(at)) at[axis] += step;
        return at;
    }

    // Draws voxels about a band's width from points of the surface, and voxels next to it. Each triangle gets the same
    // count, because small triangles mark intricate shapes.
    void drawNearTriangles(std::size_t count) {
        std::uniform_int_distribution<std::size_t> anyTriangle(0, mesh_.triangles.size() - 1);
        for (std::size_t i = 0; i < count; ++i) {
            const glm::uvec3 t = mesh_.triangles[anyTriangle(random_)];
            const glm::dvec3 a(mesh_.points[t.x]), b(mesh_.points[t.y]), c(mesh_.points[t.z]);
            const double u = std::sqrt(uniform(random_, 0, 1)), v = uniform(random_, 0, 1);
            const glm::dvec3 normal = glm::cross(b - a, c - a);
            const bool straight = i % 2 == 0 && glm::length(normal) > 0;
            const glm::dvec3 direction = straight ? glm::normalize(normal) : randomDirection(random_);
            const double side = std::array{band_.exterior, -band_.interior, 0.0}[i % 3];
            const glm::dvec3 p =
                ((1 - u) * a + u * (1 - v) * b + u * v * c) / h_ + (side + uniform(random_, -1.5, 1.5)) * direction;
            chosen_.push_back(openvdb::Coord::round(openvdb::Vec3d(p.x, p.y, p.z)));
        }
    }

    const openvdb::FloatGrid& grid_;
    const Mesh& mesh_;
    Band band_;
    double h_;  // [m]
    openvdb::CoordBBox box_;
    Random random_;
    std::vector<openvdb::Coord> chosen_;
};

const char* name(Fault fault) {
    switch (fault) {
        case Fault::distance:
            return "distance";
        case Fault::sign:
            return "sign";
        case Fault::background:
            return "background";
        case Fault::missing:
            return "missing";
        case Fault::extra:
            return "extra";
    }
    return "";
}

// Counts faults, and keeps some of each kind.
struct Counter {
    Verdict& verdict;
    Witness witness;

    void add(Fault fault, std::size_t& count) {
        witness.fault = fault;
        if (++count <= maxWitnesses) verdict.witnesses.push_back(witness);
    }
};

void judgeVoxel(Verdict& verdict, const Band& band, const Witness& voxel) {
    Counter faults{verdict, voxel};
    const double away = std::abs(voxel.truth);
    const double beyond = away - (voxel.truth < 0 ? band.interior : band.exterior);
    const bool wrong = (voxel.value < 0) != (voxel.truth < 0) && away > exactness;
    ++verdict.checked;
    verdict.active += voxel.active;
    if (!voxel.active) {
        if (beyond < -exactness) faults.add(Fault::missing, verdict.missing);
        if (wrong) faults.add(Fault::background, verdict.wrongBackground);
        return;
    }
    const double error = std::abs(std::abs(voxel.value) - away);
    verdict.worst = std::max(verdict.worst, error);
    verdict.wrongFar += wrong && away > farFromSurface;
    if (!(error <= exactness)) faults.add(Fault::distance, verdict.inexact);
    if (wrong) faults.add(Fault::sign, verdict.wrong);
    if (beyond > exactness) faults.add(Fault::extra, verdict.extra);
}

}  // namespace

std::string Witness::text() const {
    return fmt::format("{} at ({}, {}, {}): {} voxel says {:.6f}, truth is {:.6f}", name(fault), at.x(), at.y(), at.z(),
                       active ? "active" : "inactive", value, truth);
}

Verdict& Verdict::operator+=(const Verdict& other) {
    checked += other.checked;
    active += other.active;
    worst = std::max(worst, other.worst);
    inexact += other.inexact;
    wrong += other.wrong;
    wrongFar += other.wrongFar;
    wrongBackground += other.wrongBackground;
    missing += other.missing;
    extra += other.extra;
    witnesses.insert(witnesses.end(), other.witnesses.begin(), other.witnesses.end());
    return *this;
}

std::vector<openvdb::Coord> chooseVoxels(const openvdb::FloatGrid& grid, const Mesh& mesh, const Band& band,
                                         std::size_t count, unsigned seed) {
    return Chooser(grid, mesh, band, seed).choose(count);
}

std::vector<TrueVoxel> trueVoxels(const Truth& truth, const std::vector<openvdb::Coord>& voxels, double voxelSize) {
    std::vector<TrueVoxel> result(voxels.size());
    tbb::parallel_for(std::size_t(0), voxels.size(), [&](std::size_t i) {
        const glm::dvec3 index(voxels[i].x(), voxels[i].y(), voxels[i].z());
        result[i] = {voxels[i], truth.signedDistance(voxelSize * index) / voxelSize};
    });
    return result;
}

Verdict judge(const openvdb::FloatGrid& grid, const Band& band, const std::vector<TrueVoxel>& voxels, Signs signs) {
    const auto values = grid.getConstAccessor();
    const double h = grid.voxelSize()[0];
    Verdict verdict;
    for (const TrueVoxel& voxel : voxels) {
        float value = 0;
        const bool active = values.probeValue(voxel.at, value);
        Witness witness{Fault::distance, voxel.at, double(value) / h, voxel.distance, active};
        if (signs == Signs::ignored) {
            witness.value = std::abs(witness.value);
            witness.truth = std::abs(witness.truth);
        }
        judgeVoxel(verdict, band, witness);
    }
    return verdict;
}

}  // namespace bilayer::test
