// SPDX-License-Identifier: Apache-2.0
// Storage of bodies: metadata of the distance grid, and their surface points and mesh (stored_points.h, stored_mesh.h).
#include "collider/contact/body/body.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/vdb_io.h>
#include "collider/contact/body/accuracy_names.h"
#include "collider/contact/body/stored_body.h"
#include "collider/contact/body/stored_mesh.h"
#include "collider/contact/body/stored_points.h"
#include "collider/field/samples/field_data.h"
#include "sdf/base/method_names.h"
#include "sdf/base/openvdb.h"
#include "sdf/base/quoted_text.h"
#include "sdf/io/input_file.h"
#include "sdf/sign/sign_choice.h"

namespace bilayer::detail {
namespace {

using openvdb::Vec3s;

constexpr std::int32_t format = 2;        // increases when an older reader would misread the data
constexpr float massError = 1e-3f;        // of moments of inertia, relative to the largest
constexpr float boundsError = 1e-5f;      // of points outside the bounds, relative to their size
constexpr double maxFieldBeyondBand = 4;  // max extent of a field beyond its mesh and band [voxels]
constexpr double maxMeshOutside = 1.5;    // max extent of a mesh outside its field's box [voxels]

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
constexpr const char* accuracy = "bilayer:measure";
}  // namespace entry

std::string text(const glm::vec3& v) {
    return fmt::format("({:g}, {:g}, {:g})", v.x, v.y, v.z);
}

// Metadata entries of the distance grid.
class Entries {
  public:
    explicit Entries(const LevelSet& levelSet) : grid_(*levelSet.grids().distance) {}

    template <class Value>
    std::optional<Value> find(const char* name) const {
        const auto entry = grid_[name];
        if (!entry) return std::nullopt;
        const auto typed = openvdb::DynamicPtrCast<const openvdb::TypedMetadata<Value>>(entry);
        if (!typed)
            refuseBody(fmt::format("'{}' is of type {}, not {}", name, quotedWord(entry->typeName()),
                                   openvdb::typeNameAsString<Value>()));
        return typed->value();
    }

    // Throws if an entry is there without the one that it belongs to.
    void requireAbsent(const char* name, const char* without) const {
        if (grid_[name]) refuseBody(fmt::format("'{}' is missing, but '{}' is there", without, name));
    }

    template <class Value>
    Value get(const char* name) const {
        const auto value = find<Value>(name);
        if (!value) refuseBody(fmt::format("'{}' is missing", name));
        return *value;
    }

    glm::vec3 vector(const char* name) const {
        const glm::vec3 value = toGlm(get<Vec3s>(name));
        if (!isFinite(value)) refuseBody(fmt::format("'{}' is not finite", name));
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
    if (!entries.find<double>(entry::volume)) {
        for (const char* other : {entry::centre, entry::inertia, entry::products, entry::principal, entry::axes})
            entries.requireAbsent(other, entry::volume);
        return std::nullopt;
    }
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
void check(const MassProperties& mass, const Bounds& bounds, float tolerance) {
    const auto require = [](bool holds, const char* name, const auto& value, const std::string& range) {
        if (!holds) refuseBody(fmt::format("'{}' is {}, and must be {}", name, value, range));
    };
    const Bounds box{bounds.lower - tolerance, bounds.upper + tolerance};
    const glm::dvec3 size(box.size());
    require(mass.volume > 0 && mass.volume <= size.x * size.y * size.z, entry::volume, mass.volume,
            "above 0 and no more than that of the bounds");
    const glm::vec3 &centre = mass.centre, p = mass.principalInertia;
    require(centre == glm::clamp(centre, box.lower, box.upper), entry::centre, text(centre), "within the bounds");
    require(p.x > 0 && p.x <= p.y && p.y <= p.z && p.z <= (1 + massError) * (p.x + p.y), entry::principal, text(p),
            "positive, ascending, and the last no more than the sum of the others");
    // of all solids of a volume, a ball has the smallest moments
    const double ball = 1.2 * mass.volume * std::pow(0.75 / glm::pi<double>() * mass.volume, 2. / 3);
    require(double(p.x) + double(p.y) + double(p.z) >= (1 - double(massError)) * ball &&
                double(p.z) <= mass.volume * glm::dot(size, size),
            entry::principal, text(p), fmt::format("what the bounds and '{}' allow", entry::volume));
    require(isUnit(glm::length(mass.principalAxes)), entry::axes, "no rotation", "of unit length");
    const glm::mat3 axes = glm::mat3_cast(mass.principalAxes);
    const glm::mat3 rotated =
        axes * glm::mat3(p.x, 0, 0, 0, p.y, 0, 0, 0, p.z) * glm::transpose(axes) / p.z - mass.inertia / p.z;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            require(std::abs(rotated[i][j]) <= massError, i == j ? entry::inertia : entry::products, mass.inertia[i][j],
                    fmt::format("what '{}' and '{}' make it", entry::principal, entry::axes));
}

void requireWithin(const SurfacePoints& points, const Bounds& bounds) {
    const glm::vec3 tolerance(boundsError * glm::length(glm::max(glm::abs(bounds.lower), glm::abs(bounds.upper))));
    for (const SurfacePoint& point : points.points())
        if (point.position != glm::clamp(point.position, bounds.lower - tolerance, bounds.upper + tolerance))
            refuseBody(fmt::format("a surface point lies outside of '{}' and '{}'", entry::lower, entry::upper));
}

std::shared_ptr<const Mesh> meshOf(const LevelSet& levelSet) {
    const auto entry = (*levelSet.grids().distance)[meshEntry];
    if (!entry) return nullptr;
    const std::shared_ptr<Mesh> mesh = unpackMesh(*entry);
    mesh->origin = levelSet.origin();
    return mesh;
}

// A mesh that build() neither reoriented nor repaired is stored as it was given.
void requireMeshOf(const LevelSet& levelSet, const Mesh& mesh) {
    const bool asGiven = levelSet.sign() == nameOf(Sign::normals) && levelSet.signReason() == closedAndOriented;
    if (!asGiven || levelSet.meshHash() == 0) return;
    if (const std::uint64_t its = hash(mesh); its != levelSet.meshHash())
        refuseBody(fmt::format("'{}' is {:016x}, but the hash of its mesh is {:016x}", metadata::meshHash,
                               levelSet.meshHash(), its));
}

void requireSame(const Bounds& ofMesh, const Bounds& ofBody) {
    if (ofMesh.lower != ofBody.lower || ofMesh.upper != ofBody.upper)
        refuseBody(fmt::format("'{}' and '{}' are not those of its mesh", entry::lower, entry::upper));
}

ContactAccuracy accuracyOf(const std::string& name) {
    for (const auto& [itsName, accuracy] : accuracyNames)
        if (name == itsName) return accuracy;
    refuseBody(fmt::format("the contact accuracy '{}' is {}; it must be samples, exact-near-features or exact",
                           entry::accuracy, quotedWord(name)));
}

// Detects a field that was moved or scaled by another program, without its body.
void requireWithin(const Bounds& bounds, const openvdb::FloatGrid& grid) {
    const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
    const openvdb::Vec3d lower = grid.indexToWorld(box.min().asVec3d() - openvdb::Vec3d(maxMeshOutside)),
                         upper = grid.indexToWorld(box.max().asVec3d() + openvdb::Vec3d(maxMeshOutside));
    const double band = double(grid.background()) + maxFieldBeyondBand * grid.voxelSize()[0];
    for (int axis = 0; axis < 3; ++axis) {
        const double low = double(bounds.lower[axis]) - lower[axis], high = upper[axis] - double(bounds.upper[axis]);
        const auto refuse = [](const char* why) {
            throw std::invalid_argument(
                fmt::format("the body is of another field: by '{}' and '{}', {}", entry::lower, entry::upper, why));
        };
        if (!(low >= 0 && high >= 0)) refuse("its surface lies outside of the voxels");
        if (!(low <= band && high <= band)) refuse("voxels of the band lie far from its surface");
    }
}

// Checks whether the body can belong to this field.
void check(const Body& body, const openvdb::FloatGrid& grid) {
    const auto voxel = float(grid.voxelSize()[0]);
    if (!(body.margin >= 0 && body.margin <= maxMargin * voxel))
        refuseBody(fmt::format("'{}' is {} m, and must be from 0 to {} voxels, which are {:g} m", entry::margin,
                               body.margin, maxMargin, maxMargin * voxel));
    requireWithin(body.points, body.bounds);
    requireWithin(body.bounds, grid);
    if (body.mesh) requireSame(bounds(*body.mesh), body.bounds);
    if (body.mass) check(*body.mass, body.bounds, voxel);
}

}  // namespace

LevelSet withBody(const LevelSet& given, const Body& body) {
    if (body.points.points().empty())
        throw std::invalid_argument("the body has no surface points, and needs at least one");
    if (body.mesh) validate(*body.mesh);
    const LevelSet& levelSet = body.filled ? *body.filled : given;
    check(body, *levelSet.grids().distance);
    if (body.mesh) requireMeshOf(levelSet, *body.mesh);
    openvdb::initialize();
    const auto distance = openvdb::ConstPtrCast<openvdb::FloatGrid>(levelSet.grids().distance)->copy();
    for (const char* stale : {entry::volume, entry::centre, entry::inertia, entry::products, entry::principal,
                              entry::axes, meshEntry, entry::accuracy})
        distance->removeMeta(stale);
    distance->insertMeta(entry::format, openvdb::Int32Metadata(format));
    distance->insertMeta(entry::margin, openvdb::FloatMetadata(body.margin));
    distance->insertMeta(entry::lower, openvdb::Vec3SMetadata(toVdb(body.bounds.lower)));
    distance->insertMeta(entry::upper, openvdb::Vec3SMetadata(toVdb(body.bounds.upper)));
    if (body.mass) storeMass(*distance, *body.mass);
    if (body.mesh) {
        distance->insertMeta(meshEntry, *packMesh(*body.mesh));
        distance->insertMeta(entry::accuracy, openvdb::StringMetadata(nameOf(body.accuracy)));
    }
    auto grids = std::make_shared<Grids>(levelSet.grids());
    grids->distance = distance;
    grids->points = storePoints(body.points, levelSet.voxelSize());
    return LevelSet(std::move(grids));
}

Body bodyOf(const LevelSet& levelSet) {
    const Entries entries(levelSet);
    const auto kind = entries.find<std::int32_t>(entry::format);
    if (!kind)
        throw std::invalid_argument(
            "the field has no body stored with it: store one by `bilayer build --body`, withBody() in C++, or "
            "with_body() in Python");
    if (*kind != format)
        throw std::invalid_argument(fmt::format("the stored body has format {} ('{}'); this version reads format {}",
                                                *kind, entry::format, format));
    Body body;
    body.margin = entries.get<float>(entry::margin);
    body.bounds.lower = entries.vector(entry::lower);
    body.bounds.upper = entries.vector(entry::upper);
    body.mass = loadMass(entries);
    body.points = loadPoints(levelSet);
    body.mesh = meshOf(levelSet);
    if (body.mesh) {
        body.accuracy = accuracyOf(entries.get<std::string>(entry::accuracy));
        requireMeshOf(levelSet, *body.mesh);
    } else {
        entries.requireAbsent(entry::accuracy, meshEntry);
    }
    check(body, *levelSet.grids().distance);
    return body;
}

StoredField readStored(const std::filesystem::path& path) {
    StoredField stored{readVdb(path), std::nullopt};
    if (!hasBody(stored.levelSet)) return stored;
    stored.body = namingFile(path, [&] { return bodyOf(stored.levelSet); });
    return stored;
}

}  // namespace bilayer::detail

namespace bilayer {

using namespace detail;

const char* nameOf(ContactAccuracy accuracy) {
    for (const auto& [name, one] : accuracyNames)
        if (one == accuracy) return name;
    throw std::invalid_argument(fmt::format("{} is no contact accuracy", int(accuracy)));
}

bool hasBody(const LevelSet& levelSet) {
    return Entries(levelSet).find<std::int32_t>(entry::format).has_value();
}

}  // namespace bilayer
