// SPDX-License-Identifier: Apache-2.0
// A field on an OpenCL device, for sampling many points at once; kernel in field.cl. And a sampler of the surface
// points of bodies in the fields of other bodies, in one batch per step; kernel in point_sampler.cl. Tested by
// tests/cl/field.cpp and tests/bullet/sampled_pairs.cpp.
#pragma once

#include <cstddef>
#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <span>

#include <bilayer/cl/device.h>
#include <bilayer/cl/filler.h>
#include <bilayer/collider/contact.h>
#include <bilayer/collider/query.h>
#include <bilayer/sdf/build.h>

namespace bilayer {

/// A field that stays in a device's memory. Copies share it.
class DeviceField {
  public:
    /// Lays the level set out as Field in collider/field.h does, and uploads it. A device that shares the host's memory
    /// uses the host's copy in place.
    ///
    /// Throws what Field's constructor throws, and DeviceError. If the memory is too small, the text states how many
    /// MiB are needed.
    DeviceField(const Device& device, const LevelSet& levelSet, const OpenclOptions& options = {});

    /// Builds the field of a mesh on the device, where it stays. Only the mesh is uploaded, and only counts are
    /// downloaded. Samples equal those of build(mesh, build, openclFiller(device, options)), with one exception: where
    /// the double layer method's signs are contradictory, as on an inverted mesh, regions outside the band may have the
    /// other sign. The peak memory is about 1.7 times that of the field, and a quarter of the options' limit for the
    /// fill. The nearest triangles are not kept.
    ///
    /// Throws what build() throws. Throws std::invalid_argument for builds that need the processor: a method other than
    /// Method::exact and Method::doubleLayer, and signs other than from normals, also where those are contradictory.
    DeviceField(const Device& device, const Mesh& mesh, const BuildOptions& build, const OpenclOptions& options = {});

    /// Samples all points, as Field::sample() does one. The values are the same up to the device's rounding of square
    /// roots, which matters outside the band only. Points stream through the device, so their count is not limited. Any
    /// thread may call it; calls on one field wait for each other.
    /// @param points  in the field's own coordinates [m]
    /// @return the times of the call, measured if OpenclOptions::profile was set
    ///
    /// Throws std::invalid_argument if `samples` is not as long as `points`, and DeviceError for errors of the device.
    DeviceTimes sample(std::span<const glm::vec3> points, std::span<Sample> samples) const;

    const Bounds& bounds() const;           ///< around all points in the band [m]
    std::size_t memoryBytes() const;        ///< on the device, including the buffers for points in flight
    const DeviceTimes& buildTimes() const;  ///< of the constructor: of the upload, or of the build

  private:
    struct Data;
    std::shared_ptr<Data> data_;
};

/// A point sampler on a device. Bodies are uploaded on first use, and stay. If the memory is full, all bodies are
/// released except those of the current batch. Queries are uploaded, and their results downloaded; only one batch runs
/// at a time.
///
/// Throws DeviceError, here and when it samples: for errors of the device, for a device without double precision, and
/// if the memory is too small for the bodies of one batch. The text then states how many MiB are needed.
PointSampler openclPointSampler(const Device& device, const OpenclOptions& options = {});

}  // namespace bilayer
