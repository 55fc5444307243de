// SPDX-License-Identifier: Apache-2.0
// Bins the triangles of a mesh by brick on a device; kernels in bins.cl.
// Tested by tests/cl/filler.cpp.
#pragma once

#include <cstdint>
#include <vector>

#include "cl/detail/memory.h"
#include "cl/detail/timing.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// `Grid` of bins.cl: the bricks along the axes, and the parameters of the binning.
struct BrickGrid {
    double voxelsPerUnit;  ///< [1/m]
    double reach;          ///< maximum distance of a voxel from a triangle [voxels]
    double margin;         ///< parts of triangles farther than this from a brick do not affect it [voxels]
    cl_int first[3];       ///< [bricks]
    cl_int size[3];        ///< [bricks]
    cl_int shift;          ///< edge of a brick: 2^shift voxels
    cl_uint triangles, cells, runs;
    struct {
        double epsilon;
        cl_int maxSubdivision, fillGaps, recursive;
    } sampling;  ///< options of the double layer method

    int blocksPerSide() const { return (1 << shift) / blockSide; }
};

/// The triangles of a mesh, binned by the bricks that they reach, on a device. Bricks without triangles are left out.
class DeviceBins {
  public:
    /// Uploads the mesh and bins its triangles.
    /// @param program   must include bins.cl
    /// @param margin    see BrickGrid
    DeviceBins(DeviceImpl& device, const cl::Program& program, DeviceMemory& memory, const FillJob& job, float reach,
               float margin, bool gpuMapping, Timing& timing);

    std::size_t bricks() const { return partOffsets_.size() - 1; }
    /// Index of the first part of a brick's triangles, over all bricks; for brick bricks() the count of all parts.
    std::uint64_t firstPart(std::size_t brick) const { return partOffsets_[brick]; }

    const BrickGrid& grid() const { return grid_; }
    const cl::Buffer& points() const { return points_; }
    const cl::Buffer& triangles() const { return triangles_; }
    const cl::Buffer& cellOfBrick() const { return cellOfBrick_; }
    const cl::Buffer& triangleOffsets() const { return triangleOffsets_; }
    const cl::Buffer& partOffsets() const { return partOffsetBuffer_; }
    const cl::Buffer& list() const { return list_; }  ///< the triangles of each brick

  private:
    BrickGrid grid_;
    cl::Buffer points_, triangles_, cellOfBrick_, triangleOffsets_, partOffsetBuffer_, list_;
    std::vector<cl_uint> partOffsets_;
};

}  // namespace bilayer::detail
