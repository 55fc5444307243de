// SPDX-License-Identifier: Apache-2.0
// Construction of colliders from meshes and from files.
// Tested by tests/collider/collider.cpp through Collider.
#include <bilayer/collider/collider.h>
#include <bilayer/sdf/build.h>
#include <fmt/core.h>

#include <atomic>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include "collider/contact/body/collider_data.h"
#include "collider/field/layout/moments.h"
#include "sdf/base/method_names.h"
#include "sdf/bvh/winding_number.h"
#include "sdf/sign/fill_holes.h"
#include "sdf/sign/sign_choice.h"

namespace bilayer::detail {
namespace {

// Holes up to this width are cracks, whose rims coincide [voxels].
constexpr float crackWidth = 0.01f;

std::uint64_t nextId() {
    static std::atomic<std::uint64_t> made = 0;
    return ++made;
}

// Mass properties of a closed mesh's union, otherwise of the field's interior, which a flood may have widened.
std::optional<MassProperties> meshOrFieldMass(const Mesh& oriented, const LevelSet& levelSet) {
    try {
        if (!balanced(oriented) || levelSet.sign() == nameOf(Sign::flood)) return massProperties(levelSet);
        // neither intersects itself nor has copies
        const bool isSimple = levelSet.sign() == nameOf(Sign::normals) && levelSet.signReason() == closedAndOriented;
        return isSimple ? massProperties(oriented) : unionMass(oriented);
    } catch (const std::invalid_argument&) {
        return std::nullopt;  // an open surface: it can only be static
    }
}

struct Filled {
    Mesh mesh;
    std::optional<LevelSet> levelSet;  // set if holes were filled
};

// Fills the gaps that winding numbers treat as surface, so that they have distances and normals of their own.
Filled filledMesh(Mesh outward, const LevelSet& levelSet) {
    if (levelSet.sign() != nameOf(Sign::winding) || levelSet.meshHash() == 0) return {std::move(outward), std::nullopt};
    FilledMesh filled = fillHoles(std::move(outward), double(crackWidth * levelSet.voxelSize()));
    if (!filled.changed) return {std::move(filled.mesh), std::nullopt};
    const float voxelSize = levelSet.voxelSize();
    LevelSet closed = build(filled.mesh, {.voxelSize = voxelSize,
                                          .exteriorWidthVoxels = levelSet.exteriorWidth() / voxelSize,
                                          .interiorWidthVoxels = levelSet.interiorWidth() / voxelSize});
    filled.mesh = outwardMesh(closed, std::move(filled.mesh));
    return {std::move(filled.mesh), std::move(closed)};
}

// Only an open mesh has open surfaces.
SurfacePoints pointsOf(const Mesh& mesh, const LevelSet& levelSet, float spacing) {
    if (levelSet.sign() != nameOf(Sign::winding) || balanced(mesh)) return {mesh, spacing};
    const WindingNumber winding(mesh);
    return {mesh, spacing, [&](const glm::dvec3& place) { return !winding.isInside(place); }};
}

Field fieldOf(const LevelSet& levelSet, const Body& body) {
    Field samples(levelSet);
    return body.mesh && body.accuracy != ContactAccuracy::samples ? fieldWithMesh(samples, body.mesh) : samples;
}

}  // namespace

Body makeBody(Mesh given, const LevelSet& levelSet, const ColliderOptions& options) {
    if (!std::isfinite(options.margin)) throw std::invalid_argument("the margin is not finite");
    if (options.margin > maxMargin * levelSet.voxelSize())
        throw std::invalid_argument(fmt::format("the margin is {:g} m, and must be at most {} voxels, which are {:g} m",
                                                options.margin, maxMargin, maxMargin * levelSet.voxelSize()));
    Mesh oriented = orientedMesh(levelSet, std::move(given));
    auto mass = meshOrFieldMass(oriented, levelSet);
    Filled filled = filledMesh(outerSurface(levelSet, std::move(oriented)), levelSet);
    const auto mesh = std::make_shared<const Mesh>(std::move(filled.mesh));
    const LevelSet& signs = filled.levelSet ? *filled.levelSet : levelSet;
    return {.points = pointsOf(*mesh, signs, options.pointSpacingVoxels * levelSet.voxelSize()),
            .bounds = bounds(*mesh),
            .margin = options.margin < 0 ? levelSet.voxelSize() : options.margin,
            .mass = std::move(mass),
            .mesh = mesh,
            .accuracy = options.accuracy,
            .filled = std::move(filled.levelSet)};
}

ColliderData::ColliderData(const LevelSet& given, Body made)
    : body(std::move(made)),
      field(fieldOf(body.filled ? *body.filled : given, body)),
      errorMask(field.mesh() && body.accuracy == ContactAccuracy::exactNearFeatures ? InterpolationErrorMask(field)
                                                                                    : InterpolationErrorMask()),
      sharpEdges(body.points, field),
      id(nextId()) {
    if (!body.mesh) levelSet_ = given;
}

}  // namespace bilayer::detail

namespace bilayer {

using namespace detail;

Collider::Collider(Mesh mesh, const LevelSet& levelSet, const ColliderOptions& options)
    : data_(std::make_shared<const ColliderData>(levelSet, makeBody(std::move(mesh), levelSet, options))) {}

Collider::Collider(const LevelSet& levelSet)
    : data_(std::make_shared<const ColliderData>(levelSet, bodyOf(levelSet))) {}

LevelSet withBody(const LevelSet& levelSet, Mesh mesh, const ColliderOptions& options, bool keepMesh) {
    Body body = makeBody(std::move(mesh), levelSet, options);
    if (!keepMesh) body.mesh.reset();
    return withBody(levelSet, body);
}

}  // namespace bilayer
