// SPDX-License-Identifier: Apache-2.0
// Blocks stream through the device in batches of whole bricks. Two batches alternate: while the device fills one, the
// host makes the prisms of the next and passes on the previous one.
#include "cl/detail/prism.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "cl/detail/kernel_options.h"
#include "cl/detail/memory.h"
#include "cl/detail/prism_bins.h"
#include "cl/detail/queue_guard.h"
#include "cl/detail/timing.h"
#include "sdf/base/progress.h"
#include "sdf/fill/triangle_bins.h"

namespace bilayer::detail {

extern const char* const prism_cl;  // the text of prism.cl

namespace {

constexpr std::size_t windowBricks = 128;  // prepared at once: a few thousand blocks, enough to keep a large GPU busy
constexpr std::size_t itemsPerBlock = 64;  // one item per row, as in the kernel

// The size of a batch, and its memory on the device.
struct PrismBatchSize {
    std::uint64_t blocks = 0, prisms = 0, entries = 0;

    PrismBatchSize operator+(const PrismBatchSize& other) const {
        return {blocks + other.blocks, prisms + other.prisms, entries + other.entries};
    }
    PrismBatchSize atLeast(const PrismBatchSize& other) const {
        return {std::max(blocks, other.blocks), std::max(prisms, other.prisms), std::max(entries, other.entries)};
    }
    bool operator==(const PrismBatchSize&) const = default;
    std::uint64_t resultBytes() const { return blocks * blockVoxels * sizeof(float); }
    std::uint64_t prismBytes() const { return prisms * sizeof(Prism); }
    std::uint64_t entryBytes() const { return entries * sizeof(cl_uint); }
    std::uint64_t placeBytes() const { return blocks * sizeof(glm::ivec3); }
    std::uint64_t offsetBytes() const { return (blocks + 1) * sizeof(cl_uint); }
    std::uint64_t bytes(bool triangles) const {
        return resultBytes() * (triangles ? 2 : 1) + prismBytes() + entryBytes() + placeBytes() + offsetBytes();
    }
    std::uint64_t largestBuffer() const { return std::max({resultBytes(), prismBytes(), entryBytes()}); }
};

PrismBatchSize sizeOf(const PrismBlocks& blocks) {
    return {blocks.places.size(), blocks.prisms.size(), blocks.reaching.size()};
}

struct PrismBatch {
    std::vector<PrismBatchSize> begins;  // sum of the sizes before each brick, and the total
    std::vector<glm::ivec3> origins;     // of blocks
    PrismBatchSize capacity;             // of the buffers
    cl::Buffer prismBuffer, placeBuffer, offsetBuffer, reachingBuffer, distanceBuffer, triangleBuffer;
    const float* distances = nullptr;         // mapped after `filled`
    const std::int32_t* triangles = nullptr;  // likewise
    cl::Event filled;

    std::size_t bricks() const { return begins.empty() ? 0 : begins.size() - 1; }
    PrismBatchSize size() const { return begins.back(); }
};

class PrismFill {
  public:
    PrismFill(DeviceImpl& device, const OpenclOptions& options, const PrismJob& job, const MeshJob& mesh,
              const TriangleBins& bins);
    DeviceTimes run();

  private:
    void prepare(std::size_t first, std::size_t last);
    bool fits(const PrismBatchSize& size) const;
    std::size_t lastFitting(std::size_t first) const;
    void assign(PrismBatch& batch, std::size_t first, std::size_t last) const;
    void reserve(PrismBatch& batch);
    std::vector<cl::Event> upload(PrismBatch& batch, std::size_t first);
    void start(PrismBatch& batch, std::size_t first);
    void finish(PrismBatch& batch);

    DeviceImpl& device_;
    const PrismJob job_;
    const MeshJob& mesh_;
    const TriangleBins& bins_;
    const bool groups_;
    Timing timing_;
    DeviceMemory memory_;
    const std::uint64_t share_;  // of the memory, for a batch [bytes]
    cl::Kernel kernel_;
    // in addition to the device's own, so that a batch is uploaded while another is filled
    cl::CommandQueue uploads_;
    std::vector<PrismBlocks> window_;  // the bricks from firstPrepared_ on
    std::size_t firstPrepared_ = 0;
    std::array<PrismBatch, batchesInFlight> batches_;
    QueueGuard fillGuard_, uploadGuard_;  // the device's queue, and that of the uploads
};

PrismFill::PrismFill(DeviceImpl& device, const OpenclOptions& options, const PrismJob& job, const MeshJob& mesh,
                     const TriangleBins& bins)
    : device_(device),
      job_(job),
      mesh_(mesh),
      bins_(bins),
      groups_(wantsGroups(device, options.mapping)),
      timing_(options.profile),
      memory_(device, memoryBudget(device, options.memoryMiB)),
      share_(memory_.freeBytes() / batchesInFlight),
      kernel_(buildProgram(device, prism_cl, commonBuildOptions(device, groups_, mesh.triangles)), "fillBlocks"),
      uploads_(device.context, device.device, CL_QUEUE_PROFILING_ENABLE),
      fillGuard_(device.queue),
      uploadGuard_(uploads_) {}

DeviceTimes PrismFill::run() {
    std::size_t next = 0;
    for (std::size_t first = 0; first < bins_.count(); first += windowBricks) {
        const std::size_t last = std::min(first + windowBricks, bins_.count());
        prepare(first, last);
        for (std::size_t from = first, to; from < last; from = to) {
            to = lastFitting(from);
            PrismBatch& batch = batches_[next++ % batchesInFlight];
            finish(batch);
            assign(batch, from, to);
            start(batch, from);
        }
    }
    for (std::size_t i = 0; i < batchesInFlight; ++i) finish(batches_[next++ % batchesInFlight]);
    device_.queue.finish();
    return timing_.total(memory_.peak());
}

void PrismFill::prepare(std::size_t first, std::size_t last) {
    firstPrepared_ = first;
    window_.resize(std::max(window_.size(), last - first));
    tbb::parallel_for(first, last, [&](std::size_t brick) {
        mesh_.progress.poll();
        binPrisms(job_, bins_, brick, window_[brick - first]);
    });
}

// Whether a batch of this size fits its share of the memory, the largest buffer, and the kernel's 32-bit indices.
bool PrismFill::fits(const PrismBatchSize& size) const {
    return size.bytes(mesh_.triangles) <= share_ && size.largestBuffer() <= device_.info.maxAllocationBytes &&
           std::max(size.entries, size.prisms) <= std::numeric_limits<cl_uint>::max();
}

// The end of the range of prepared bricks from `first` on that fits into one batch.
std::size_t PrismFill::lastFitting(std::size_t first) const {
    const std::size_t end = std::min(firstPrepared_ + windowBricks, bins_.count());
    PrismBatchSize size = sizeOf(window_[first - firstPrepared_]);
    if (!fits(size))
        memory_.refuse(std::max(batchesInFlight * size.bytes(mesh_.triangles), size.largestBuffer()),
                       "a brick of prisms");
    std::size_t last = first + 1;
    for (; last < end; ++last) {
        size = size + sizeOf(window_[last - firstPrepared_]);
        if (!fits(size)) break;
    }
    return last;
}

// Sets the content of a batch: the bricks' blocks.
void PrismFill::assign(PrismBatch& batch, std::size_t first, std::size_t last) const {
    batch.begins.assign(1, {});
    for (std::size_t brick = first; brick < last; ++brick) {
        const PrismBlocks& blocks = window_[brick - firstPrepared_];
        std::transform(blocks.places.begin(), blocks.places.end(), std::back_inserter(batch.origins),
                       [&](const glm::ivec3& place) { return bins_.origins[brick] + place; });
        batch.begins.push_back(batch.begins.back() + sizeOf(blocks));
    }
}

// Enlarges the buffers, up to the batch's share of the memory.
void PrismFill::reserve(PrismBatch& batch) {
    const PrismBatchSize size = batch.size(), grown = size.atLeast(batch.capacity);
    if (grown == batch.capacity) return;
    device_.queue.finish();
    for (cl::Buffer* buffer : {&batch.prismBuffer, &batch.placeBuffer, &batch.offsetBuffer, &batch.reachingBuffer,
                               &batch.distanceBuffer, &batch.triangleBuffer})
        memory_.free(*buffer);
    batch.capacity = fits(grown) ? grown : size;
    const auto buffer = [&](std::uint64_t bytes) { return memory_.allocate(bytes, "a batch of bricks"); };
    batch.prismBuffer = buffer(batch.capacity.prismBytes());
    batch.placeBuffer = buffer(batch.capacity.placeBytes());
    batch.offsetBuffer = buffer(batch.capacity.offsetBytes());
    batch.reachingBuffer = buffer(batch.capacity.entryBytes());
    batch.distanceBuffer = buffer(batch.capacity.resultBytes());
    if (mesh_.triangles) batch.triangleBuffer = buffer(batch.capacity.resultBytes());
}

// Writes the bricks' prisms and lists directly to the memory of the device or its driver.
std::vector<cl::Event> PrismFill::upload(PrismBatch& batch, std::size_t first) {
    const PrismBatchSize size = batch.size();
    const auto mapped = [&](const cl::Buffer& buffer, std::uint64_t bytes) {
        return uploads_.enqueueMapBuffer(buffer, CL_TRUE, CL_MAP_WRITE_INVALIDATE_REGION, 0, bytes);
    };
    auto* const prisms = static_cast<Prism*>(mapped(batch.prismBuffer, size.prismBytes()));
    auto* const places = static_cast<glm::ivec3*>(mapped(batch.placeBuffer, size.placeBytes()));
    auto* const offsets = static_cast<cl_uint*>(mapped(batch.offsetBuffer, size.offsetBytes()));
    auto* const reaching = static_cast<cl_uint*>(mapped(batch.reachingBuffer, size.entryBytes()));
    offsets[0] = 0;
    tbb::parallel_for(std::size_t(0), batch.bricks(), [&](std::size_t brick) {
        const PrismBatchSize& begin = batch.begins[brick];
        const PrismBlocks& blocks = window_[first + brick - firstPrepared_];
        std::copy(blocks.prisms.begin(), blocks.prisms.end(), prisms + begin.prisms);
        std::copy(blocks.places.begin(), blocks.places.end(), places + begin.blocks);
        std::transform(blocks.offsets.begin() + 1, blocks.offsets.end(), offsets + begin.blocks + 1,
                       [&](cl_uint offset) { return cl_uint(begin.entries) + offset; });
        std::transform(blocks.reaching.begin(), blocks.reaching.end(), reaching + begin.entries,
                       [&](cl_uint prism) { return cl_uint(begin.prisms) + prism; });
    });
    std::vector<cl::Event> uploaded(4);
    uploads_.enqueueUnmapMemObject(batch.prismBuffer, prisms, nullptr, &uploaded[0]);
    uploads_.enqueueUnmapMemObject(batch.placeBuffer, places, nullptr, &uploaded[1]);
    uploads_.enqueueUnmapMemObject(batch.offsetBuffer, offsets, nullptr, &uploaded[2]);
    uploads_.enqueueUnmapMemObject(batch.reachingBuffer, reaching, nullptr, &uploaded[3]);
    uploads_.flush();
    for (const cl::Event& event : uploaded) timing_.keep(Timing::Command::upload, event);
    return uploaded;
}

// Enqueues a batch: upload of prisms and lists, kernel, download of distances.
void PrismFill::start(PrismBatch& batch, std::size_t first) {
    const std::size_t blocks = batch.origins.size();
    if (blocks == 0) return;
    reserve(batch);
    const std::vector<cl::Event> uploaded = upload(batch, first);

    cl_uint argument = 0;
    for (const cl::Buffer* buffer :
         {&batch.prismBuffer, &batch.placeBuffer, &batch.offsetBuffer, &batch.reachingBuffer})
        kernel_.setArg(argument++, *buffer);
    kernel_.setArg(argument++, cl_float(job_.reach));
    kernel_.setArg(argument++, batch.distanceBuffer);
    kernel_.setArg(argument++, batch.triangleBuffer);
    const std::size_t items = groups_ ? itemsPerBlock : 1;
    device_.queue.enqueueNDRangeKernel(kernel_, cl::NullRange, cl::NDRange(blocks * items), cl::NDRange(items),
                                       &uploaded, timing_.event(Timing::Command::kernel));

    // mapping copies nothing in shared memory
    const auto mapped = [&](const cl::Buffer& buffer) {
        return device_.queue.enqueueMapBuffer(buffer, CL_FALSE, CL_MAP_READ, 0, batch.size().resultBytes(), nullptr,
                                              &batch.filled);
    };
    if (mesh_.triangles) {
        batch.triangles = static_cast<const std::int32_t*>(mapped(batch.triangleBuffer));
        timing_.keep(Timing::Command::download, batch.filled);
    }
    batch.distances = static_cast<const float*>(mapped(batch.distanceBuffer));
    timing_.keep(Timing::Command::download, batch.filled);
    device_.queue.flush();
}

// Waits for a batch in flight, and passes its blocks on.
void PrismFill::finish(PrismBatch& batch) {
    const bool filled = !batch.origins.empty();
    if (filled) batch.filled.wait();
    tbb::parallel_for(std::size_t(0), batch.bricks(), [&](std::size_t brick) {
        const std::size_t begin = batch.begins[brick].blocks, count = batch.begins[brick + 1].blocks - begin;
        const auto values = [&](const auto* all) { return std::span(all + begin * blockVoxels, count * blockVoxels); };
        mesh_.progress.advance();
        if (count > 0)
            mesh_.sink({std::span(batch.origins).subspan(begin, count), values(batch.distances),
                        mesh_.triangles ? values(batch.triangles) : std::span<const std::int32_t>()});
    });
    if (filled) {
        device_.queue.enqueueUnmapMemObject(batch.distanceBuffer, const_cast<float*>(batch.distances));
        if (mesh_.triangles)
            device_.queue.enqueueUnmapMemObject(batch.triangleBuffer, const_cast<std::int32_t*>(batch.triangles));
    }
    batch.begins.clear();
    batch.origins.clear();
}

}  // namespace

DeviceTimes fillPrism(DeviceImpl& device, const OpenclOptions& options, const FillJob& job) {
    const MeshJob& mesh = job.input;
    const double voxelsPerUnit = 1.0 / double(mesh.voxelSize);
    const VerticesAcross across(mesh.mesh, mesh.progress);
    const TriangleBins bins = binTriangles(mesh.mesh, job.box, voxelsPerUnit, mesh.reach, &mesh.progress);
    mesh.progress.begin(bins.count());
    return PrismFill(device, options, {mesh.mesh, across, voxelsPerUnit, mesh.reach}, mesh, bins).run();
}

}  // namespace bilayer::detail
