// SPDX-License-Identifier: Apache-2.0
#include "bench/rivals.h"

#include <BulletCollision/CollisionShapes/btBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btCompoundShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btMiniSDF.h>
#include <BulletCollision/CollisionShapes/btSdfCollisionShape.h>
#include <BulletCollision/CollisionShapes/btTriangleIndexVertexArray.h>
#include <BulletCollision/Gimpact/btGImpactCollisionAlgorithm.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>
#include <fmt/format.h>
#include <hacdHACD.h>
#include <oneapi/tbb/parallel_for.h>

#include <array>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <stdexcept>
#include <vector>

#include <bilayer/integration/bullet/dispatcher.h>
#include <bilayer/integration/bullet/shape.h>
#include <bilayer/sdf/build.h>
#include "bench/measure.h"
#include "demos/shared/exact_distance.h"

namespace bilayer::bench {
namespace {

constexpr float bandInside = 6;       // of our fields [voxels]
constexpr int maxHullPoints = 64;     // of a hull
constexpr double anyConcavity = 1e9;  // disables the limit of concavity: only the count of hulls matters

class Field : public Rival {
  public:
    Field(const Mesh& mesh, float voxels, const PointSampler& sampler, ContactAccuracy accuracy)
        : sampler_(sampler),
          name_(sampler                                          ? "bilayer, " + sampler.device()
                : accuracy == ContactAccuracy::exactNearFeatures ? "bilayer"
                : accuracy == ContactAccuracy::exact             ? "bilayer, by triangles"
                                                                 : "bilayer, by samples") {
        BuildOptions how{.voxelSize = voxelSizeFor(mesh, voxels)};
        how.interiorWidthVoxels = bandInside;
        const ColliderOptions options{.accuracy = accuracy};
        shape_ = std::make_unique<bullet::Shape>(std::make_shared<Collider>(mesh, build(mesh, how), options));
    }
    std::string name() const override { return name_; }
    btCollisionShape& shape() override { return *shape_; }
    std::unique_ptr<btCollisionDispatcher> dispatcher(btCollisionConfiguration& configuration) const override {
        return std::make_unique<bullet::Dispatcher>(&configuration, sampler_);
    }

  private:
    PointSampler sampler_;
    std::string name_;
    std::unique_ptr<bullet::Shape> shape_;
};

// A mesh as Bullet's interface, which keeps pointers to it.
class TriangleArray {
  public:
    explicit TriangleArray(const Mesh& mesh) : mesh_(mesh) {
        btIndexedMesh part;
        part.m_numTriangles = int(mesh_.triangles.size());
        part.m_triangleIndexBase = reinterpret_cast<const unsigned char*>(mesh_.triangles.data());
        part.m_triangleIndexStride = sizeof(glm::uvec3);
        part.m_numVertices = int(mesh_.points.size());
        part.m_vertexBase = reinterpret_cast<const unsigned char*>(mesh_.points.data());
        part.m_vertexStride = sizeof(glm::vec3);
        array_.addIndexedMesh(part, PHY_INTEGER);
    }
    btStridingMeshInterface* get() { return &array_; }

  private:
    const Mesh mesh_;
    btTriangleIndexVertexArray array_;
};

class GImpact : public Rival {
  public:
    GImpact(const Mesh& mesh, float margin) : triangles_(mesh), shape_(triangles_.get()) {
        shape_.setMargin(margin);
        shape_.updateBound();
    }
    std::string name() const override { return "GImpact"; }
    btCollisionShape& shape() override { return shape_; }
    std::unique_ptr<btCollisionDispatcher> dispatcher(btCollisionConfiguration& configuration) const override {
        auto made = Rival::dispatcher(configuration);
        btGImpactCollisionAlgorithm::registerAlgorithm(made.get());
        return made;
    }

  private:
    TriangleArray triangles_;
    btGImpactMeshShape shape_;
};

class Triangles : public Rival {
  public:
    Triangles(const Mesh& mesh, float margin) : triangles_(mesh), shape_(triangles_.get(), true) {
        shape_.setMargin(margin);
    }
    std::string name() const override { return "btBvhTriangleMesh"; }
    btCollisionShape& shape() override { return shape_; }

  private:
    TriangleArray triangles_;
    btBvhTriangleMeshShape shape_;
};

class Hulls : public Rival {
  public:
    Hulls(const Mesh& mesh, int hulls, float margin) {
        std::vector<HACD::Vec3<HACD::Real>> points;
        std::vector<HACD::Vec3<long>> triangles;
        for (const glm::vec3& p : mesh.points) points.emplace_back(p.x, p.y, p.z);
        for (const glm::uvec3& t : mesh.triangles) triangles.emplace_back(long(t.x), long(t.y), long(t.z));
        HACD::HACD division;
        division.SetPoints(points.data());
        division.SetNPoints(points.size());
        division.SetTriangles(triangles.data());
        division.SetNTriangles(triangles.size());
        division.SetNClusters(std::size_t(hulls));
        division.SetConcavity(anyConcavity);
        division.SetNVerticesPerCH(maxHullPoints);
        division.Compute();
        for (std::size_t i = 0; i < division.GetNClusters(); ++i) add(division, i, margin);
        if (hulls_.empty()) throw std::runtime_error("HACD found no hull");
    }
    std::string name() const override { return std::to_string(hulls_.size()) + " hulls"; }
    btCollisionShape& shape() override { return compound_; }

  private:
    void add(HACD::HACD& division, std::size_t i, float margin) {
        std::vector<HACD::Vec3<HACD::Real>> points(division.GetNPointsCH(i));
        std::vector<HACD::Vec3<long>> triangles(division.GetNTrianglesCH(i));
        if (points.empty()) return;
        division.GetCH(i, points.data(), triangles.data());
        auto hull = std::make_unique<btConvexHullShape>();
        for (const auto& p : points) hull->addPoint(btVector3(float(p.X()), float(p.Y()), float(p.Z())), false);
        hull->setMargin(margin);
        hull->recalcLocalAabb();
        compound_.addChildShape(btTransform::getIdentity(), hull.get());
        hulls_.push_back(std::move(hull));
    }

    std::vector<std::unique_ptr<btConvexHullShape>> hulls_;
    btCompoundShape compound_;
};

// The nodes of a cell of btMiniSDF within [-1, 1]^3, in its order: node n is where the n-th shape function is 1.
constexpr int nodesOfCell = 32;

std::array<glm::dvec3, nodesOfCell> nodePlaces() {
    std::vector<glm::dvec3> places;  // the vertices, and two nodes on each edge
    for (const double x : {-1., 1.})
        for (const double y : {-1., 1.}) {
            for (const double z : {-1., 1.}) places.push_back({x, y, z});
            for (const double third : {-1. / 3, 1. / 3})
                for (const glm::dvec3& place : {glm::dvec3(third, x, y), {x, third, y}, {x, y, third}})
                    places.push_back(place);
        }
    btMiniSDF functions;
    functions.m_isValid = true;
    std::array<glm::dvec3, nodesOfCell> nodes{};
    for (const glm::dvec3& place : places) {
        const btShapeMatrix values =
            functions.shape_function_(btVector3(float(place.x), float(place.y), float(place.z)), nullptr);
        for (int i = 0; i < nodesOfCell; ++i)
            if (std::abs(values[i] - 1) < 1e-3) nodes[std::size_t(i)] = place;
    }
    return nodes;
}

// Writes the bytes that btMiniSDF::load() reads.
class SdfBytes {
  public:
    template <class Value>
    void add(const Value& value) {
        const std::size_t at = bytes_.size();
        bytes_.resize(at + sizeof value);
        std::memcpy(bytes_.data() + at, &value, sizeof value);
    }
    void addCount(std::size_t count) { add(std::uint64_t(count)); }
    const std::vector<char>& all() const { return bytes_; }

  private:
    std::vector<char> bytes_;
};

std::vector<char> sdfOf(const Mesh& mesh, int cells) {
    const Bounds box = bounds(mesh);
    const double cell = double(box.longestSide()) / cells;
    const glm::dvec3 lower = glm::dvec3(box.lower) - cell;
    const glm::uvec3 count(glm::ceil((glm::dvec3(box.upper) - lower) / cell) + 1.);
    const std::size_t all = std::size_t(count.x) * count.y * count.z;
    const auto nodes = nodePlaces();
    const demo::ExactDistance distance(mesh);
    std::vector<double> values(all * nodesOfCell);
    tbb::parallel_for(std::size_t(0), all, [&](std::size_t i) {
        const glm::dvec3 at(double(i % count.x), double(i / count.x % count.y), double(i / count.x / count.y));
        for (std::size_t k = 0; k < nodesOfCell; ++k)
            values[i * nodesOfCell + k] = distance(lower + cell * (at + 0.5 * (nodes[k] + 1.)));
    });
    SdfBytes bytes;
    const glm::dvec3 upper = lower + cell * glm::dvec3(count), size(cell), inverse(1 / cell);
    for (const glm::dvec3& corner : {lower, upper}) bytes.add(corner);
    bytes.add(count);
    bytes.add(size);
    bytes.add(inverse);
    bytes.addCount(all);
    bytes.addCount(1);  // count of fields
    bytes.addCount(1);
    bytes.addCount(values.size());
    for (const double value : values) bytes.add(value);
    bytes.addCount(1);
    bytes.addCount(all);
    for (std::uint32_t i = 0; i < all * nodesOfCell; ++i) bytes.add(i);
    bytes.addCount(1);
    bytes.addCount(all);
    for (std::uint32_t i = 0; i < all; ++i) bytes.add(i);
    return bytes.all();
}

class BulletSdf : public Rival {
  public:
    BulletSdf(const Mesh& mesh, int cells) {
        const std::vector<char> bytes = sdfOf(mesh, cells);
        if (!shape_.initializeSDF(bytes.data(), int(bytes.size())))
            throw std::runtime_error("btSdfCollisionShape does not take the field");
    }
    std::string name() const override { return "btSdfCollisionShape"; }
    btCollisionShape& shape() override { return shape_; }

  private:
    btSdfCollisionShape shape_;
};

template <class Made, class... Arguments>
std::unique_ptr<Rival> timed(const Arguments&... arguments) {
    const Stopwatch watch;
    auto made = std::make_unique<Made>(arguments...);
    made->seconds = watch.seconds();
    return made;
}

}  // namespace

std::unique_ptr<btCollisionDispatcher> Rival::dispatcher(btCollisionConfiguration& configuration) const {
    return std::make_unique<btCollisionDispatcher>(&configuration);
}

std::unique_ptr<Rival> makeField(const Mesh& mesh, float voxels, const PointSampler& sampler,
                                 ContactAccuracy accuracy) {
    return timed<Field>(mesh, voxels, sampler, accuracy);
}

std::unique_ptr<Rival> makeGImpact(const Mesh& mesh, float margin) {
    return timed<GImpact>(mesh, margin);
}

std::unique_ptr<Rival> makeHulls(const Mesh& mesh, int hulls, float margin) {
    return timed<Hulls>(mesh, hulls, margin);
}

std::unique_ptr<Rival> makeTriangles(const Mesh& mesh, float margin) {
    return timed<Triangles>(mesh, margin);
}

std::unique_ptr<Rival> makeBulletSdf(const Mesh& mesh, int cells) {
    return timed<BulletSdf>(mesh, cells);
}

}  // namespace bilayer::bench
