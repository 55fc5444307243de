// SPDX-License-Identifier: Apache-2.0
// Builds a field that stays on a device; kernels in field_build.cl.
// Tested by tests/cl/field.cpp through DeviceField.
#pragma once

#include <bilayer/sdf/build.h>
#include "cl/detail/memory.h"
#include "cl/detail/timing.h"
#include "collider/field/layout/field_layout.h"

namespace bilayer::detail {

/// `Frame` of layout.cl.
struct KernelFrame {
    cl_double origin[3], perMetre;
    cl_int blocks[3];
    cl_float voxelSize, exteriorWidth, interiorWidth;

    explicit KernelFrame(const FieldFrame& f)
        : origin{f.origin.x, f.origin.y, f.origin.z},
          perMetre(f.perMetre),
          blocks{f.blocks.x, f.blocks.y, f.blocks.z},
          voxelSize(f.voxelSize),
          exteriorWidth(f.exteriorWidth),
          interiorWidth(f.interiorWidth) {}
};

/// The arrays of a FieldLayout in a device's memory.
struct DeviceLayout {
    FieldFrame frame;
    cl::Buffer directory, centres, values;
};

/// Divisor of the memory budget: the fill's own work may take 1 / fillPart of it.
inline constexpr std::uint64_t fillPart = 4;

/// A field in a device's memory, and the times of its build.
struct BuiltDeviceField {
    DeviceLayout layout;
    DeviceTimes times;
};

/// Builds the field of a mesh on a device. Only the mesh is uploaded, and only counts are downloaded. The layout's
/// buffers come from `memory`, whose budget is that of the options less the fill's part.
///
/// Throws what build() throws, cl::Error, DeviceError, and std::invalid_argument if the method or the sign method needs
/// the processor.
BuiltDeviceField buildDeviceField(const Device& device, const Mesh& mesh, const BuildOptions& build,
                                  const OpenclOptions& options, DeviceMemory& memory);

}  // namespace bilayer::detail
