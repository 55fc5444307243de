// SPDX-License-Identifier: Apache-2.0
// The block-wise method against the paper's program: a dense grid, sample by sample, in plain loops.
#include "sdf/fill/double_layer.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <map>
#include <tuple>
#include <vector>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/fill/layer_samples.h"
#include "tests/support/support.h"
#include "tests/support/tiles.h"

namespace bilayer::double_layer_test {
using namespace bilayer::detail;

namespace {

constexpr float infinite = std::numeric_limits<float>::infinity();

// Eq. 1 to 3 over a dense grid. K < 0: every sample reaches every voxel.
class Dense {
  public:
    Dense(const Mesh& mesh, const BuildOptions& options, int k) : delta_(options.doubleLayer.delta) {
        const Bounds box = bounds(mesh);
        const float margin = std::max(options.exteriorWidthVoxels, options.interiorWidthVoxels) + 3;
        lower_ = glm::ivec3(glm::floor(box.lower / options.voxelSize - margin));
        size_ = glm::ivec3(glm::ceil(box.upper / options.voxelSize + margin)) - lower_ + 1;
        inner2_.assign(std::size_t(size_.x) * size_.y * size_.z, infinite);
        outer2_ = inner2_;
        innerOwner_.assign(inner2_.size(), -1);
        outerOwner_ = innerOwner_;
        const Tiles tiles = makeTiles(mesh, options);
        for (std::size_t t = 0; t < tiles.tiles.size(); ++t) {
            const Tile& tile = tiles.tiles[t];
            for (int i = 0; i < tile.rows; ++i)
                for (int j = 0; j <= i; ++j)
                    apply(tile, tile.first + float(i) * tile.down + float(j) * tile.across, tiles.triangles[t], k);
        }
    }

    // Signed distance in voxels; infinite where a layer is.
    float phi(const glm::ivec3& v) const {
        const std::size_t i = index(v);
        if (inner2_[i] == infinite || outer2_[i] == infinite) return infinite;
        return inner2_[i] <= outer2_[i] ? -std::max(0.f, std::sqrt(outer2_[i]) - delta_)
                                        : std::max(0.f, std::sqrt(inner2_[i]) - delta_);
    }
    // Both layers are equally near, up to rounding: either sign is valid.
    bool tie(const glm::ivec3& v) const {
        const std::size_t i = index(v);
        return std::abs(inner2_[i] - outer2_[i]) <= 2 * layerTie + 1e-5f * inner2_[i];
    }
    std::int32_t owner(const glm::ivec3& v) const {
        const std::size_t i = index(v);
        return inner2_[i] <= outer2_[i] ? outerOwner_[i] : innerOwner_[i];
    }

    template <class Visit>
    void forEachVoxel(Visit visit) const {
        for (int x = 0; x < size_.x; ++x)
            for (int y = 0; y < size_.y; ++y)
                for (int z = 0; z < size_.z; ++z) visit(lower_ + glm::ivec3(x, y, z));
    }

  private:
    void apply(const Tile& tile, const glm::vec3& p, std::int32_t owner, int k) {
        const glm::ivec3 nearest = tile.base + glm::ivec3(LayerSamples::nearestLattice(p));
        glm::ivec3 from = lower_, to = lower_ + size_ - 1;
        if (k >= 0) {
            from = glm::max(from, nearest - k);
            to = glm::min(to, nearest + k);
        }
        const glm::vec3 inner = p - tile.offset, outer = p + tile.offset;
        for (int x = from.x; x <= to.x; ++x)
            for (int y = from.y; y <= to.y; ++y)
                for (int z = from.z; z <= to.z; ++z) {
                    const glm::vec3 v(glm::ivec3(x, y, z) - tile.base);
                    update(inner2_, innerOwner_, index({x, y, z}), v - inner, owner);
                    update(outer2_, outerOwner_, index({x, y, z}), v - outer, owner);
                }
    }
    static void update(std::vector<float>& best, std::vector<std::int32_t>& owners, std::size_t i, const glm::vec3& d,
                       std::int32_t owner) {
        const float distance2 = d.x * d.x + d.y * d.y + d.z * d.z;
        if (distance2 < best[i]) {
            best[i] = distance2;
            owners[i] = owner;
        }
    }
    std::size_t index(const glm::ivec3& v) const {
        const glm::ivec3 at = v - lower_;
        return (std::size_t(at.x) * size_.y + at.y) * size_.z + at.z;
    }

    float delta_;
    glm::ivec3 lower_, size_;
    std::vector<float> inner2_, outer2_;
    std::vector<std::int32_t> innerOwner_, outerOwner_;
};

/// Squared distances are summed in another order, from another origin: a few units in the last place of 100 voxels^2.
constexpr float rounding = 2e-5f;

BuildOptions layered(BuildOptions options) {
    options.method = Method::doubleLayer;
    return options;
}

void compare(const Mesh& mesh, const BuildOptions& options, int k) {
    const Dense dense(mesh, options, k);
    const LevelSet field = build(mesh, layered(options));
    const auto values = field.grids().distance->getConstAccessor();
    std::size_t active = 0, missing = 0, extra = 0;
    float worst = 0;
    dense.forEachVoxel([&](const glm::ivec3& v) {
        const openvdb::Coord at(v.x, v.y, v.z);
        const float phi = dense.phi(v);
        const bool inBand = phi < options.exteriorWidthVoxels && phi > -options.interiorWidthVoxels;
        const float edge =
            std::min(std::abs(phi - options.exteriorWidthVoxels), std::abs(phi + options.interiorWidthVoxels));
        active += values.isValueOn(at);
        if (dense.tie(v)) return;
        if (values.isValueOn(at) && inBand)
            worst = std::max(worst, std::abs(values.getValue(at) / options.voxelSize - phi));
        else if (edge > rounding) {
            missing += inBand;
            extra += values.isValueOn(at);
        }
    });
    CAPTURE(options.exteriorWidthVoxels, options.interiorWidthVoxels, k, active);
    CHECK(missing == 0);
    CHECK(extra == 0);
    CHECK(worst < rounding);
    CHECK(active == field.activeVoxels());  // no active voxel lies outside the dense grid
}

}  // namespace

TEST_CASE("in the band, a voxel has the distance that all samples together give it") {
    const Mesh knot = shapes::torusKnot(2, 3, 5, 1, 150, 12), box = shapes::box({6, 4, 2});
    for (const float width : {0.5f, 1.f, 2.f, 3.f, 3.499f, 7.f}) {  // 3.499: cells end at the same place as samples
        compare(knot, {.voxelSize = 0.5f, .exteriorWidthVoxels = width, .interiorWidthVoxels = width}, -1);
        compare(box, {.voxelSize = 0.31f, .exteriorWidthVoxels = width, .interiorWidthVoxels = width}, -1);
    }
    compare(knot, {.voxelSize = 0.5f, .exteriorWidthVoxels = 5, .interiorWidthVoxels = 1}, -1);
    compare(knot, {.voxelSize = 0.5f, .exteriorWidthVoxels = 0.75f, .interiorWidthVoxels = 4}, -1);
}

TEST_CASE("other parameters of the method are obeyed") {
    const Mesh knot = shapes::torusKnot(2, 3, 5, 1, 150, 12);
    BuildOptions options{.voxelSize = 0.4f};
    options.doubleLayer = {.delta = 1.f, .epsilon = 0.25f, .maxSubdivision = 2};
    compare(knot, options, -1);
    options.doubleLayer = {.delta = 0.1f, .epsilon = 4.f, .neighbourhood = 5, .subdivision = Subdivision::recursive};
    compare(knot, options, -1);
}

TEST_CASE("to the letter, the field is the paper's: a cube of (2K + 1)^3 voxels around each sample") {
    const Mesh knot = shapes::torusKnot(2, 3, 5, 1, 150, 12), box = shapes::box({6, 4, 2});
    for (int k = 1; k <= 3; ++k)
        for (const Subdivision subdivision : {Subdivision::rows, Subdivision::recursive}) {
            BuildOptions options{.voxelSize = 0.3f};
            options.doubleLayer.neighbourhood = k;
            options.doubleLayer.fillGaps = false;
            options.doubleLayer.maxSubdivision = 16;
            options.doubleLayer.subdivision = subdivision;
            compare(knot, options, k);
            compare(box, options, k);
        }
}

TEST_CASE("the triangle of a voxel is the owner of the sample that decides its distance") {
    const Mesh mesh = shapes::torusKnot(2, 3, 5, 1, 150, 12);
    const BuildOptions options{.voxelSize = 0.5f, .triangles = true};
    const Dense dense(mesh, options, -1);
    const LevelSet field = build(mesh, layered(options));
    REQUIRE(field.grids().triangle);
    CHECK(field.grids().triangle->activeVoxelCount() == field.activeVoxels());
    std::size_t differ = 0, count = 0;
    for (auto voxel = field.grids().triangle->cbeginValueOn(); voxel; ++voxel) {
        const openvdb::Coord at = voxel.getCoord();
        REQUIRE(voxel.getValue() >= 0);
        REQUIRE(voxel.getValue() < int(mesh.triangles.size()));
        differ += voxel.getValue() != dense.owner({at.x(), at.y(), at.z()});
        ++count;
    }
    // samples of two triangles that are equally far up to rounding may swap
    CAPTURE(differ, count);
    CHECK(double(differ) < 1e-3 * double(count));
}

// If only the outer layer is near enough to be known, it is the nearer one, by however little.
TEST_CASE("beyond the band, voxels lie on the side that exact distances give them") {
    const auto onWrongSide = [](const Mesh& mesh, BuildOptions options) {
        options.exteriorWidthVoxels = options.interiorWidthVoxels = 2;
        const LevelSet layers = build(mesh, layered(options));
        options.exteriorWidthVoxels = options.interiorWidthVoxels = 4;
        const LevelSet exact = build(mesh, options);
        const auto values = layers.grids().distance->getConstAccessor();
        std::size_t wrong = 0;
        for (auto voxel = exact.grids().distance->cbeginValueOn(); voxel; ++voxel)
            wrong +=
                std::abs(*voxel) > 2 * options.voxelSize && (*voxel < 0) != (values.getValue(voxel.getCoord()) < 0);
        return wrong;
    };
    const glm::mat4 rotation = glm::rotate(glm::mat4(1), 0.7f, glm::vec3(1, 2, 0.5f));
    const Mesh sphere = transformed(shapes::unevenSphere(0.0013f), rotation);
    BuildOptions options{.voxelSize = voxelSizeFor(sphere, 200)};
    options.doubleLayer.epsilon = 0.25f;
    options.doubleLayer.delta = 0.1f;
    CHECK(onWrongSide(sphere, options) == 0);
    if (const auto path = test::corpusMesh("bunny_watertight.obj")) {
        const Mesh bunny = readMesh(*path);
        CHECK(onWrongSide(bunny, {.voxelSize = voxelSizeFor(bunny, 715)}) == 0);
    }
}

TEST_CASE("a triangle whose area floats cannot hold changes nothing but what is at it") {
    Mesh mesh = shapes::sphere(1, 5);  // several triangles a voxel
    const BuildOptions options = layered({.voxelSize = 0.15f});
    const LevelSet before = build(mesh, options);
    const auto first = unsigned(mesh.points.size());
    for (const glm::vec3& p : {glm::vec3(0, 0, 0), glm::vec3(1e-25f, 0, 0), glm::vec3(0, 1e-25f, 0)})
        mesh.points.push_back(p + glm::vec3(0, 0, 1e-20f));
    mesh.triangles.push_back({first, first + 1, first + 2});
    const LevelSet after = build(mesh, options);
    const auto values = after.grids().distance->getConstAccessor();
    std::size_t changed = 0, count = 0;
    for (auto voxel = before.grids().distance->cbeginValueOn(); voxel; ++voxel, ++count)
        if (voxel.getCoord().asVec3d().length() > 5) changed += values.getValue(voxel.getCoord()) != *voxel;
    CHECK(count > 500);
    CHECK(changed == 0);
    CHECK(values.getValue(openvdb::Coord(0)) > -0.5f * options.voxelSize);  // so it has a sample too
}
}  // namespace bilayer::double_layer_test
