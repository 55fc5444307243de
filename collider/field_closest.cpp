// The field finds, triangles decide: the sampled distance bounds the search in the hierarchy over the mesh, so that
// little of it is looked at, and the feature that is found is measured in double precision.
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>

#include "collider/field_data.h"
#include "sdf/orient.h"
#include "sdf/sign.h"

namespace bilayer {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
/// What the interpolant seldom exceeds the distance by, so that a second search is seldom needed [voxels].
constexpr float usualError = 0.1f;
/// A normal whose height towards the point is below this part of it tells no side.
constexpr double cancelled = 1e-2;

// The mesh as build() understood it.
Mesh meshOf(const LevelSet& levelSet, Mesh mesh) {
    validate(mesh);
    if (levelSet.meshHash() != 0 && levelSet.meshHash() != hash(mesh))
        throw std::invalid_argument("field: the level set is of another mesh");
    const std::string& reason = levelSet.signReason();
    if (levelSet.sign() != "normals" || reason == closedAndOriented || reason == asAskedFor) return mesh;
    return orient(mesh).mesh;
}

// Of a point over the plane that the normal stands on; the normal may be shorter than 1.
double heightOver(const NearestFeature& nearest) {
    return -glm::dot(nearest.normal, nearest.way);
}

// The normal of a feature, turned around where it points to the other side; where there is none, from the surface to
// the point or the other way.
glm::vec3 outwardNormal(const NearestFeature& nearest, bool inside) {
    const double length = glm::length(nearest.normal), distance = glm::length(nearest.way);
    if (length > cancelled || distance == 0) {
        const bool turned = inside ? heightOver(nearest) > 0 : heightOver(nearest) < 0;
        return length > 0 ? glm::vec3(nearest.normal * ((turned ? -1 : 1) / length)) : glm::vec3(0, 0, 1);
    }
    return glm::vec3(nearest.way * ((inside ? 1 : -1) / distance));
}

}  // namespace

Field::Data::Data(const LevelSet& levelSet, Mesh given)
    : FieldLayout(levelSet),
      mesh(std::make_unique<MeshTree>(meshOf(levelSet, std::move(given)), levelSet.voxelSize())),
      signedByNormals(levelSet.sign() == "normals"),
      error(levelSet.errorBound() < infinity ? levelSet.errorBound() : infinity) {}

// A ball around a voxel that the surface does not reach lies on the voxel's side.
Field::Data::Side Field::Data::sideAt(const glm::dvec3& local, const Sample& here) const {
    const bool inside = here.distance < 0;
    const glm::dvec3 size = extent();
    const bool within =
        local.x >= 0 && local.y >= 0 && local.z >= 0 && local.x < size.x && local.y < size.y && local.z < size.z;
    if (!within) return {inside, here.distance > error};
    const glm::ivec3 block = glm::ivec3(local) >> 3;
    const std::int32_t entry = directory[entryOf(block)];
    if (entry < 0) return {inside, std::abs(here.distance) > error};
    const glm::ivec3 corner(local + 0.5), inBlock = corner - 8 * block;
    const float value = values[std::size_t(entry) * blockFloats + (inBlock.x * stride + inBlock.y) * stride + inBlock.z];
    const bool certain = glm::distance(local, glm::dvec3(corner)) * voxel < double(std::abs(value) - error);
    return certain ? Side{value < 0, true} : Side{inside, false};
}

// The triangle that is nearest [m]: it is no farther away than the field says, but for a little.
std::uint32_t Field::Data::nearestTriangle(const glm::vec3& point, const Sample& here, float maxDistance) const {
    if (here.inBand) {
        const float expected = std::abs(here.distance) * float(perMetre) + usualError;
        const std::uint32_t triangle = mesh->nearest(glm::dvec3(point), expected);
        if (triangle != noTriangle) return triangle;
    }
    return mesh->nearest(glm::dvec3(point), maxDistance * float(perMetre));
}

// By the normal, where it is the mesh's and tells a side, and no ball of the field knows better.
bool Field::Data::isInside(const NearestFeature& nearest, const glm::dvec3& local, const Sample& here) const {
    const Side side = sideAt(local, here);
    const double height = heightOver(nearest);
    const bool decided = signedByNormals && std::abs(height) > cancelled * glm::length(nearest.way);
    return side.certain || !decided ? side.inside : height < 0;
}

ClosestPoint Field::Data::closest(const glm::vec3& point, float maxDistance) const {
    const glm::dvec3 local = toLocal(point);
    const Sample here = sample(local, -infinity);
    const std::uint32_t triangle = nearestTriangle(point, here, maxDistance);
    if (triangle == noTriangle) return {};
    const NearestFeature nearest = mesh->featureOf(triangle, glm::dvec3(point));
    const double distance = glm::length(nearest.way);
    if (!(distance <= double(maxDistance))) return {};

    const bool inside = isInside(nearest, local, here);
    return {.distance = float(inside ? -distance : distance),
            .position = glm::vec3(glm::dvec3(point) + nearest.way),
            .normal = outwardNormal(nearest, inside),
            .triangle = triangle,
            .feature = nearest.feature,
            .index = nearest.index,
            .found = true};
}

ClosestPoint Field::closest(const glm::vec3& point, float maxDistance) const noexcept {
    return data_->mesh ? data_->closest(point, maxDistance) : ClosestPoint{};
}

void Field::closest(std::span<const glm::vec3> points, std::span<ClosestPoint> answers,
                    float maxDistance) const noexcept {
    for (std::size_t i = 0; i < points.size(); ++i) answers[i] = closest(points[i], maxDistance);
}

}  // namespace bilayer
