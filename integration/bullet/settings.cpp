// SPDX-License-Identifier: Apache-2.0
// Rules of thumb, each with its reason. They hold for bodies of any scale: lengths are compared with voxels and with
// each other, and with metres only where Bullet does so.
#include <bilayer/integration/bullet/settings.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include "collider/field/layout/interpolant.h"
#include "sdf/base/voxel_limits.h"

namespace bilayer::bullet {

using bilayer::detail::minVoxelSize;

namespace {

// Wall thickness [voxels]: from three on, mass and inertia are accurate to 0.5 %; below two, the inside/outside
// classification is unreliable.
constexpr float wallVoxels = 3, minWallVoxels = 2;
// Minimum gap to pass [voxels]: penetration at rest is below 0.5 voxels on either side.
constexpr float gapVoxels = 2;
// Voxels along the longest side. The minimum resolves the features of bodies that are not thin, the maximum limits
// the memory.
constexpr float minResolution = 64, maxResolution = 512;
constexpr float rounding = 1e-3f;  // [voxels] and steps: numbers within this of an integer count as integers
constexpr float maxIndex = 1e9f;   // maximum coordinate of a field [voxels]
// Interior band width [voxels]: the minimum for shallow penetration, and the width beyond which CCD or shorter steps
// are cheaper than more voxels.
constexpr int minInterior = 3, maxInterior = 10;
// Points are followed along straight paths. The error is 3 % of a body's radius at this rotation in a step [rad].
constexpr float maxRotationPerStep = 0.5f;
// Beyond the middle of a wall, a point is pushed out on the far side.
constexpr float wallPart = 0.5f;
// Minimum body size [m]. Bullet's thresholds are absolute lengths and speeds: gContactBreakingThreshold is 2 cm, and
// bodies sleep below 0.8 m/s. A tenth of a body's size and four of its lengths a second are still harmless.
constexpr float minSize = 0.2f;
constexpr float maxMassRatio = 10;  // solved by ten iterations of sequential impulses
constexpr double maxMemory = double(1 << 30);
// Measured at the end of large builds on two cores of an AMD EPYC (Zen 4), 2023 [s].
constexpr double secondsPerTriangle = 160e-9, secondsPerVoxel = 26e-9;
// A leaf of 8^3 voxels as a Field stores it, with an apron [bytes]; and its mean width over all directions [voxels].
constexpr double blockBytes = 9 * 9 * 9 * 4, blockVoxels = 512, blockWidth = 12;

void requireSensible(const MeshReport& mesh, const SceneRequirements& scene) {
    for (const auto& [name, value, minimum] :
         {std::tuple("step", scene.step, 1e-9f), std::tuple("speed", scene.speed, 0.f),
          std::tuple("thickness", scene.thickness, 0.f), std::tuple("gap", scene.gap, 0.f),
          std::tuple("mass ratio", scene.massRatio, 1.f), std::tuple("voxel size", scene.voxelSize, 0.f),
          std::tuple("spin", std::max(scene.spin, -1.f), -1.f),
          std::tuple("margin", std::max(scene.margin, -1.f), -1.f)})
        if (!(value >= minimum && std::isfinite(value)))
            throw std::invalid_argument(
                fmt::format("recommendSettings: a {} of {}; it must be finite, and {} at least", name, value, minimum));
    if (scene.voxelSize > 0 && scene.voxelSize < minVoxelSize)
        throw std::invalid_argument(
            fmt::format("recommendSettings: a voxel size of {}; no field has voxels below {:g}: scale the mesh up",
                        scene.voxelSize, minVoxelSize));
    if (scene.voxelSize > 0 && mesh.bounds.longestSide() / scene.voxelSize > maxIndex)
        throw std::invalid_argument(
            fmt::format("recommendSettings: a voxel size of {}; no field has more than {:g} voxels in a row",
                        scene.voxelSize, maxIndex));
    if (mesh.triangles == 0 || !(mesh.bounds.longestSide() > 0))
        throw std::invalid_argument("recommendSettings: the mesh has no extent");
}

int wholeFrom(float value) {
    return int(std::min(std::ceil(value - rounding), float(maxSubsteps)));
}

float chosenVoxel(const SceneRequirements& scene, float longestSide, float wall) {
    if (scene.voxelSize > 0) return scene.voxelSize;
    float voxel = longestSide / minResolution;
    if (wall > 0) voxel = std::min(voxel, wall / wallVoxels);
    if (scene.gap > 0) voxel = std::min(voxel, scene.gap / gapVoxels);
    return std::max({voxel, longestSide / maxResolution, minVoxelSize});
}

// Estimates from area and volume, exact to first order in the curvature. Leaves are counted on both sides of the
// surface, so that walls thinner than a leaf need as little as half of the memory.
void estimate(const MeshReport& mesh, Settings& settings) {
    const double h = settings.voxelSize, area = mesh.area / (h * h), volume = std::abs(mesh.volume) / (h * h * h);
    double inside = area * settings.interiorWidthVoxels;
    if (mesh.closed()) inside = std::min(inside, volume);
    const double voxels = area * settings.exteriorWidthVoxels + inside;
    const double blocks =
        area * (settings.exteriorWidthVoxels + settings.interiorWidthVoxels + blockWidth) / blockVoxels;
    settings.voxels = std::uint64_t(voxels);
    settings.fieldBytes = std::uint64_t(blocks * blockBytes);
    settings.buildSeconds = secondsPerTriangle * double(mesh.triangles) + secondsPerVoxel * voxels;
}

void warnOfMesh(const MeshReport& mesh, std::vector<std::string>& warnings) {
    if (!mesh.closed())
        warnings.push_back(
            fmt::format("the mesh is not closed ({}): signs are a guess, and it may have no mass, which only a static "
                        "body does without",
                        verdict(mesh)));
    else if (!mesh.oriented() || mesh.selfIntersections > 0)
        warnings.push_back(fmt::format("the mesh is not clean: {}", verdict(mesh)));
}

void warnOfSizes(const MeshReport& mesh, const SceneRequirements& scene, const Settings& settings,
                 std::vector<std::string>& warnings) {
    const float thinnest = mesh.thinnestWall / settings.voxelSize;
    if (settings.wallVoxels > 0 && settings.wallVoxels < minWallVoxels - rounding)
        warnings.push_back(fmt::format(
            "walls are {:.2g} voxels thick: below {:g}, contacts may come out on the far side and mass is lost",
            settings.wallVoxels, minWallVoxels));
    else if (thinnest > 0 && thinnest < minWallVoxels)
        warnings.push_back(fmt::format(
            "the thinnest part, a convex vertex or a sharp edge, has {:.2g} voxels: contacts there are coarse",
            thinnest));
    if (const float gap = scene.gap / settings.voxelSize; gap > 0 && gap < gapVoxels - rounding)
        warnings.push_back(fmt::format(
            "the gap is {:.2g} voxels wide: below {:g}, a body that rests in it penetrates its sides", gap, gapVoxels));
    if (settings.margin == 0)
        warnings.push_back(
            "without a margin, resting contacts appear and disappear from step to step: set one of a voxel");
    if (settings.margin > settings.voxelSize * float(maxInterior))
        warnings.push_back(fmt::format("the margin is {:.2g} voxels: the exterior band must be at least as wide",
                                       settings.margin / settings.voxelSize));
    if (double(settings.fieldBytes) > maxMemory)
        warnings.push_back(fmt::format("the field takes about {:.1f} GiB", double(settings.fieldBytes) / maxMemory));
}

void warnOfMotion(const SceneRequirements& scene, const Settings& settings, float stepLength,
                  std::vector<std::string>& warnings) {
    if (settings.substepsWithoutSpeculation > settings.substeps || settings.substeps == maxSubsteps)
        warnings.push_back(
            fmt::format("a body moves {:.3g} m in a step, more than half of a wall, and may tunnel: use "
                        "bullet::WorldExtensions; without it and without speculative contacts "
                        "(ShapeOptions::speculative), take {} substeps{}",
                        stepLength, settings.substepsWithoutSpeculation,
                        settings.substepsWithoutSpeculation < maxSubsteps ? "" : " or more"));
    if (scene.massRatio > maxMassRatio)
        warnings.push_back(
            fmt::format("masses of {:.3g} to 1: above {:g} to 1 the solver lets the heavy body penetrate "
                        "the light one below it; take more substeps, not more iterations",
                        scene.massRatio, maxMassRatio));
}

void warnOfBullet(float longestSide, std::vector<std::string>& warnings) {
    if (longestSide < minSize)
        warnings.push_back(
            fmt::format("a body of {:.3g} m is small to Bullet, which lets it sleep below 0.8 m/s and "
                        "widens its box by 0.02 m: lower setSleepingThresholds() and "
                        "gContactBreakingThreshold, or scale the scene up",
                        longestSide));
}

}  // namespace

Settings recommendSettings(const MeshReport& mesh, const SceneRequirements& scene) {
    requireSensible(mesh, scene);
    const float longestSide = mesh.bounds.longestSide();
    const float wall = scene.thickness > 0 && mesh.commonWall > 0 ? std::min(scene.thickness, mesh.commonWall)
                                                                  : std::max(scene.thickness, mesh.commonWall);
    Settings settings;
    const float h = settings.voxelSize = chosenVoxel(scene, longestSide, wall);
    settings.margin = scene.margin < 0 ? h : scene.margin;
    settings.wallVoxels = wall / h;
    settings.splitImpulse = -h;

    const float stepLength = scene.speed * scene.step;
    // an impact at one end stops that end; the linear velocity becomes rotation about it
    const float spin = scene.spin < 0 ? 2 * scene.speed / longestSide : scene.spin;
    settings.substeps = std::max(1, wholeFrom(spin * scene.step / maxRotationPerStep));
    const float deepest = wallPart * (wall > 0 ? wall : longestSide);
    settings.substepsWithoutSpeculation = std::max(settings.substeps, wholeFrom(stepLength / deepest));
    settings.exteriorWidthVoxels = std::max(1, wholeFrom(settings.margin / h + bilayer::detail::cellDiagonal));
    settings.interiorWidthVoxels =
        std::clamp(wholeFrom(stepLength / (float(settings.substeps) * h) + bilayer::detail::cellDiagonal), minInterior,
                   maxInterior);
    estimate(mesh, settings);

    warnOfMesh(mesh, settings.warnings);
    warnOfSizes(mesh, scene, settings, settings.warnings);
    warnOfMotion(scene, settings, stepLength, settings.warnings);
    warnOfBullet(longestSide, settings.warnings);
    return settings;
}

}  // namespace bilayer::bullet
