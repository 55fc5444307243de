// Bodies as metadata of the distance grid and a grid of OpenVDB points.
#include "collider/body.h"

#include <fmt/format.h>
#include <openvdb/points/PointAttribute.h>
#include <openvdb/points/PointConversion.h>
#include <openvdb/points/PointDataGrid.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "sdf/grids.h"

namespace bilayer {
namespace {

using openvdb::Vec3s;
using Points = openvdb::points::PointDataGrid;

constexpr std::int32_t format = 1;       // grows when an older reader would get it wrong
constexpr double pointCell = 4;          // edge of a voxel of points, at least [voxels of the field]: holds a few
constexpr float unitError = 1e-4f;       // of what ought to have unit length; single precision leaves 1e-7
constexpr float boundsError = 1e-5f;     // of points outside of the bounds, in parts of their size
constexpr double fieldBesideMesh = 1.5;  // what of a mesh may lie outside of its field's box [voxels]

namespace entry {
constexpr const char* format = "bilayer:body";
constexpr const char* margin = "bilayer:margin";
constexpr const char* lower = "bilayer:bounds_lower";
constexpr const char* upper = "bilayer:bounds_upper";
constexpr const char* volume = "bilayer:volume";
constexpr const char* centre = "bilayer:centre_of_mass";
constexpr const char* inertia = "bilayer:inertia";            // xx yy zz, density 1
constexpr const char* products = "bilayer:inertia_products";  // xy xz yz
constexpr const char* principal = "bilayer:principal_inertia";
constexpr const char* axes = "bilayer:principal_axes";  // a quaternion, x y z w
constexpr const char* mesh = "bilayer:mesh";            // bytes: see packed()
constexpr const char* measure = "bilayer:measure";
}  // namespace entry

// Names that other programs give such attributes, too.
namespace attribute {
constexpr const char* position = "P";
constexpr const char* normal = "N";
constexpr const char* feature = "id";
constexpr const char* sharp = "sharp";
}  // namespace attribute

Vec3s toVdb(const glm::vec3& v) {
    return {v.x, v.y, v.z};
}

glm::vec3 toGlm(const Vec3s& v) {
    return {v.x(), v.y(), v.z()};
}

// The edge of a voxel of points is a power of two: then a point's place in its voxel, which is what OpenVDB keeps of
// it, is a float without rounding, and so is the way back.
double pointVoxel(const LevelSet& levelSet) {
    return std::exp2(std::ceil(std::log2(pointCell * double(levelSet.voxelSize()))));
}

template <class Value, class Of>
void addAttribute(Points& grid, const openvdb::tools::PointIndexGrid& index, const char* name,
                  const std::vector<SurfacePoint>& points, Of of) {
    std::vector<Value> values;
    for (std::size_t i = 0; i < points.size(); ++i) values.push_back(of(i));
    openvdb::points::appendAttribute<Value>(grid.tree(), name);
    const openvdb::points::PointAttributeVector<Value> wrapped(values);
    openvdb::points::populateAttribute(grid.tree(), index.tree(), name, wrapped);
}

Points::ConstPtr store(const SurfacePoints& surface, double voxel) {
    const std::vector<SurfacePoint> points(surface.points().begin(), surface.points().end());
    std::vector<Vec3s> positions;
    for (const SurfacePoint& point : points) positions.push_back(toVdb(point.position));
    const auto transform = openvdb::math::Transform::createLinearTransform(voxel);
    const openvdb::points::PointAttributeVector<Vec3s> wrapped(positions);
    const auto index = openvdb::tools::createPointIndexGrid<openvdb::tools::PointIndexGrid>(wrapped, *transform);
    const auto grid =
        openvdb::points::createPointDataGrid<openvdb::points::NullCodec, Points>(*index, wrapped, *transform);
    addAttribute<Vec3s>(*grid, *index, attribute::normal, points,
                        [&](std::size_t i) { return toVdb(points[i].normal); });
    addAttribute<std::int32_t>(*grid, *index, attribute::feature, points,
                               [](std::size_t i) { return std::int32_t(i); });
    addAttribute<std::int8_t>(*grid, *index, attribute::sharp, points,
                              [&](std::size_t i) { return points[i].isSharp; });
    grid->setName(contactPoints);
    return grid;
}

[[noreturn]] void refuse(const std::string& why) {
    throw std::invalid_argument("the body is damaged: " + why);
}

bool isFinite(const glm::vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool isUnit(float length) {
    return std::abs(length - 1) < unitError;
}

// Puts points into the order of their features.
class Collector {
  public:
    explicit Collector(std::size_t count) : points_(count), seen_(count, false) {}

    void add(std::int32_t feature, const SurfacePoint& point) {
        if (feature < 0 || std::size_t(feature) >= points_.size() || seen_[feature])
            refuse(fmt::format("a surface point has the number {} of another, or none", feature));
        if (!isFinite(point.position) || !isUnit(glm::length(point.normal)))
            refuse(fmt::format("surface point {} is no place with a normal", feature));
        seen_[feature] = true;
        points_[feature] = point;
    }

    std::vector<SurfacePoint> take() { return std::move(points_); }

  private:
    std::vector<SurfacePoint> points_;
    std::vector<bool> seen_;
};

template <class Value>
using Handle = openvdb::points::AttributeHandle<Value>;

SurfacePoints load(const Points& grid) {
    Collector collector(openvdb::points::pointCount(grid.tree()));
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) {
        const Handle<Vec3s> position(leaf->constAttributeArray(attribute::position));
        const Handle<Vec3s> normal(leaf->constAttributeArray(attribute::normal));
        const Handle<std::int32_t> feature(leaf->constAttributeArray(attribute::feature));
        const Handle<std::int8_t> sharp(leaf->constAttributeArray(attribute::sharp));
        for (auto index = leaf->beginIndexOn(); index; ++index) {
            const openvdb::Vec3d place = index.getCoord().asVec3d() + openvdb::Vec3d(position.get(*index));
            collector.add(feature.get(*index),
                          {toGlm(Vec3s(grid.indexToWorld(place))), toGlm(normal.get(*index)), sharp.get(*index) != 0});
        }
    }
    return SurfacePoints(collector.take());
}

SurfacePoints pointsOf(const LevelSet& levelSet) {
    const auto grid = openvdb::gridConstPtrCast<Points>(levelSet.grids().points);
    if (!grid || openvdb::points::pointCount(grid->tree()) == 0)
        refuse(fmt::format("it has no surface points (grid '{}')", contactPoints));
    try {
        return load(*grid);
    } catch (const openvdb::Exception& error) {
        refuse(fmt::format("grid '{}': {}", contactPoints, error.what()));
    }
}

// Entries of the distance grid.
class Entries {
  public:
    explicit Entries(const LevelSet& levelSet) : grid_(*levelSet.grids().distance) {}

    template <class Value>
    std::optional<Value> find(const char* name) const {
        const auto entry = grid_.getMetadata<openvdb::TypedMetadata<Value>>(name);
        return entry ? std::optional(entry->value()) : std::nullopt;
    }

    template <class Value>
    Value get(const char* name) const {
        const auto value = find<Value>(name);
        if (!value) refuse(fmt::format("'{}' is missing", name));
        return *value;
    }

    glm::vec3 vector(const char* name) const {
        const glm::vec3 value = toGlm(get<Vec3s>(name));
        if (!isFinite(value)) refuse(fmt::format("'{}' is not finite", name));
        return value;
    }

  private:
    const openvdb::FloatGrid& grid_;
};

void storeMass(openvdb::FloatGrid& grid, const MassProperties& mass) {
    const glm::mat3& m = mass.inertia;
    const glm::quat& q = mass.principalAxes;
    grid.insertMeta(entry::volume, openvdb::DoubleMetadata(mass.volume));
    grid.insertMeta(entry::centre, openvdb::Vec3SMetadata(toVdb(mass.centre)));
    grid.insertMeta(entry::inertia, openvdb::Vec3SMetadata({m[0][0], m[1][1], m[2][2]}));
    grid.insertMeta(entry::products, openvdb::Vec3SMetadata({m[0][1], m[0][2], m[1][2]}));
    grid.insertMeta(entry::principal, openvdb::Vec3SMetadata(toVdb(mass.principalInertia)));
    grid.insertMeta(entry::axes, openvdb::Vec4SMetadata({q.x, q.y, q.z, q.w}));
}

void requirePositive(const glm::vec3& moments, const char* name) {
    if (!(std::min({moments.x, moments.y, moments.z}) > 0)) refuse(fmt::format("'{}' is not positive", name));
}

std::optional<MassProperties> loadMass(const Entries& entries) {
    if (!entries.find<double>(entry::volume)) return std::nullopt;
    MassProperties mass;
    mass.volume = entries.get<double>(entry::volume);
    if (!(mass.volume > 0 && std::isfinite(mass.volume))) refuse(fmt::format("'{}' is {}", entry::volume, mass.volume));
    mass.centre = entries.vector(entry::centre);
    const glm::vec3 diagonal = entries.vector(entry::inertia), products = entries.vector(entry::products);
    requirePositive(diagonal, entry::inertia);
    mass.inertia = {diagonal.x, products.x, products.y, products.x, diagonal.y,
                    products.z, products.y, products.z, diagonal.z};
    mass.principalInertia = entries.vector(entry::principal);
    requirePositive(mass.principalInertia, entry::principal);
    const auto q = entries.get<openvdb::Vec4s>(entry::axes);
    mass.principalAxes = glm::quat(q.w(), q.x(), q.y(), q.z());
    if (!isUnit(glm::length(mass.principalAxes))) refuse(fmt::format("'{}' is no rotation", entry::axes));
    return mass;
}

void requireWithin(const SurfacePoints& points, const Bounds& bounds) {
    const glm::vec3 room(boundsError * glm::length(glm::max(glm::abs(bounds.lower), glm::abs(bounds.upper))));
    for (const SurfacePoint& point : points.points())
        if (point.position != glm::clamp(point.position, bounds.lower - room, bounds.upper + room))
            refuse("a surface point lies outside of its bounds");
}

// Bytes of a type that OpenVDB does not know: other programs hand them on as they are.
using Bytes = openvdb::UnknownMetadata;
constexpr const char* meshType = "bilayer_mesh";
constexpr std::size_t mostMeshBytes = std::size_t(1) << 31;

struct MeshHead {
    std::uint64_t hash, points, triangles;
};

std::size_t bytesOf(const MeshHead& head) {
    const std::size_t most = mostMeshBytes / sizeof(glm::vec3);  // of either: sums of more would overflow
    if (head.points > most || head.triangles > most) return std::numeric_limits<std::size_t>::max();
    return sizeof(head) + head.points * sizeof(glm::vec3) + head.triangles * sizeof(glm::uvec3);
}

// A head, three coordinates of each vertex, three vertices of each triangle.
openvdb::Metadata::Ptr packed(const Mesh& mesh) {
    validate(mesh);
    const MeshHead head{hash(mesh), mesh.points.size(), mesh.triangles.size()};
    if (bytesOf(head) > mostMeshBytes)
        throw std::invalid_argument(
            "the mesh is too large to keep beside its field: leave it out (Body::mesh, --no-mesh)");
    Bytes::ByteVec bytes(bytesOf(head));
    const std::size_t pointBytes = head.points * sizeof(glm::vec3);
    std::memcpy(bytes.data(), &head, sizeof(head));
    std::memcpy(bytes.data() + sizeof(head), mesh.points.data(), pointBytes);
    std::memcpy(bytes.data() + sizeof(head) + pointBytes, mesh.triangles.data(), head.triangles * sizeof(glm::uvec3));
    const auto entry = std::make_shared<Bytes>(meshType);
    entry->setValue(bytes);
    return entry;
}

std::shared_ptr<const Mesh> unpacked(const Bytes::ByteVec& bytes) {
    MeshHead head{};
    std::memcpy(&head, bytes.data(), std::min(sizeof(head), bytes.size()));
    if (bytesOf(head) != bytes.size()) refuse(fmt::format("'{}' is too short or too long", entry::mesh));
    auto mesh = std::make_shared<Mesh>();
    mesh->points.resize(head.points);
    mesh->triangles.resize(head.triangles);
    const std::size_t pointBytes = head.points * sizeof(glm::vec3);
    std::memcpy(mesh->points.data(), bytes.data() + sizeof(head), pointBytes);
    std::memcpy(mesh->triangles.data(), bytes.data() + sizeof(head) + pointBytes, head.triangles * sizeof(glm::uvec3));
    if (hash(*mesh) != head.hash) refuse(fmt::format("'{}' is not what was written", entry::mesh));
    try {
        validate(*mesh);
    } catch (const std::invalid_argument& error) {
        refuse(fmt::format("'{}': {}", entry::mesh, error.what()));
    }
    return mesh;
}

std::shared_ptr<const Mesh> meshOf(const LevelSet& levelSet) {
    const auto entry = (*levelSet.grids().distance)[entry::mesh];
    if (!entry) return nullptr;
    const auto bytes = std::dynamic_pointer_cast<const Bytes>(entry);
    if (!bytes) refuse(fmt::format("'{}' is of type {}", entry::mesh, entry->typeName()));
    return unpacked(bytes->value());
}

void requireSame(const Bounds& ofMesh, const Bounds& ofBody) {
    if (ofMesh.lower != ofBody.lower || ofMesh.upper != ofBody.upper) refuse("its mesh is of another body");
}

constexpr std::pair<Measure, const char*> measures[] = {
    {Measure::samples, "samples"}, {Measure::edges, "edges"}, {Measure::triangles, "triangles"}};

Measure measureOf(const std::string& name) {
    for (const auto& [measure, itsName] : measures)
        if (name == itsName) return measure;
    refuse(fmt::format("'{}' is {}", entry::measure, name));
}

// A field that was moved or scaled elsewhere leaves its body behind.
void requireWithin(const Bounds& bounds, const openvdb::FloatGrid& grid) {
    const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
    const openvdb::Vec3d lower = grid.indexToWorld(box.min().asVec3d() - openvdb::Vec3d(fieldBesideMesh)),
                         upper = grid.indexToWorld(box.max().asVec3d() + openvdb::Vec3d(fieldBesideMesh));
    for (int axis = 0; axis < 3; ++axis)
        if (!(double(bounds.lower[axis]) >= lower[axis] && double(bounds.upper[axis]) <= upper[axis]))
            throw std::invalid_argument("the body is of another field: its surface lies outside of the voxels");
}

}  // namespace

const char* nameOf(Measure measure) {
    for (const auto& [one, name] : measures)
        if (one == measure) return name;
    throw std::invalid_argument("no such measure");
}

LevelSet withBody(const LevelSet& given, const Body& body) {
    if (body.points.points().empty()) throw std::invalid_argument("a body has surface points");
    openvdb::initialize();
    const LevelSet& levelSet = body.filled ? *body.filled : given;
    const auto distance = openvdb::ConstPtrCast<openvdb::FloatGrid>(levelSet.grids().distance)->copy();
    for (const char* stale : {entry::volume, entry::centre, entry::inertia, entry::products, entry::principal,
                              entry::axes, entry::mesh, entry::measure})
        distance->removeMeta(stale);
    distance->insertMeta(entry::format, openvdb::Int32Metadata(format));
    distance->insertMeta(entry::margin, openvdb::FloatMetadata(body.margin));
    distance->insertMeta(entry::lower, openvdb::Vec3SMetadata(toVdb(body.bounds.lower)));
    distance->insertMeta(entry::upper, openvdb::Vec3SMetadata(toVdb(body.bounds.upper)));
    if (body.mass) storeMass(*distance, *body.mass);
    if (body.mesh) {
        distance->insertMeta(entry::mesh, *packed(*body.mesh));
        distance->insertMeta(entry::measure, openvdb::StringMetadata(nameOf(body.measure)));
    }
    auto grids = std::make_shared<Grids>(levelSet.grids());
    grids->distance = distance;
    grids->points = store(body.points, pointVoxel(levelSet));
    return LevelSet(std::move(grids));
}

bool hasBody(const LevelSet& levelSet) {
    return Entries(levelSet).find<std::int32_t>(entry::format).has_value();
}

Body bodyOf(const LevelSet& levelSet) {
    const Entries entries(levelSet);
    const auto kind = entries.find<std::int32_t>(entry::format);
    if (!kind) throw std::invalid_argument("the field has no body beside it (withBody(), or bilayer build --body)");
    if (*kind != format)
        throw std::invalid_argument(fmt::format("the body is of kind {}, which only another version knows", *kind));
    Body body;
    body.margin = entries.get<float>(entry::margin);
    if (!(body.margin >= 0 && std::isfinite(body.margin)))
        refuse(fmt::format("'{}' is {}", entry::margin, body.margin));
    body.bounds.lower = entries.vector(entry::lower);
    body.bounds.upper = entries.vector(entry::upper);
    body.mass = loadMass(entries);
    body.points = pointsOf(levelSet);
    body.mesh = meshOf(levelSet);
    if (body.mesh) body.measure = measureOf(entries.get<std::string>(entry::measure));
    requireWithin(body.points, body.bounds);
    requireWithin(body.bounds, *levelSet.grids().distance);
    if (body.mesh) requireSame(bounds(*body.mesh), body.bounds);
    return body;
}

}  // namespace bilayer
