// Two batches of bricks alternate, each in its own queue: while the device fills one, the host receives the blocks of
// the other.
#include "cl/detail/brick_filler.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "cl/detail/bins.h"
#include "cl/detail/kernel_options.h"
#include "cl/detail/memory.h"
#include "cl/detail/timing.h"
#include "sdf/base/progress.h"
#include "sdf/fill/exact.h"

namespace bilayer::detail {

// The texts of exact.cl and double_layer.cl.
extern const char* const exact_cl;
extern const char* const double_layer_cl;

namespace {

constexpr std::size_t batchesInFlight = 2;
constexpr std::size_t blocksPerTask = 16;  // blocks that the host receives at once
/// Work-items of a group, lanes of a vector: ITEMS and LANES of common.cl.
constexpr std::size_t groupItems = 64, lanes = 16;
/// Maximum bricks in a batch: on a processor a few megabytes of results stay in its cache; on a GPU they are enough
/// work.
constexpr std::size_t bricksForProcessor = 40, bricksForGpu = 512;
/// Groups for each compute unit that fill bricks one after another, each with its own memory. PoCL gives the first unit
/// more than its share of groups; with one group per unit, other units would be idle.
constexpr std::size_t groupsPerUnit = 4;
constexpr std::uint64_t scratchPart = 8;  // maximum fraction of the budget: 1 / scratchPart
/// Maximum parts in a batch: the limit of a kernel's numbers, and for kernels that pass on a batch, the limit at which
/// the numbers stay in a processor's cache.
constexpr std::uint64_t partsInBatch = 1 << 27, partsForProcessor = 60000;
/// The smallest cells for grouping pieces, and the maximum distance of a brick's samples beyond its reach [voxels].
constexpr float smallestCell = 1.1f, aroundBrick = 3;

enum Counter { filledBlocks, openBlocks, conflicts, counters };

// Memory that the kernels of a method need [bytes].
struct KeptBytes {
    std::uint64_t part;      // of a part of a triangle: Piece of pieces.cl
    std::uint64_t unsorted;  // of a part: Member of groups.cl, Sample of samples.cl
    std::uint64_t sorted;    // of a part: Member again
    std::uint64_t cell;      // of a part: its cell
    std::uint64_t columns;   // of a part: columns of numbers, for a group at most as large or for a sample
    std::uint64_t begin;     // of a part: the first member of a group
    std::uint64_t brick;     // of a brick: the groups of each slice of blocks, or the first samples of its cells

    std::uint64_t perPart() const { return part + unsorted + sorted + cell + columns + begin; }
};

// `Layers` of double_layer.cl.
struct KernelLayers {
    cl_float delta, reach, certain;
    cl_int cube;
};

// The size of a batch of bricks, or the capacity of its buffers.
struct Load {
    std::uint64_t bricks = 0, parts = 0;
    std::uint64_t places = 0;  // slots for parts: vectors of a brick's last parts may extend beyond them
    std::uint64_t room = 0;    // size of the slots, for each group that fills whole bricks

    bool covers(const Load& other) const { return bricks >= other.bricks && places >= other.places; }
};

// Offsets of a batch's results in its buffer [bytes], aligned for any device.
struct ResultPlaces {
    std::uint64_t counts = 0, origins, open, distances, triangles, end;

    ResultPlaces(std::uint64_t blocks, bool withTriangles) {
        constexpr std::uint64_t alignment = 4096;
        const auto after = [](std::uint64_t begin, std::uint64_t bytes) {
            return begin + (bytes + alignment - 1) / alignment * alignment;
        };
        origins = after(counts, counters * sizeof(cl_uint));
        open = after(origins, blocks * sizeof(glm::ivec3));
        distances = after(open, blocks * sizeof(glm::ivec3));
        triangles = after(distances, blocks * blockVoxels * sizeof(float));
        end = withTriangles ? after(triangles, blocks * blockVoxels * sizeof(cl_int)) : triangles;
    }
};

struct Buffers {
    Load capacity;
    cl::Buffer parts, unsorted, sorted, cells, columns, begins, ofBricks, results;
    cl::Buffer counts, origins, open, distances, triangles;  // parts of the results

    void freeAll(DeviceMemory& memory) {
        for (cl::Buffer* part : {&counts, &origins, &open, &distances, &triangles}) *part = {};
        for (cl::Buffer* buffer : {&parts, &unsorted, &sorted, &cells, &columns, &begins, &ofBricks, &results})
            memory.free(*buffer);
    }
};

// Maps a buffer for the host, from the end of the queue's commands until destruction.
template <class Item>
class Mapped {
  public:
    /// @param mapped  if not null, receives the event of the mapping
    Mapped(const cl::CommandQueue& queue, const cl::Buffer& buffer, std::size_t count, Timing& timing,
           cl::Event* mapped = nullptr)
        : queue_(queue), buffer_(buffer) {
        if (count == 0) return;
        cl::Event event;
        data_ = queue.enqueueMapBuffer(buffer, CL_FALSE, CL_MAP_READ, 0, count * sizeof(Item), nullptr, &event);
        timing.keep(Timing::Of::download, event);
        if (mapped) *mapped = event;
    }
    Mapped(const Mapped&) = delete;
    Mapped& operator=(const Mapped&) = delete;
    ~Mapped() {
        if (data_) ::clEnqueueUnmapMemObject(queue_(), buffer_(), data_, 0, nullptr, nullptr);
    }
    const Item* data() const { return static_cast<const Item*>(data_); }

  private:
    const cl::CommandQueue& queue_;
    const cl::Buffer& buffer_;
    void* data_ = nullptr;
};

// A batch with its own queue: when the kernels of one batch are nearly done, those of the other start.
struct Batch {
    Load load;  // in flight
    Buffers buffers;
    cl::Buffer scratch, next;
    std::array<cl_uint, counters> found{};
    cl::Event counted;
    cl::CommandQueue queue;
    Ended ended{queue};
    // For a device that shares the host's memory: a command directly after the kernels. PoCL's threads run one such
    // command before the next kernel, and others after it.
    std::optional<Mapped<std::byte>> results;
};

// The results of a batch on the host.
struct Results {
    const glm::ivec3* origins;
    const float* distances;
    const std::int32_t* triangles;
};

class BrickFill {
  public:
    BrickFill(DeviceImpl& device, const OpenclOptions& options, const FillJob& job, const DeviceSink& keep);
    void run();

  private:
    std::uint64_t slices() const { return std::uint64_t(bins_->grid().blocksPerSide()); }
    std::uint64_t bytesOf(const Load& load) const;
    std::uint64_t blocksOf(const Load& load) const;
    bool fits(const Load& load) const;
    Load loadOf(std::size_t first, std::size_t last) const;
    std::size_t groupsFor(const Load& load) const;
    std::size_t lastFitting(std::size_t first) const;
    void makeScratch();
    void planBatches();
    void reserve(Batch& batch, const Load& load);
    void start(Batch& batch, std::size_t first, std::size_t last);
    void finish(Batch& batch);
    void keep(Batch& batch, std::size_t blocks);
    void handOver(Batch& batch, std::size_t blocks);
    void handOver(const Results& results, std::size_t blocks);
    void fillOpen();

    template <class... Arguments>
    void enqueue(const cl::CommandQueue& queue, const char* name, std::size_t groups, const Arguments&... arguments) {
        cl::Kernel kernel(program_, name);
        cl_uint index = 0;
        (kernel.setArg(index++, arguments), ...);
        const std::size_t items = gpuMapping_ ? groupItems : 1;
        queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(groups * items), cl::NDRange(items), nullptr,
                                   timing_.event(Timing::Of::kernel));
    }

    DeviceImpl& device_;
    const FillJob& job_;
    const DeviceSink& keep_;
    const bool gpuMapping_;
    OpenclTimes* times_;
    Timing timing_;
    DeviceMemory memory_;
    const bool layered_;      // the double layer method, else the exact one
    const bool fillsBricks_;  // whole bricks at once, else single blocks
    KeptBytes kept_{};
    cl::Program program_;
    std::optional<DeviceBins> bins_;
    cl::Buffer orders_;
    std::size_t scratchGroups_ = 0;
    cl_uint scratchCells_ = 0;
    std::uint64_t share_ = 0;                                // memory for one batch
    std::vector<std::pair<std::size_t, std::size_t>> runs_;  // runs of bricks, one per batch
    Load most_;                                              // maximum over all batches
    std::array<Batch, batchesInFlight> batches_;
    std::vector<glm::ivec3> open_;  // blocks that the host fills
    Ended ended_;                   // the device's queue
};

// The maximum distance between a voxel and a triangle that affects it. The cube of the paper extends beyond its ball.
float reachOf(const FillJob& job) {
    if (job.options.method != Method::doubleLayer) return job.mesh.reach;
    return job.layers.reach * (job.layers.cube > 0 ? std::sqrt(3.f) : 1.f);
}

// Count of the indices to the samples of each cell of a brick: cellsFor() of samples.cl.
std::uint64_t sampleCells(const BrickGrid& grid) {
    constexpr int cellSide = 4;  // [voxels]
    const int around = 1 + int(std::floor((float(grid.reach) - 0.4f) / float(cellSide)));
    const auto side = std::uint64_t((1 << grid.shift) / cellSide + 2 * around);
    return side * side * side + 2;
}

// For each byte value, the positions of its set bits in ascending order, one byte each: `orders` of double_layer.cl.
const std::array<cl_ulong, 256>& bitOrders() {
    static const std::array<cl_ulong, 256> orders = [] {
        std::array<cl_ulong, 256> made{};
        for (unsigned byte = 0; byte < made.size(); ++byte)
            for (unsigned bit = 0, at = 0; bit < 8; ++bit)
                if (byte >> bit & 1) made[byte] |= cl_ulong(bit) << 8 * at++;
        return made;
    }();
    return orders;
}

BrickFill::BrickFill(DeviceImpl& device, const OpenclOptions& options, const FillJob& job, const DeviceSink& keep)
    : device_(device),
      job_(job),
      keep_(keep),
      gpuMapping_(wantsGroups(device, options.mapping)),
      times_(options.times),
      timing_(options.times),
      memory_(device, memoryBudget(device, options.memoryMiB)),
      layered_(job.options.method == Method::doubleLayer),
      fillsBricks_(layered_ && !gpuMapping_),
      program_(buildProgram(device, layered_ ? double_layer_cl : exact_cl,
                            commonBuildOptions(device, gpuMapping_, job.mesh.triangles) +
                                (layered_ && job.layers.cube > 0 ? " -D PAPER_CUBE=1" : ""))),
      ended_(device.queue) {
    const float reach = reachOf(job);
    if (layered_)
        orders_ = memory_.upload(bitOrders().data(), sizeof bitOrders(), "a batch of bricks",
                                 timing_.event(Timing::Of::upload));
    bins_.emplace(device, program_, memory_, job, reach, layered_ ? reach : reach + 1, gpuMapping_, timing_);
    job.mesh.progress.begin(bins_->bricks());
    for (Batch& batch : batches_) {
        batch.queue = cl::CommandQueue(device.context, device.device, CL_QUEUE_PROFILING_ENABLE);
        batch.next = memory_.allocate(sizeof(cl_uint), "a batch of bricks");
    }
    if (layered_) {
        kept_ = {0, 32, 0, 0, 28, 0, sampleCells(bins_->grid()) * sizeof(cl_uint)};
    } else {
        kept_ = {112, 32, 32, sizeof(cl_uint), 32, sizeof(cl_uint), slices() * sizeof(cl_uint2)};
        makeScratch();
    }
    share_ = memory_.left() / batchesInFlight;
    planBatches();
}

void BrickFill::makeScratch() {
    const float side = float(1 << bins_->grid().shift) + 2 * (float(bins_->grid().margin) + aroundBrick);
    const std::size_t cells = std::size_t(side / smallestCell) + 2;
    scratchCells_ = cl_uint(std::min<std::size_t>(cells * cells * cells, 1 << 20));
    const std::uint64_t bytes = std::uint64_t(scratchCells_) * sizeof(cl_uint);
    const std::size_t wanted = std::max(1u, device_.info.computeUnits) * groupsPerUnit;
    scratchGroups_ = std::clamp<std::size_t>(memory_.left() / batchesInFlight / scratchPart / bytes, 1, wanted);
    for (Batch& batch : batches_)
        batch.scratch = memory_.allocate(scratchGroups_ * bytes, "grouping the triangles of a brick");
}

std::uint64_t BrickFill::bytesOf(const Load& load) const {
    return load.places * kept_.perPart() + load.bricks * kept_.brick +
           ResultPlaces(blocksOf(load), job_.mesh.triangles).end;
}

std::uint64_t BrickFill::blocksOf(const Load& load) const {
    return load.bricks * slices() * slices() * slices();
}

Load BrickFill::loadOf(std::size_t first, std::size_t last) const {
    Load load{last - first, bins_->firstPart(last) - bins_->firstPart(first)};
    load.places = load.parts + load.bricks * lanes;
    if (!fillsBricks_) return load;
    for (std::size_t brick = first; brick < last; ++brick)
        load.room = std::max(load.room, bins_->firstPart(brick + 1) - bins_->firstPart(brick) + lanes);
    load.places = load.room * groupsFor(load);
    return load;
}

// Count of the groups that fill the bricks of a batch one after another.
std::size_t BrickFill::groupsFor(const Load& load) const {
    return std::min<std::size_t>(load.bricks, std::max(1u, device_.info.computeUnits) * groupsPerUnit);
}

// Whether a batch of this size fits its share of the memory and the largest buffer.
bool BrickFill::fits(const Load& load) const {
    const std::uint64_t largest = std::max(ResultPlaces(blocksOf(load), job_.mesh.triangles).end,
                                           load.places * std::max(kept_.part, kept_.columns));
    return std::max(load.parts, load.places) < partsInBatch && bytesOf(load) <= share_ &&
           largest <= device_.info.maxAllocationBytes;
}

// The end of the run of bricks from `first` on that fits into one batch.
std::size_t BrickFill::lastFitting(std::size_t first) const {
    if (!fits(loadOf(first, first + 1)))
        memory_.refuse(batchesInFlight * bytesOf(loadOf(first, first + 1)), "a brick of the grid");
    const std::size_t end = std::min(bins_->bricks(), first + (gpuMapping_ ? bricksForGpu : bricksForProcessor));
    const std::uint64_t maxParts = gpuMapping_ || fillsBricks_ ? partsInBatch : partsForProcessor;
    std::size_t last = first + 1;
    while (last < end && fits(loadOf(first, last + 1)) && loadOf(first, last + 1).parts < maxParts) ++last;
    return last;
}

void BrickFill::planBatches() {
    for (std::size_t first = 0, last; first < bins_->bricks(); first = last) {
        last = lastFitting(first);
        runs_.emplace_back(first, last);
        const Load load = loadOf(first, last);
        most_ = {std::max(most_.bricks, load.bricks), std::max(most_.parts, load.parts),
                 std::max(most_.places, load.places)};
    }
}

// Enlarges the buffers: to the size of any batch, if the batch's share of the memory allows.
void BrickFill::reserve(Batch& batch, const Load& load) {
    Buffers& b = batch.buffers;
    if (b.capacity.covers(load)) return;
    batch.queue.finish();
    b.freeAll(memory_);
    b.capacity = fits(most_) ? most_ : load;
    const Load& c = b.capacity;
    const auto buffer = [&](std::uint64_t bytes) { return memory_.allocate(bytes, "a batch of bricks"); };
    for (const auto& [part, bytes] : {std::pair{&b.parts, kept_.part},
                                      {&b.unsorted, kept_.unsorted},
                                      {&b.sorted, kept_.sorted},
                                      {&b.cells, kept_.cell},
                                      {&b.columns, kept_.columns},
                                      {&b.begins, kept_.begin}})
        if (bytes > 0) *part = buffer(c.places * bytes);
    b.ofBricks = buffer(c.bricks * kept_.brick);
    const ResultPlaces places(blocksOf(c), job_.mesh.triangles);
    b.results = buffer(places.end);
    const auto part = [&](std::uint64_t begin, std::uint64_t end) {
        const cl_buffer_region region{std::size_t(begin), std::size_t(end - begin)};
        return b.results.createSubBuffer(CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &region);
    };
    b.counts = part(places.counts, places.origins);
    b.origins = part(places.origins, places.open);
    b.open = part(places.open, places.distances);
    b.distances = part(places.distances, places.triangles);
    if (job_.mesh.triangles) b.triangles = part(places.triangles, places.end);
}

// Enqueues the kernels of a batch, and the download of the number of its blocks.
void BrickFill::start(Batch& batch, std::size_t first, std::size_t last) {
    const Load load = loadOf(first, last);
    reserve(batch, load);
    batch.load = load;
    const Buffers& b = batch.buffers;
    const cl_uint none = 0, stride = cl_uint(b.capacity.places), firstBrick = cl_uint(first),
                  bricks = cl_uint(load.bricks);
    batch.queue.enqueueFillBuffer(batch.next, none, 0, sizeof none);
    batch.queue.enqueueFillBuffer(b.counts, none, 0, counters * sizeof none);
    const FillParameters& p = job_.layers;
    const KernelLayers layers{p.delta, p.reach, p.certain, p.cube};
    const DeviceBins& bins = *bins_;
    const auto prepare = [&](const char* name, std::size_t groups, const auto&... more) {
        enqueue(batch.queue, name, std::min<std::size_t>(groups, bricks), bins.points(), bins.triangles(), bins.grid(),
                bins.cellOfBrick(), bins.triangleOffsets(), bins.partOffsets(), bins.list(), firstBrick, bricks,
                more...);
    };
    const cl::Buffer& triangles = job_.mesh.triangles ? b.triangles : b.origins;
    if (fillsBricks_) {
        prepare("fillBricks", groupsFor(load), b.unsorted, b.columns, b.ofBricks, stride, batch.next, layers,
                cl_uint(load.room), orders_, b.origins, b.distances, triangles, b.counts);
    } else if (layered_) {
        prepare("prepareBricks", bricks, b.unsorted, b.columns, b.ofBricks, stride, batch.next, layers);
        enqueue(batch.queue, "fillBlocks", blocksOf(load), bins.grid(), bins.cellOfBrick(), bins.partOffsets(),
                firstBrick, b.columns, b.ofBricks, stride, layers, orders_, b.origins, b.distances, triangles,
                b.counts);
    } else {
        prepare("prepareBricks", scratchGroups_, b.parts, b.unsorted, b.sorted, b.cells, b.columns, b.begins, stride,
                batch.scratch, scratchCells_, b.ofBricks, batch.next);
        enqueue(batch.queue, "fillBlocks", blocksOf(load), bins.points(), bins.triangles(), bins.grid(),
                bins.cellOfBrick(), firstBrick, b.parts, b.sorted, b.columns, b.begins, stride, b.ofBricks,
                cl_int(job_.mesh.sign), b.origins, b.distances, triangles, b.open, b.counts);
    }
    if (device_.info.unifiedMemory && !keep_) {
        const ResultPlaces places(blocksOf(b.capacity), job_.mesh.triangles);
        batch.results.emplace(batch.queue, b.results, places.end, timing_, &batch.counted);
    } else {
        batch.queue.enqueueReadBuffer(b.counts, CL_FALSE, 0, sizeof batch.found, batch.found.data(), nullptr,
                                      &batch.counted);
        timing_.keep(Timing::Of::download, batch.counted);
    }
    batch.queue.flush();
}

// Waits for a batch in flight, and passes its blocks on, on the device or to the host.
void BrickFill::finish(Batch& batch) {
    if (batch.load.bricks == 0) return;
    batch.counted.wait();
    if (batch.results) std::memcpy(batch.found.data(), batch.results->data(), sizeof batch.found);
    const std::size_t blocks = batch.found[filledBlocks], open = batch.found[openBlocks];
    if (job_.mesh.conflicts) *job_.mesh.conflicts += batch.found[conflicts];
    if (open > 0) {
        const Mapped<glm::ivec3> openOrigins(batch.queue, batch.buffers.open, open, timing_);
        batch.queue.finish();
        open_.insert(open_.end(), openOrigins.data(), openOrigins.data() + open);
    }
    job_.mesh.progress.poll();
    if (keep_)
        keep(batch, blocks);
    else
        handOver(batch, blocks);
    for (std::size_t brick = 0; brick < batch.load.bricks; ++brick) job_.mesh.progress.advance();
    batch.load = {};
}

// Keeps blocks on the device. The batch is reused when the commands that read its blocks have ended.
void BrickFill::keep(Batch& batch, std::size_t blocks) {
    keep_(batch.buffers.origins, batch.buffers.distances, blocks);
    std::vector<cl::Event> kept(1);
    device_.queue.enqueueMarkerWithWaitList(nullptr, &kept[0]);
    device_.queue.flush();
    batch.queue.enqueueBarrierWithWaitList(&kept);
}

// Passes blocks to the host.
void BrickFill::handOver(Batch& batch, std::size_t blocks) {
    const Buffers& b = batch.buffers;
    if (batch.results) {
        const ResultPlaces places(blocksOf(b.capacity), job_.mesh.triangles);
        const std::byte* all = batch.results->data();
        handOver(Results{reinterpret_cast<const glm::ivec3*>(all + places.origins),
                         reinterpret_cast<const float*>(all + places.distances),
                         reinterpret_cast<const std::int32_t*>(all + places.triangles)},
                 blocks);
        batch.results.reset();
        return;
    }
    const Mapped<glm::ivec3> origins(batch.queue, b.origins, blocks, timing_);
    const Mapped<float> distances(batch.queue, b.distances, blocks * blockVoxels, timing_);
    const Mapped<std::int32_t> triangles(batch.queue, b.triangles, job_.mesh.triangles ? blocks * blockVoxels : 0,
                                         timing_);
    batch.queue.finish();
    handOver(Results{origins.data(), distances.data(), triangles.data()}, blocks);
}

void BrickFill::handOver(const Results& results, std::size_t blocks) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, blocks, blocksPerTask), [&](const auto& range) {
        job_.mesh.progress.poll();
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            if (results.origins[i].x == noBlock) continue;
            const auto values = [&](const auto* all) { return std::span(all + i * blockVoxels, blockVoxels); };
            job_.mesh.sink({{results.origins + i, 1},
                            values(results.distances),
                            job_.mesh.triangles ? values(results.triangles) : std::span<const std::int32_t>()});
        }
    });
}

void BrickFill::run() {
    std::size_t turn = 0;
    for (const auto& [first, last] : runs_) {
        Batch& batch = batches_[turn++ % batchesInFlight];
        finish(batch);
        start(batch, first, last);
    }
    for (std::size_t i = 0; i < batchesInFlight; ++i) finish(batches_[turn++ % batchesInFlight]);
    timing_.sumUp();
    if (times_) times_->peakBytes = std::max(times_->peakBytes, memory_.peak());
    if (!open_.empty()) fillOpen();
}

// Fills blocks on the processor whose inside/outside classification is not decided by nearby triangles; the processor
// uses the whole mesh.
void BrickFill::fillOpen() {
    const auto before = [](const glm::ivec3& a, const glm::ivec3& b) {
        return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
    };
    std::sort(open_.begin(), open_.end(), before);
    MeshJob job = job_.mesh;
    job.wanted = [&](const glm::ivec3& first, int side) {
        if (side == blockSide) return std::binary_search(open_.begin(), open_.end(), first, before);
        return std::any_of(open_.begin(), open_.end(), [&](const glm::ivec3& block) {
            const glm::ivec3 away = block - first;
            return std::min({away.x, away.y, away.z}) >= 0 && std::max({away.x, away.y, away.z}) < side;
        });
    };
    fillExact(job, job_.box);
}

}  // namespace

void fillByBricks(DeviceImpl& device, const OpenclOptions& options, const FillJob& job, const DeviceSink& keep) {
    if (!device.info.doubles)
        throw DeviceError(device.info.name +
                          " cannot compute in double precision, which exact and double-layer need; prism does not");
    BrickFill(device, options, job, keep).run();
}

}  // namespace bilayer::detail
