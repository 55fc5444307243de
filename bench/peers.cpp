// SPDX-License-Identifier: Apache-2.0
#include "bench/peers.h"

#include <nanovdb/util/OpenToNanoVDB.h>
#include <nanovdb/util/SampleFromVoxels.h>
#include <openvdb/math/Stencils.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/RayIntersector.h>

#include "sdf/base/openvdb.h"

namespace bilayer::bench {
namespace {

using Trilinear = nanovdb::TrilinearSampler<nanovdb::DefaultReadAccessor<float>>;

glm::vec3 toGlm(const openvdb::Vec3s& v) {
    return {v.x(), v.y(), v.z()};
}

// build() makes transforms of uniform scale without translation, so world to voxel coordinates is one product.
double voxelsPerMetre(const openvdb::FloatGrid& grid) {
    return 1 / grid.voxelSize()[0];
}

openvdb::Vec3d toVoxels(const glm::vec3& point, double perMetre) {
    return {point.x * perMetre, point.y * perMetre, point.z * perMetre};
}

}  // namespace

Sampler openvdbSampler(openvdb::FloatGrid::ConstPtr grid) {
    return {"OpenVDB BoxSampler + gradient", [grid](std::span<const glm::vec3> points, std::span<Sample> samples) {
                const double perMetre = voxelsPerMetre(*grid);
                const auto accessor = grid->getConstAccessor();
                openvdb::math::BoxStencil<openvdb::FloatGrid> stencil(*grid);
                for (std::size_t i = 0; i < points.size(); ++i) {
                    const openvdb::Vec3d at = toVoxels(points[i], perMetre);
                    samples[i].distance = openvdb::tools::BoxSampler::sample(accessor, at);
                    stencil.moveTo(at);
                    samples[i].gradient = toGlm(stencil.gradient(at));
                }
            }};
}

Sampler openvdbStencil(openvdb::FloatGrid::ConstPtr grid) {
    return {"OpenVDB BoxStencil", [grid](std::span<const glm::vec3> points, std::span<Sample> samples) {
                const double perMetre = voxelsPerMetre(*grid);
                openvdb::math::BoxStencil<openvdb::FloatGrid, false> stencil(*grid);
                for (std::size_t i = 0; i < points.size(); ++i) {
                    const openvdb::Vec3d at = toVoxels(points[i], perMetre);
                    stencil.moveTo(at);
                    samples[i] = {.distance = stencil.interpolation(at), .gradient = toGlm(stencil.gradient(at))};
                }
            }};
}

Sampler openvdbCell(openvdb::FloatGrid::ConstPtr grid) {
    return {"OpenVDB, eight voxels by hand", [grid](std::span<const glm::vec3> points, std::span<Sample> samples) {
                const double perMetre = voxelsPerMetre(*grid);
                const auto accessor = grid->getConstUnsafeAccessor();
                for (std::size_t i = 0; i < points.size(); ++i) {
                    const openvdb::Vec3d at = toVoxels(points[i], perMetre);
                    const openvdb::Coord voxel = openvdb::Coord::floor(at);
                    float values[2][2][2];
                    openvdb::tools::BoxSampler::getValues(values, accessor, voxel);
                    const openvdb::Vec3s in(at - voxel.asVec3d());
                    const nanovdb::Vec3f place(in.x(), in.y(), in.z());
                    const nanovdb::Vec3f gradient = Trilinear::gradient(place, values);
                    samples[i] = {.distance = Trilinear::sample(place, values),
                                  .gradient = glm::vec3(gradient[0], gradient[1], gradient[2]) * float(perMetre)};
                }
            }};
}

RayCaster openvdbRays(openvdb::FloatGrid::ConstPtr grid) {
    return {"OpenVDB LevelSetRayIntersector", [grid](std::span<const Ray> rays, std::span<RayHit> hits) {
                using Intersector = openvdb::tools::LevelSetRayIntersector<openvdb::FloatGrid>;
                const Intersector intersector(*grid);
                for (std::size_t i = 0; i < rays.size(); ++i) {
                    const auto& [from, along, length] = rays[i];
                    const Intersector::RayType ray({from.x, from.y, from.z}, {along.x, along.y, along.z}, 0, length);
                    openvdb::Vec3d position, normal;
                    double distance = 0;
                    const bool hit = intersector.intersectsWS(ray, position, normal, distance);
                    hits[i] = hit ? RayHit{.distance = float(distance),
                                           .position = toGlm(openvdb::Vec3s(position)),
                                           .normal = toGlm(openvdb::Vec3s(normal))}
                                  : missed;
                }
            }};
}

struct Nanovdb::Grid {
    nanovdb::GridHandle<> handle;
    const nanovdb::FloatGrid& grid() const { return *handle.grid<float>(); }
};

Nanovdb::Nanovdb(const openvdb::FloatGrid& grid)
    : grid_(std::make_shared<const Grid>(Grid{nanovdb::openToNanoVDB(grid)})) {}

std::size_t Nanovdb::bytes() const {
    return grid_->handle.size();
}

Sampler Nanovdb::sampler() const {
    return {"NanoVDB sampler", [shared = grid_](std::span<const glm::vec3> points, std::span<Sample> samples) {
                const nanovdb::FloatGrid& grid = shared->grid();
                const auto perMetre = float(1 / grid.voxelSize()[0]);
                const auto accessor = grid.getAccessor();
                const auto sampler = nanovdb::createSampler<1>(accessor);
                for (std::size_t i = 0; i < points.size(); ++i) {
                    const glm::vec3 p = points[i] * perMetre;
                    const nanovdb::Vec3f at(p.x, p.y, p.z);
                    const nanovdb::Vec3f gradient = sampler.gradient(at);
                    samples[i] = {.distance = sampler(at),
                                  .gradient = glm::vec3(gradient[0], gradient[1], gradient[2]) * perMetre};
                }
            }};
}

}  // namespace bilayer::bench
