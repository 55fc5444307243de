// Storage of bodies: metadata of the distance grid, and a grid of OpenVDB points.
#include "collider/contact/body.h"

#include <fmt/format.h>
#include <openvdb/points/PointAttribute.h>
#include <openvdb/points/PointConversion.h>

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

#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb_points.h"

namespace bilayer::detail {
namespace {

using openvdb::Vec3s;
using Points = openvdb::points::PointDataGrid;

constexpr std::int32_t format = 1;       // increases when an older reader would misread the data
constexpr double pointCell = 4;          // min edge of a point voxel [voxels of the field]; holds a few points
constexpr float unitError = 1e-4f;       // of unit vectors; single precision leaves 1e-7
constexpr float massError = 1e-3f;       // of moments of inertia, relative to the largest
constexpr float boundsError = 1e-5f;     // of points outside the bounds, relative to their size
constexpr double fieldBeyondBand = 4;    // max extent of a field beyond its mesh and band [voxels]
constexpr double fieldBesideMesh = 1.5;  // max extent of a mesh outside its field's box [voxels]

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

// The usual names of these attributes in other programs.
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

// The edge of a point voxel is a power of two. OpenVDB stores a point's place within its voxel; it is then a float
// without rounding, and so is the restored position.
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

std::string text(const glm::vec3& v) {
    return fmt::format("({:g}, {:g}, {:g})", v.x, v.y, v.z);
}

bool isUnit(float length) {
    return std::abs(length - 1) < unitError;
}

// Sorts points by their feature ids.
class Collector {
  public:
    void add(std::int32_t feature, const SurfacePoint& point) {
        if (!isFinite(point.position) || !isUnit(glm::length(point.normal)))
            refuse(fmt::format("surface point {} is no place with a normal", feature));
        points_.emplace_back(feature, point);
    }

    std::vector<SurfacePoint> take() {
        std::stable_sort(points_.begin(), points_.end(),
                         [](const auto& a, const auto& b) { return a.first < b.first; });
        std::vector<SurfacePoint> ordered;
        for (const auto& [feature, point] : points_) {
            if (feature != std::int64_t(ordered.size()))
                refuse(fmt::format("a surface point has the number {} of another, or none", feature));
            ordered.push_back(point);
        }
        return ordered;
    }

  private:
    std::vector<std::pair<std::int32_t, SurfacePoint>> points_;
};

template <class Value>
using Handle = openvdb::points::AttributeHandle<Value>;

// OpenVDB asks for no more than the first attribute's size.
void requireValues(const Points::TreeType::LeafNodeType& leaf) {
    leaf.validateOffsets();
    for (const char* name : {attribute::position, attribute::normal, attribute::feature, attribute::sharp})
        if (leaf.constAttributeArray(name).dataSize() < openvdb::Index(leaf.getLastValue()))
            refuse(fmt::format("surface points have fewer values of the attribute '{}' than there are points", name));
}

SurfacePoints load(const Points& grid) {
    Collector collector;
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) {
        requireValues(*leaf);
        // a uniform array takes no space in a file, whatever count it claims
        if (leaf->pointCount() > 1 && leaf->constAttributeArray(attribute::feature).isUniform())
            refuse("surface points have the same number");
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

// Metadata entries of the distance grid.
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

std::optional<MassProperties> loadMass(const Entries& entries) {
    if (!entries.find<double>(entry::volume)) return std::nullopt;
    MassProperties mass;
    mass.volume = entries.get<double>(entry::volume);
    mass.centre = entries.vector(entry::centre);
    const glm::vec3 diagonal = entries.vector(entry::inertia), products = entries.vector(entry::products);
    mass.inertia = {diagonal.x, products.x, products.y, products.x, diagonal.y,
                    products.z, products.y, products.z, diagonal.z};
    mass.principalInertia = entries.vector(entry::principal);
    const auto q = entries.get<openvdb::Vec4s>(entry::axes);
    mass.principalAxes = glm::quat(q.w(), q.x(), q.y(), q.z());
    return mass;
}

// Checks the mass properties of a solid within a box. From a field, the solid may be a voxel wider than its mesh.
void check(const MassProperties& mass, const Bounds& bounds, float room) {
    const auto require = [](bool holds, const char* name, const auto& value, const char* range) {
        if (!holds) refuse(fmt::format("'{}' is {}, and must be {}", name, value, range));
    };
    const Bounds box{bounds.lower - room, bounds.upper + room};
    const glm::dvec3 size(box.size());
    require(mass.volume > 0 && mass.volume <= size.x * size.y * size.z, entry::volume, mass.volume,
            "above 0 and no more than that of the bounds");
    const glm::vec3 &centre = mass.centre, p = mass.principalInertia;
    require(centre == glm::clamp(centre, box.lower, box.upper), entry::centre, text(centre), "within the bounds");
    require(p.x > 0 && p.x <= p.y && p.y <= p.z && p.z <= (1 + massError) * (p.x + p.y), entry::principal, text(p),
            "positive, ascending, and the last no more than the sum of the others");
    require(double(p.z) <= mass.volume * glm::dot(size, size), entry::principal, text(p),
            "no more than the bounds allow");
    require(isUnit(glm::length(mass.principalAxes)), entry::axes, "no rotation", "of unit length");
    const glm::mat3 axes = glm::mat3_cast(mass.principalAxes);
    const glm::mat3 turned =
        axes * glm::mat3(p.x, 0, 0, 0, p.y, 0, 0, 0, p.z) * glm::transpose(axes) / p.z - mass.inertia / p.z;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            require(std::abs(turned[i][j]) <= massError, i == j ? entry::inertia : entry::products, mass.inertia[i][j],
                    "what the principal moments make it");
}

void requireWithin(const SurfacePoints& points, const Bounds& bounds) {
    const glm::vec3 room(boundsError * glm::length(glm::max(glm::abs(bounds.lower), glm::abs(bounds.upper))));
    for (const SurfacePoint& point : points.points())
        if (point.position != glm::clamp(point.position, bounds.lower - room, bounds.upper + room))
            refuse("a surface point lies outside of its bounds");
}

// Bytes of a type unknown to OpenVDB: other programs pass them through unchanged.
using Bytes = openvdb::UnknownMetadata;
constexpr const char* meshType = "bilayer_mesh";
constexpr std::size_t maxMeshBytes = std::size_t(1) << 31;

struct MeshHead {
    std::uint64_t hash, points, triangles;
};

std::size_t bytesOf(const MeshHead& head) {
    const std::size_t most = maxMeshBytes / sizeof(glm::vec3);  // of either: larger sums would overflow
    if (head.points > most || head.triangles > most) return std::numeric_limits<std::size_t>::max();
    return sizeof(head) + head.points * sizeof(glm::vec3) + head.triangles * sizeof(glm::uvec3);
}

// A header, three coordinates per vertex, three vertex indices per triangle.
openvdb::Metadata::Ptr packed(const Mesh& mesh) {
    const MeshHead head{hash(mesh), mesh.points.size(), mesh.triangles.size()};
    if (bytesOf(head) > maxMeshBytes)
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

std::shared_ptr<Mesh> unpacked(const Bytes::ByteVec& bytes) {
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
    const std::shared_ptr<Mesh> mesh = unpacked(bytes->value());
    mesh->origin = levelSet.origin();
    return mesh;
}

void requireSame(const Bounds& ofMesh, const Bounds& ofBody) {
    if (ofMesh.lower != ofBody.lower || ofMesh.upper != ofBody.upper) refuse("its mesh is of another body");
}

constexpr std::pair<ContactAccuracy, const char*> measures[] = {{ContactAccuracy::samples, "samples"},
                                                                {ContactAccuracy::exactNearFeatures, "edges"},
                                                                {ContactAccuracy::exact, "triangles"}};

ContactAccuracy measureOf(const std::string& name) {
    for (const auto& [measure, itsName] : measures)
        if (name == itsName) return measure;
    refuse(fmt::format("'{}' is {}", entry::measure, name));
}

// Detects a field that was moved or scaled by another program, without its body.
void requireWithin(const Bounds& bounds, const openvdb::FloatGrid& grid) {
    const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
    const openvdb::Vec3d lower = grid.indexToWorld(box.min().asVec3d() - openvdb::Vec3d(fieldBesideMesh)),
                         upper = grid.indexToWorld(box.max().asVec3d() + openvdb::Vec3d(fieldBesideMesh));
    const double band = double(grid.background()) + fieldBeyondBand * grid.voxelSize()[0];
    for (int axis = 0; axis < 3; ++axis) {
        const double low = double(bounds.lower[axis]) - lower[axis], high = upper[axis] - double(bounds.upper[axis]);
        if (!(low >= 0 && high >= 0))
            throw std::invalid_argument("the body is of another field: its surface lies outside of the voxels");
        if (!(low <= band && high <= band))
            throw std::invalid_argument("the body is of another field: voxels of the band lie far from its surface");
    }
}

// Checks whether the body can belong to this field.
void check(const Body& body, const openvdb::FloatGrid& grid) {
    const auto voxel = float(grid.voxelSize()[0]);
    if (!(body.margin >= 0 && body.margin <= maxMargin * voxel))
        refuse(fmt::format("'{}' is {}, and must be 0 to {} voxels", entry::margin, body.margin, maxMargin));
    if (body.mass) check(*body.mass, body.bounds, voxel);
    requireWithin(body.points, body.bounds);
    requireWithin(body.bounds, grid);
    if (body.mesh) requireSame(bounds(*body.mesh), body.bounds);
}

}  // namespace

LevelSet withBody(const LevelSet& given, const Body& body) {
    if (body.points.points().empty()) throw std::invalid_argument("a body has surface points");
    if (body.mesh) validate(*body.mesh);
    const LevelSet& levelSet = body.filled ? *body.filled : given;
    check(body, *levelSet.grids().distance);
    openvdb::initialize();
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
        distance->insertMeta(entry::measure, openvdb::StringMetadata(nameOf(body.accuracy)));
    }
    auto grids = std::make_shared<Grids>(levelSet.grids());
    grids->distance = distance;
    grids->points = store(body.points, pointVoxel(levelSet));
    return LevelSet(std::move(grids));
}

Body bodyOf(const LevelSet& levelSet) {
    const Entries entries(levelSet);
    const auto kind = entries.find<std::int32_t>(entry::format);
    if (!kind) throw std::invalid_argument("the field has no body beside it (withBody(), or bilayer build --body)");
    if (*kind != format)
        throw std::invalid_argument(fmt::format("the body is of kind {}, which only another version knows", *kind));
    Body body;
    body.margin = entries.get<float>(entry::margin);
    body.bounds.lower = entries.vector(entry::lower);
    body.bounds.upper = entries.vector(entry::upper);
    body.mass = loadMass(entries);
    body.points = pointsOf(levelSet);
    body.mesh = meshOf(levelSet);
    if (body.mesh) body.accuracy = measureOf(entries.get<std::string>(entry::measure));
    check(body, *levelSet.grids().distance);
    return body;
}

}  // namespace bilayer::detail

namespace bilayer {

using namespace detail;

const char* nameOf(ContactAccuracy measure) {
    for (const auto& [one, name] : measures)
        if (one == measure) return name;
    throw std::invalid_argument("no such measure");
}

bool hasBody(const LevelSet& levelSet) {
    return Entries(levelSet).find<std::int32_t>(entry::format).has_value();
}

}  // namespace bilayer
