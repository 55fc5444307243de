// SPDX-License-Identifier: Apache-2.0
#include "sdf/leaf/build_options.h"

#include "sdf/base/exact_error.h"
#include "sdf/base/voxel_limits.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace bilayer::detail {
namespace {

/// Scale factor that the error for a small voxel size suggests, applied repeatedly: metres to millimetres.
constexpr double unitStep = 1000;
/// Minimum layer distance: rounding makes closer layers indistinguishable [voxels].
constexpr float minDelta = 0.1f;
/// Maximum distance from a point of a triangle to its nearest sample, in units of sqrt(epsilon).
constexpr float coveringRadius = 3;
/// Margin of the sample reach against rounding [voxels].
constexpr float reachSlack = 1e-3f;

void requireOption(bool condition, const char* option, const char* range, double value) {
    if (!condition) throw std::invalid_argument(fmt::format("{} must be {}, not {}", option, range, value));
}

void checkWidth(const char* option, float voxels, float voxelSize) {
    requireOption(voxels > 0 && voxels <= maxWidthVoxels, option, "in (0, 1000] voxels", voxels);
    // Background of the field [m].
    const float width = voxels * voxelSize;
    requireOption(std::isnormal(width), option, "a width that floats can hold", width);
}

}  // namespace

void checkVoxelSize(double voxelSize, const char* option) {
    double scale = unitStep;
    if (voxelSize > maxVoxelSize) {
        while (voxelSize / scale > maxVoxelSize) scale *= unitStep;
        throw std::invalid_argument(
            fmt::format("{} {:g} is above {:g}, the largest that a field may have: scale the mesh by {:g}, so "
                        "that voxels are {:g}",
                        option, voxelSize, maxVoxelSize, 1 / scale, voxelSize / scale));
    }
    if (voxelSize >= double(minVoxelSize)) return;
    while (scale * voxelSize < double(minVoxelSize)) scale *= unitStep;
    throw std::invalid_argument(
        fmt::format("{} {:g} is below {:g}, the smallest that OpenVDB takes: scale the mesh by {:g}{}, so that "
                    "voxels are {:g}",
                    option, voxelSize, minVoxelSize, scale, scale == unitStep ? " (from metres to millimetres)" : "",
                    scale * double(voxelSize)));
}

void checkOptions(const BuildOptions& options) {
    // Comparison in the type of the value, so that 1e-4f passes a limit of 1e-4f; false for NaN.
    const auto within = [](auto value, decltype(value) low, decltype(value) high) {
        return value >= low && value <= high;
    };
    const DoubleLayerOptions& layers = options.doubleLayer;
    requireOption(options.voxelSize > 0 && std::isnormal(options.voxelSize), "voxelSize", "a positive length",
                  options.voxelSize);
    checkVoxelSize(options.voxelSize);
    checkWidth("exteriorWidthVoxels", options.exteriorWidthVoxels, options.voxelSize);
    checkWidth("interiorWidthVoxels", options.interiorWidthVoxels, options.voxelSize);
    requireOption(within(options.gapVoxels, 0, 100), "gapVoxels", "in 0..100", options.gapVoxels);
    requireOption(layers.delta >= minDelta && layers.delta <= 4, "delta", "in [0.1, 4] voxels", layers.delta);
    requireOption(within(layers.epsilon, 1e-4f, 1e4f), "epsilon", "in 1e-4..1e4 square voxels", layers.epsilon);
    requireOption(within(layers.neighbourhood, 1, 64), "neighbourhood", "in 1..64", layers.neighbourhood);
    requireOption(within(layers.maxSubdivision, 1, 1024), "maxSubdivision", "in 1..1024", layers.maxSubdivision);
    requireOption(within(options.threads, 0, 4096), "threads", "in 0..4096", options.threads);
    if (options.unite && (hasOwnSigns(options.method) || options.sign == Sign::flood))
        throw std::invalid_argument(
            "unite needs the method exact or pseudonormal and a sign by normals or winding numbers");
}

bool hasOwnSigns(Method method) {
    return method == Method::doubleLayer || method == Method::prism;
}

BandWidths bandOf(const BuildOptions& options) {
    return {options.exteriorWidthVoxels, options.interiorWidthVoxels, options.voxelSize};
}

std::string noVoxelInBand(const BuildOptions& options) {
    return fmt::format(
        "the half width is too small for this voxel size: no voxel of {:g} m lies within the band, {:g} voxels outside "
        "and "
        "{:g} inside",
        options.voxelSize, options.exteriorWidthVoxels, options.interiorWidthVoxels);
}

bool enclosesSurface(const BuildOptions& options) {
    return std::min(options.exteriorWidthVoxels, options.interiorWidthVoxels) > 1 + reachSlack;
}

// Distances up to one voxel are computed even for thinner bands, because sign propagation needs them. A flood needs
// distances up to the radius of its ball.
float reachOf(const BuildOptions& options, Sign sign) {
    const float ball = sign == Sign::flood ? options.gapVoxels / 2 + 1 : 1;
    return std::max({options.exteriorWidthVoxels, options.interiorWidthVoxels, ball}) + reachSlack;
}

// A sample must reach every voxel whose distance it may determine. A voxel of the band is within width + delta of its
// layer's sample. That sample is delta from the surface point at the centre of its neighbourhood.
FillParameters fillParameters(const BuildOptions& options) {
    const DoubleLayerOptions& layers = options.doubleLayer;
    const float cube = float(layers.neighbourhood) + 0.5f;
    if (!layers.fillGaps)
        return {layers.delta, cube, std::numeric_limits<float>::infinity(), layers.neighbourhood, options.triangles};
    const float width = std::max(options.exteriorWidthVoxels, options.interiorWidthVoxels);
    const float reach = std::max(width + 2 * layers.delta, cube) + reachSlack;
    return {layers.delta, reach, reach - layers.delta, 0, options.triangles};
}

float layerReach(const FillParameters& parameters) {
    // The corners of the paper's cube lie outside the ball.
    return parameters.reach * (parameters.cube > 0 ? std::sqrt(3.f) : 1.f);
}

float errorBound(const BuildOptions& options) {
    if (options.method == Method::prism) return std::numeric_limits<float>::infinity();  // prisms leave gaps
    if (options.method != Method::doubleLayer) return exactError;
    // A layer sample is delta from the surface. The nearest sample is farther than the voxel's closest point by at most
    // the covering radius. If gaps are not filled, there is no bound.
    const DoubleLayerOptions& layers = options.doubleLayer;
    if (!layers.fillGaps) return std::numeric_limits<float>::infinity();
    return std::max(2 * layers.delta, coveringRadius * std::sqrt(layers.epsilon));
}

}  // namespace bilayer::detail
