// A field on an OpenCL device, for those who sample many points at once; kernel in field.cl.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <memory>
#include <span>

#include <bilayer/cl/device.h>
#include <bilayer/cl/filler.h>
#include <bilayer/collider/query.h>
#include <bilayer/sdf/build.h>

namespace bilayer {

/// A field that stays in a device's memory. Copies share it.
class DeviceField {
  public:
    /// Lays the level set out as Field in collider/field.h does, and uploads it. A device that shares the host's memory
    /// uses the host's copy in place.
    /// @param options  `times` receives what the upload took
    /// Throws what Field's constructor throws, and DeviceError, which says how many MiB are needed where the memory is
    /// too small.
    DeviceField(const Device& device, const LevelSet& levelSet, const OpenclOptions& options = {});

    /// Builds the field of a mesh on the device, where it stays: only the mesh goes up, and only counts come down. It
    /// answers as that of build(mesh, build, openclFiller(device, options)); but where the double layer method's signs
    /// contradict each other, as on a mesh inside out, empty space may be on the other side. At its peak that takes
    /// about 1.7 times the memory of the field, and a quarter of what the options allow for the fill. The nearest
    /// triangles are not kept.
    /// @param options  `times` receives what the build took
    /// Throws what build() throws, and std::invalid_argument for what needs the processor: a method other than
    /// Method::exact and Method::doubleLayer, and signs other than from normals, also where those contradict each
    /// other.
    DeviceField(const Device& device, const Mesh& mesh, const BuildOptions& build, const OpenclOptions& options = {});

    /// Samples all points, as Field::sample() does one: the same values but for the device's rounding of square roots,
    /// which matters out of the band only. Points stream through the device: there is no limit to their number. Any
    /// thread may call it; calls on one field wait for each other.
    /// @param points  in the field's own coordinates [m]
    /// @param times   if not null, receives what it took
    /// Throws std::invalid_argument if `samples` is not as long as `points`, and DeviceError for the device's trouble.
    void sample(std::span<const glm::vec3> points, std::span<Sample> samples, OpenclTimes* times = nullptr) const;

    const Bounds& bounds() const;     ///< around all points in the band [m]
    std::size_t memoryBytes() const;  ///< on the device, with room for points under way

  private:
    struct Data;
    std::shared_ptr<Data> data_;
};

}  // namespace bilayer
