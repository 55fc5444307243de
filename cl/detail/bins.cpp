// SPDX-License-Identifier: Apache-2.0
#include "cl/detail/bins.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "cl/detail/enqueue.h"
#include "cl/detail/kernel_options.h"
#include "sdf/fill/triangle_bins.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t runsPerUnit = 8;      // enough to balance unequal runs
constexpr std::size_t itemsPerUnit = 2048;  // items that a GPU's unit holds

BrickGrid gridFor(const FillJob& job, float reach, float margin) {
    BrickGrid grid{};
    grid.voxelsPerUnit = 1.0 / double(job.input.voxelSize);
    grid.reach = double(reach);
    grid.margin = double(margin);
    const int side = brickSideFor(job.box, grid.voxelsPerUnit, reach);
    while (1 << grid.shift < side) ++grid.shift;
    grid.cells = 1;
    for (int axis = 0; axis < 3; ++axis) {
        const auto brick = [&](double coordinate) { return int(std::floor(coordinate)) >> grid.shift; };
        grid.first[axis] = brick(double(job.box.lower[axis]) * grid.voxelsPerUnit - grid.reach);
        grid.size[axis] = brick(double(job.box.upper[axis]) * grid.voxelsPerUnit + grid.reach) - grid.first[axis] + 1;
        grid.cells *= cl_uint(grid.size[axis]);
    }
    grid.triangles = cl_uint(job.input.mesh.triangles.size());
    const DoubleLayerOptions& layers = job.options.doubleLayer;
    grid.sampling = {double(layers.epsilon), layers.maxSubdivision, layers.fillGaps,
                     layers.subdivision == Subdivision::recursive};
    return grid;
}

}  // namespace

DeviceBins::DeviceBins(DeviceImpl& device, const cl::Program& program, DeviceMemory& memory, const FillJob& job,
                       float reach, float margin, bool gpuMapping, Timing& timing)
    : grid_(gridFor(job, reach, margin)) {
    const Mesh& mesh = job.input.mesh;
    const cl::CommandQueue& queue = device.queue;
    const std::size_t units = std::max(1u, device.info.computeUnits), count = mesh.triangles.size();
    const std::size_t items =
        gpuMapping ? std::min((count + groupItems - 1) / groupItems * groupItems, units * itemsPerUnit)
                   : std::max<std::size_t>(1, std::min({units * runsPerUnit, maxBinCounters / grid_.cells,
                                                        (count + trianglesPerRun - 1) / trianglesPerRun}));
    grid_.runs = gpuMapping ? 1 : cl_uint(items);
    const auto uploaded = [&](const auto& data) {
        return memory.upload(data.data(), data.size() * sizeof data[0], "the mesh",
                             timing.event(Timing::Command::upload));
    };
    points_ = uploaded(mesh.points);
    triangles_ = uploaded(mesh.triangles);

    const std::uint64_t cursorBytes = std::uint64_t(grid_.runs) * grid_.cells * sizeof(cl_uint),
                        cellBytes = std::uint64_t(grid_.cells) * sizeof(cl_uint);
    const auto bins = [&](std::uint64_t bytes) { return memory.allocate(bytes, "the binning of the mesh"); };
    cl::Buffer cursors = bins(cursorBytes), extraParts = bins(cellBytes), total = bins(3 * sizeof(cl_ulong)),
               codes = bins(count * sizeof(cl_uint));
    cellOfBrick_ = bins(cellBytes);
    triangleOffsets_ = bins(cellBytes + sizeof(cl_uint));
    partOffsetBuffer_ = bins(cellBytes + sizeof(cl_uint));
    queue.enqueueFillBuffer(cursors, cl_uint(0), 0, cursorBytes);
    queue.enqueueFillBuffer(extraParts, cl_uint(0), 0, cellBytes);
    const auto run = [&](const char* name, std::size_t global, std::size_t local, const auto&... arguments) {
        enqueueKernel(device, queue, program, name, cl::NDRange(global), cl::NDRange(local),
                      timing.event(Timing::Command::kernel), arguments...);
    };
    const std::size_t local = gpuMapping ? groupItems : 1;
    run("countTriangles", items, local, points_, triangles_, grid_, cursors, extraParts, codes);
    run("scanBricks", local, local, grid_, cursors, extraParts, cellOfBrick_, triangleOffsets_, partOffsetBuffer_,
        total);
    std::array<cl_ulong, 3> totals{};
    queue.enqueueReadBuffer(total, CL_TRUE, 0, sizeof totals, totals.data(), nullptr,
                            timing.event(Timing::Command::download));
    const auto [bricks, entries, parts] = totals;
    if (const cl_ulong count = std::max(entries, parts); count > std::numeric_limits<cl_uint>::max())
        memory.refuse(count * sizeof(cl_uint), "the binning of the mesh");
    list_ = bins(std::max<std::uint64_t>(1, entries) * sizeof(cl_uint));
    run("listTriangles", items, local, points_, triangles_, grid_, cursors, codes, list_);
    partOffsets_.resize(bricks + 1);
    queue.enqueueReadBuffer(partOffsetBuffer_, CL_TRUE, 0, partOffsets_.size() * sizeof(cl_uint), partOffsets_.data(),
                            nullptr, timing.event(Timing::Command::download));
    for (cl::Buffer* buffer : {&cursors, &extraParts, &total, &codes}) memory.free(*buffer);
}

}  // namespace bilayer::detail
