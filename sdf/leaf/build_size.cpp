// SPDX-License-Identifier: Apache-2.0
#include "sdf/leaf/build_size.h"

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <stdexcept>
#include <string>

#include "sdf/base/usable_memory.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {
namespace {

/// Maximum count of cubes of countedSide voxels a side in the mesh's box, which is then 40,000 voxels long.
constexpr int countedSide = 64;
constexpr double maxCubes = double(1u << 28);
/// Approximate memory of a build per triangle (bins or hierarchy) and per block [bytes]. The field itself has 2,200 per
/// block; what builds and writes it takes 800 to 1,700 more.
constexpr double bytesPerTriangle = 60, bytesPerBlock = 4000;

// Estimates the count of blocks that the band meets. It is the volume near the surface or, for a surface that folds
// over itself, near its bounding box.
double countBlocks(const Bounds& box, double area, double h, double reach) {
    const double pi = glm::pi<double>(), r = reach + 0.5 * blockSide;
    const glm::dvec3 s = glm::dvec3(box.size()) / h;
    const double aroundBox = s.x * s.y * s.z + 2 * r * (s.x * s.y + s.y * s.z + s.z * s.x) +
                             pi * r * r * (s.x + s.y + s.z) + 4 * pi / 3 * r * r * r;
    return std::min(blocksAround(area, reach), aroundBox / blockVoxels);
}

}  // namespace

double blocksAround(double area, double reach) {
    const double r = reach + 0.5 * blockSide;
    return (2 * r * area + 8 * glm::pi<double>() / 3 * r * r * r) / blockVoxels;
}

MeshExtent extentOf(const Mesh& mesh) {
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, mesh.triangles.size(), 4096), MeshExtent{},
        [&](const auto& range, MeshExtent extent) {
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                const glm::uvec3 t = mesh.triangles[i];
                const glm::vec3 &a = mesh.points[t.x], &b = mesh.points[t.y], &c = mesh.points[t.z];
                for (const glm::vec3* p : {&a, &b, &c}) extent.box.add(*p);
                extent.area +=
                    0.5 * glm::length(glm::cross(glm::dvec3(b) - glm::dvec3(a), glm::dvec3(c) - glm::dvec3(a)));
            }
            return extent;
        },
        [](const MeshExtent& a, const MeshExtent& b) {
            return MeshExtent{{glm::min(a.box.lower, b.box.lower), glm::max(a.box.upper, b.box.upper)},
                              a.area + b.area};
        });
}

double estimatedBytes(const Mesh& mesh, const MeshExtent& extent, const BuildOptions& options, float reach) {
    const double h = options.voxelSize, block = bytesPerBlock * (options.triangles ? 2 : 1);
    return double(mesh.triangles.size()) * bytesPerTriangle +
           countBlocks(extent.box, extent.area / (h * h), h, double(reach)) * block;
}

void checkSize(const Mesh& mesh, const MeshExtent& extent, const BuildOptions& options, float reach) {
    const Bounds& box = extent.box;
    const double h = options.voxelSize;
    const auto refuse = [&](const std::string& why) {
        throw std::invalid_argument(fmt::format("voxelSize {:g} is too small for this mesh, {:g} voxels long: {}", h,
                                                double(box.longestSide()) / h, why));
    };
    double cubes = 1;
    for (int axis = 0; axis < 3; ++axis) {
        const double low = double(box.lower[axis]) / h, high = double(box.upper[axis]) / h;
        if (!(std::abs(low) < maxIndexCoordinate && std::abs(high) < maxIndexCoordinate))
            refuse("index coordinates would leave 32 bits");
        cubes *= (high - low + 2 * double(reach)) / countedSide + 2;
    }
    if (cubes > maxCubes) refuse("its box would have more than 2^28 cubes of 64^3 voxels");
    const double area = extent.area / (h * h);
    if (!(area > 0)) throw std::invalid_argument("the mesh has no triangle with an area");
    const double bytes = estimatedBytes(mesh, extent, options, reach);
    const double memory = usableMemory();
    if (bytes > memory)
        refuse(fmt::format("with its band it would need about {:.1f} GiB of memory, and {:.1f} GiB may be used",
                           bytes / double(1 << 30), memory / double(1 << 30)));
}

}  // namespace bilayer::detail
