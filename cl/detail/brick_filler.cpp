// SPDX-License-Identifier: Apache-2.0
// Two batches of bricks alternate, each in its own queue: while the device fills one, the host receives the blocks of
// the other.
#include "cl/detail/brick_filler.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cl/detail/batch_memory.h"
#include "cl/detail/batch_plan.h"
#include "cl/detail/bins.h"
#include "cl/detail/enqueue.h"
#include "cl/detail/host_blocks.h"
#include "cl/detail/host_transfer.h"
#include "cl/detail/kernel_options.h"
#include "cl/detail/mapped_buffer.h"
#include "cl/detail/memory.h"
#include "cl/detail/queue_guard.h"
#include "cl/detail/timing.h"
#include "sdf/base/bit_orders.h"
#include "sdf/base/progress.h"
#include "sdf/fill/layer_samples.h"

namespace bilayer::detail {

// The texts of exact.cl and double_layer.cl.
extern const char* const exact_cl;
extern const char* const double_layer_cl;

namespace {

constexpr std::uint64_t scratchPart = 8;  // maximum fraction of the budget: 1 / scratchPart
/// The smallest cells for grouping pieces, and the maximum distance of a brick's samples beyond its reach [voxels].
constexpr float minCellSide = 1.1f, aroundBrick = 3;
/// Sizes in the kernels [bytes]: Piece of pieces.cl, Member and the columns of Groups in groups.cl, and the columns of
/// a sample in samples.cl, with its cell and without.
constexpr std::uint64_t pieceBytes = 112, memberBytes = 32, groupBytes = 32, unsortedSampleBytes = 32, sampleBytes = 28;
constexpr const char* batchPurpose = "a batch of bricks";  // of memory, for error texts

// `Layers` of layer_cubes.cl.
struct KernelLayers {
    cl_float delta, reach, certain;
    cl_int cube;
};

// A batch in flight with its own queue: when the kernels of one batch are nearly done, those of the other start.
struct BrickBatch {
    BatchSize size;
    BatchBuffers buffers;
    cl::Buffer scratch, next;
    BatchCounts counts;
    cl::Event counted;
    cl::CommandQueue queue;
    QueueGuard guard{queue};
    // For a device that shares the host's memory: a command directly after the kernels. PoCL's threads run one such
    // command before the next kernel, and others after it.
    std::optional<MappedBuffer> results;
};

class BrickFill {
  public:
    BrickFill(DeviceImpl& device, const OpenclOptions& options, const FillJob& job, const DeviceSink& keep);
    DeviceTimes run();

  private:
    void makeScratch();
    void reserve(BrickBatch& batch, const BatchSize& size);
    void enqueueKernels(BrickBatch& batch, std::size_t first);
    void start(BrickBatch& batch, const BatchPlan::Range& bricks);
    void finish(BrickBatch& batch);
    void keepOnDevice(BrickBatch& batch, std::size_t blocks);
    void passToHost(BrickBatch& batch, std::size_t blocks);

    template <class... Arguments>
    void enqueue(const cl::CommandQueue& queue, const char* name, std::size_t groups, const Arguments&... arguments) {
        const std::size_t items = mode_.gpuMapping ? groupItems : 1;
        enqueueKernel(device_, queue, program_, name, cl::NDRange(groups * items), cl::NDRange(items),
                      timing_.event(Timing::Command::kernel), arguments...);
    }

    DeviceImpl& device_;
    const FillJob& job_;
    const DeviceSink& keep_;
    const bool doubleLayer_;  // the method; else it is the exact one
    const BatchMode mode_;
    Timing timing_;
    DeviceMemory memory_;
    cl::Program program_;
    std::optional<DeviceBins> bins_;
    PartBytes bytes_;
    cl::Buffer orders_;  // bitOrders, for processors
    std::size_t scratchGroups_ = 0;
    cl_uint scratchCells_ = 0;
    std::optional<BatchPlan> plan_;
    HostTransfer toHost_;
    std::array<BrickBatch, batchesInFlight> batches_;
    std::vector<glm::ivec3> open_;  // blocks that the host fills
    QueueGuard guard_;              // of the device's queue
};

// The maximum distance between a voxel and a triangle that affects it. The cube of the paper extends beyond its ball.
float reachOf(const FillJob& job) {
    if (job.options.method != Method::doubleLayer) return job.input.reach;
    return job.layers.reach * (job.layers.cube > 0 ? std::sqrt(3.f) : 1.f);
}

// Count of the indices to the samples of each cell of a brick: cellsFor() of samples.cl.
std::uint64_t sampleCells(const BrickGrid& grid) {
    const int around = LayerSamples::cellsAround(float(grid.reach));
    const auto side = std::uint64_t((1 << grid.shift) / LayerSamples::cellSide + 2 * around);
    return side * side * side + 2;
}

BatchMode modeOf(const DeviceImpl& device, const OpenclOptions& options, const FillJob& job) {
    const bool gpuMapping = wantsGroups(device, options.mapping);
    return {gpuMapping, job.options.method == Method::doubleLayer && !gpuMapping, job.input.triangles};
}

BrickFill::BrickFill(DeviceImpl& device, const OpenclOptions& options, const FillJob& job, const DeviceSink& keep)
    : device_(device),
      job_(job),
      keep_(keep),
      doubleLayer_(job.options.method == Method::doubleLayer),
      mode_(modeOf(device, options, job)),
      timing_(options.profile),
      memory_(device, memoryBudget(device, options.memoryMiB)),
      program_(buildProgram(device, doubleLayer_ ? double_layer_cl : exact_cl,
                            commonBuildOptions(device, mode_.gpuMapping, mode_.triangles) +
                                (doubleLayer_ && job.layers.cube > 0 ? " -D PAPER_CUBE=1" : ""))),
      toHost_(device, job.input, timing_),
      guard_(device.queue) {
    const float reach = reachOf(job);
    if (mode_.fillsBricks)
        orders_ =
            memory_.upload(bitOrders.data(), sizeof bitOrders, batchPurpose, timing_.event(Timing::Command::upload));
    bins_.emplace(device, program_, memory_, job, reach, doubleLayer_ ? reach : reach + 1, mode_.gpuMapping, timing_);
    job.input.progress.begin(bins_->bricks());
    for (BrickBatch& batch : batches_) {
        batch.queue = cl::CommandQueue(device.context, device.device, CL_QUEUE_PROFILING_ENABLE);
        batch.next = memory_.allocate(sizeof(cl_uint), batchPurpose);
    }
    if (doubleLayer_) {
        bytes_ = {.unsorted = unsortedSampleBytes,
                  .columns = sampleBytes,
                  .brick = sampleCells(bins_->grid()) * sizeof(cl_uint)};
    } else {
        const auto slices = std::uint64_t(bins_->grid().blocksPerSide());
        bytes_ = {.piece = pieceBytes,
                  .unsorted = memberBytes,
                  .sorted = memberBytes,
                  .cell = sizeof(cl_uint),
                  .columns = groupBytes,
                  .groupBegin = sizeof(cl_uint),
                  .brick = slices * sizeof(cl_uint2)};
        makeScratch();
    }
    plan_.emplace(device.info, *bins_, memory_, bytes_, mode_);
}

// Allocates the cells that each group sorts the pieces of a brick by.
void BrickFill::makeScratch() {
    const float side = float(1 << bins_->grid().shift) + 2 * (float(bins_->grid().margin) + aroundBrick);
    const std::size_t cells = std::size_t(side / minCellSide) + 2;
    scratchCells_ = cl_uint(std::min<std::size_t>(cells * cells * cells, 1 << 20));
    const std::uint64_t bytes = std::uint64_t(scratchCells_) * sizeof(cl_uint);
    const std::size_t wanted = std::max(1u, device_.info.computeUnits) * groupsPerUnit;
    scratchGroups_ = std::clamp<std::size_t>(memory_.freeBytes() / batchesInFlight / scratchPart / bytes, 1, wanted);
    for (BrickBatch& batch : batches_)
        batch.scratch = memory_.allocate(scratchGroups_ * bytes, "grouping the triangles of a brick");
}

// Enlarges the buffers: to the size of any batch, if the batch's share of the memory allows.
void BrickFill::reserve(BrickBatch& batch, const BatchSize& size) {
    if (batch.buffers.capacity.covers(size)) return;
    batch.queue.finish();
    batch.buffers.freeAll(memory_);
    batch.buffers.allocate(memory_, plan_->capacityFor(size), bytes_, mode_.triangles);
}

void BrickFill::enqueueKernels(BrickBatch& batch, std::size_t first) {
    const BatchBuffers& b = batch.buffers;
    const cl_uint stride = cl_uint(b.capacity.slots), firstBrick = cl_uint(first), bricks = cl_uint(batch.size.bricks);
    const FillParameters& p = job_.layers;
    const KernelLayers layers{p.delta, p.reach, p.certain, p.cube};
    const DeviceBins& bins = *bins_;
    const auto prepare = [&](const char* name, std::size_t groups, const auto&... more) {
        enqueue(batch.queue, name, std::min<std::size_t>(groups, bricks), bins.points(), bins.triangles(), bins.grid(),
                bins.cellOfBrick(), bins.triangleOffsets(), bins.partOffsets(), bins.list(), firstBrick, bricks,
                more...);
    };
    const cl::Buffer& triangles = mode_.triangles ? b.triangles : b.origins;
    if (mode_.fillsBricks) {
        prepare("fillBricks", plan_->groupsFor(bricks), b.unsorted, b.columns, b.ofBricks, stride, batch.next, layers,
                cl_uint(batch.size.groupSlots), orders_, b.origins, b.distances, triangles, b.counts);
    } else if (doubleLayer_) {
        prepare("prepareBricks", bricks, b.unsorted, b.columns, b.ofBricks, stride, batch.next, layers);
        enqueue(batch.queue, "fillBlocks", batch.size.blocks, bins.grid(), bins.cellOfBrick(), bins.partOffsets(),
                firstBrick, b.columns, b.ofBricks, stride, layers, b.origins, b.distances, triangles, b.counts);
    } else {
        prepare("prepareBricks", scratchGroups_, b.parts, b.unsorted, b.sorted, b.cells, b.columns, b.begins, stride,
                batch.scratch, scratchCells_, b.ofBricks, batch.next);
        enqueue(batch.queue, "fillBlocks", batch.size.blocks, bins.points(), bins.triangles(), bins.grid(),
                bins.cellOfBrick(), firstBrick, b.parts, b.sorted, b.columns, b.begins, stride, b.ofBricks,
                cl_int(job_.input.sign), b.origins, b.distances, triangles, b.open, b.counts);
    }
}

// Enqueues the kernels of a batch, and the download of the number of its blocks.
void BrickFill::start(BrickBatch& batch, const BatchPlan::Range& bricks) {
    const BatchSize size = plan_->sizeOf(bricks);
    reserve(batch, size);
    batch.size = size;
    const BatchBuffers& b = batch.buffers;
    const cl_uint none = 0;
    batch.queue.enqueueFillBuffer(batch.next, none, 0, sizeof none);
    batch.queue.enqueueFillBuffer(b.counts, none, 0, sizeof batch.counts);
    enqueueKernels(batch, bricks.first);
    if (device_.info.unifiedMemory && !keep_) {
        const ResultLayout layout(b.capacity.blocks, mode_.triangles);
        batch.results.emplace(batch.queue, b.results, layout.end, timing_, batch.counted);
    } else {
        batch.queue.enqueueReadBuffer(b.counts, CL_FALSE, 0, sizeof batch.counts, &batch.counts, nullptr,
                                      &batch.counted);
        timing_.keep(Timing::Command::download, batch.counted);
    }
    batch.queue.flush();
}

// Waits for a batch in flight, and passes its blocks on, on the device or to the host.
void BrickFill::finish(BrickBatch& batch) {
    if (batch.size.bricks == 0) return;
    batch.counted.wait();
    if (batch.results) std::memcpy(&batch.counts, batch.results->data(), sizeof batch.counts);
    const std::size_t blocks = batch.counts.filledBlocks, open = batch.counts.openBlocks;
    if (job_.input.conflicts) *job_.input.conflicts += batch.counts.conflicts;
    if (open > 0) {
        const std::size_t before = open_.size();
        open_.resize(before + open);
        batch.queue.enqueueReadBuffer(batch.buffers.open, CL_TRUE, 0, open * sizeof(glm::ivec3), &open_[before],
                                      nullptr, timing_.event(Timing::Command::download));
    }
    job_.input.progress.poll();
    if (keep_)
        keepOnDevice(batch, blocks);
    else
        passToHost(batch, blocks);
    for (std::size_t brick = 0; brick < batch.size.bricks; ++brick) job_.input.progress.advance();
    batch.size = {};
}

// The batch is reused when the commands that read its blocks have ended.
void BrickFill::keepOnDevice(BrickBatch& batch, std::size_t blocks) {
    keep_(batch.buffers.origins, batch.buffers.distances, blocks);
    std::vector<cl::Event> kept(1);
    device_.queue.enqueueMarkerWithWaitList(nullptr, &kept[0]);
    device_.queue.flush();
    batch.queue.enqueueBarrierWithWaitList(&kept);
}

void BrickFill::passToHost(BrickBatch& batch, std::size_t blocks) {
    const BatchBuffers& buffers = batch.buffers;
    if (!batch.results) return toHost_.download(batch.queue, buffers, blocks);
    toHost_.pass(batch.results->data(), ResultLayout(buffers.capacity.blocks, mode_.triangles), blocks);
    batch.results.reset();
}

DeviceTimes BrickFill::run() {
    std::size_t next = 0;
    for (const BatchPlan::Range& bricks : plan_->ranges()) {
        BrickBatch& batch = batches_[next++ % batchesInFlight];
        finish(batch);
        start(batch, bricks);
    }
    for (std::size_t i = 0; i < batchesInFlight; ++i) finish(batches_[next++ % batchesInFlight]);
    const DeviceTimes times = timing_.total(memory_.peak());
    if (!open_.empty()) fillOnHost(job_, std::move(open_));
    return times;
}

}  // namespace

DeviceTimes fillByBricks(DeviceImpl& device, const OpenclOptions& options, const FillJob& job, const DeviceSink& keep) {
    requireDoubles(device.info, "which exact and double-layer need; prism does not");
    return BrickFill(device, options, job, keep).run();
}

}  // namespace bilayer::detail
