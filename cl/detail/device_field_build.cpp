// SPDX-License-Identifier: Apache-2.0
// Each batch of blocks that the fill leaves on the device is trimmed to the band at once, into a page of its own. After
// the last batch, when their number is known, the pages are copied into the layout.
#include "cl/detail/device_field_build.h"

#include <algorithm>
#include <array>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <utility>
#include <vector>

#include "cl/detail/brick_filler.h"
#include "cl/detail/enqueue.h"
#include "cl/detail/kernel_options.h"
#include "cl/detail/queue_guard.h"
#include "sdf/base/access.h"
#include "sdf/grid/field_build.h"
#include "sdf/leaf/band.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

extern const char* const field_build_cl;  // the text of field_build.cl

namespace {

constexpr std::size_t itemsAlongCells = 32;        // along z, which is contiguous in memory
constexpr cl_int unknownEntry = -3;                // UNKNOWN of field_build.cl
constexpr cl_float maxCells = 16;                  // MAX_CELLS of field_build.cl
constexpr const char* fieldPurpose = "the field";  // of memory, for error texts

// `Widths` of field_build.cl.
struct KernelWidths {
    cl_float exterior, interior, voxelSize;
};

// `Summary` of field_build.cl.
struct Summary {
    static constexpr cl_int low = std::numeric_limits<cl_int>::min(), high = std::numeric_limits<cl_int>::max();

    cl_int needed = 0, conflicts = 0;
    cl_int blockLower[3]{high, high, high}, blockUpper[3]{low, low, low};
    cl_int activeLower[3]{high, high, high}, activeUpper[3]{low, low, low};
};

glm::ivec3 vectorOf(const cl_int (&values)[3]) {
    return {values[0], values[1], values[2]};
}

std::size_t roundedUp(std::size_t count, std::size_t multiple) {
    return (count + multiple - 1) / multiple * multiple;
}

// A batch of blocks, trimmed to the band.
struct Page {
    cl_uint blocks;
    cl::Buffer origins, values, sides;
};

class DeviceFieldBuilder {
  public:
    DeviceFieldBuilder(const Device& device, const OpenclOptions& options, DeviceMemory& memory, const FillJob& job);
    DeviceFieldBuilder(const DeviceFieldBuilder&) = delete;
    DeviceFieldBuilder& operator=(const DeviceFieldBuilder&) = delete;
    BuiltDeviceField run();

  private:
    void addPage(const cl::Buffer& origins, const cl::Buffer& distances, std::size_t blocks);
    void addHostBlocks();
    void computeFrame();
    void placeBlocks();
    void computeClearances();
    void countConflicts();
    Summary readSummary();

    std::size_t entries() const { return layout_.frame.entries(); }

    template <class... Arguments>
    void enqueue(const char* name, const cl::NDRange& global, const cl::NDRange& local, const Arguments&... arguments) {
        enqueueKernel(device_, device_.queue, program_, name, global, local, timing_.event(Timing::Command::kernel),
                      arguments...);
    }
    // Enqueues a kernel with a work-group, or a single item, for each block.
    template <class... Arguments>
    void enqueueBlocks(const char* name, std::size_t blocks, const Arguments&... arguments) {
        const std::size_t items = gpuMapping_ ? groupItems : 1;
        enqueue(name, cl::NDRange(blocks * items), cl::NDRange(items), arguments...);
    }
    // Enqueues a kernel with a work-item for each coarse cell that has a clearance.
    template <class... Arguments>
    void enqueueCells(const char* name, const Arguments&... arguments) {
        const glm::ivec3 size = layout_.frame.coarseCells();
        enqueue(name, cl::NDRange(roundedUp(std::size_t(size.z), itemsAlongCells), size.y, size.x),
                cl::NDRange(itemsAlongCells, 1, 1), arguments...);
    }

    DeviceImpl& device_;
    const OpenclOptions& options_;
    DeviceMemory& memory_;
    const FillJob& job_;
    const bool gpuMapping_;
    const BandWidths widths_;
    Timing timing_;
    cl::Program program_;
    cl::Buffer summary_;
    std::vector<Page> pages_;
    std::mutex mutex_;                     // guards the data from the host
    std::vector<glm::ivec3> hostOrigins_;  // of blocks that the host filled
    std::vector<float> hostDistances_;     // [voxels]
    DeviceLayout layout_;
    glm::ivec3 firstVoxel_{0};
    QueueGuard guard_;  // commands in flight use the blocks of the host
};

DeviceFieldBuilder::DeviceFieldBuilder(const Device& device, const OpenclOptions& options, DeviceMemory& memory,
                                       const FillJob& job)
    : device_(dataOf(device)),
      options_(options),
      memory_(memory),
      job_(job),
      gpuMapping_(wantsGroups(device_, options.mapping)),
      widths_{job.options.exteriorWidthVoxels, job.options.interiorWidthVoxels, job.input.voxelSize},
      timing_(options.profile),
      program_(buildProgram(device_, field_build_cl, commonBuildOptions(device_, gpuMapping_))),
      summary_(memory.allocate(sizeof(Summary), fieldPurpose)),
      guard_(device_.queue) {}

BuiltDeviceField DeviceFieldBuilder::run() {
    const Summary none;
    device_.queue.enqueueWriteBuffer(summary_, CL_TRUE, 0, sizeof none, &none);
    MeshJob mesh = job_.input;
    mesh.sink = [&](const FilledBlocks& blocks) {
        const std::lock_guard lock(mutex_);
        hostOrigins_.insert(hostOrigins_.end(), blocks.origins.begin(), blocks.origins.end());
        hostDistances_.insert(hostDistances_.end(), blocks.distances.begin(), blocks.distances.end());
    };
    DeviceTimes times = fillByBricks(device_, options_, {mesh, job_.options, job_.box, job_.layers},
                                     [&](const cl::Buffer& origins, const cl::Buffer& distances, std::size_t blocks) {
                                         addPage(origins, distances, blocks);
                                     });
    addHostBlocks();
    computeFrame();
    placeBlocks();
    countConflicts();
    computeClearances();
    times += timing_.total(0);
    return {std::move(layout_), times};
}

void DeviceFieldBuilder::addPage(const cl::Buffer& origins, const cl::Buffer& distances, std::size_t blocks) {
    if (blocks == 0) return;
    const auto buffer = [&](std::uint64_t each) { return memory_.allocate(blocks * each, fieldPurpose); };
    const Page page{cl_uint(blocks), buffer(sizeof(glm::ivec3)), buffer(blockVoxels * sizeof(float)),
                    buffer(sizeof(cl_int))};
    enqueueBlocks("trimBlocks", blocks, origins, distances,
                  KernelWidths{widths_.exterior, widths_.interior, widths_.voxelSize}, page.origins, page.values,
                  page.sides, summary_);
    device_.queue.flush();
    pages_.push_back(page);
}

void DeviceFieldBuilder::addHostBlocks() {
    if (hostOrigins_.empty()) return;
    const auto uploaded = [&](const auto& data) {
        return memory_.upload(data.data(), data.size() * sizeof data[0], fieldPurpose,
                              timing_.event(Timing::Command::upload));
    };
    cl::Buffer origins = uploaded(hostOrigins_), distances = uploaded(hostDistances_);
    addPage(origins, distances, hostOrigins_.size());
    device_.queue.finish();
    memory_.free(origins);
    memory_.free(distances);
}

Summary DeviceFieldBuilder::readSummary() {
    Summary summary;
    device_.queue.enqueueReadBuffer(summary_, CL_TRUE, 0, sizeof summary, &summary, nullptr,
                                    timing_.event(Timing::Command::download));
    return summary;
}

// Computes the frame as FieldLayout's constructor and LevelSet do.
void DeviceFieldBuilder::computeFrame() {
    const Summary summary = readSummary();
    if (summary.activeLower[0] > summary.activeUpper[0])
        throw std::invalid_argument("the half width is too small for this voxel size: no voxel lies within the band");
    FieldFrame& frame = layout_.frame;
    firstVoxel_ = vectorOf(summary.blockLower);
    frame.blocks = (vectorOf(summary.blockUpper) - firstVoxel_) / blockSide + 1;
    frame.requireSize();
    frame.voxelSize = widths_.voxelSize;
    frame.voxel = double(widths_.voxelSize);
    frame.perMetre = 1 / frame.voxel;
    frame.exteriorWidth = widths_.exterior * widths_.voxelSize;
    frame.interiorWidth = widths_.interior * widths_.voxelSize;
    frame.origin = glm::dvec3(firstVoxel_) * frame.voxel;
    frame.bounds = {glm::vec3(glm::dvec3(vectorOf(summary.activeLower)) * frame.voxel),
                    glm::vec3(glm::dvec3(vectorOf(summary.activeUpper)) * frame.voxel)};
    layout_.values =
        memory_.allocate(std::uint64_t(summary.needed) * FieldFrame::blockFloats * sizeof(float), fieldPurpose);
}

void DeviceFieldBuilder::placeBlocks() {
    const KernelFrame frame(layout_.frame);
    const cl_int4 first{{firstVoxel_.x, firstVoxel_.y, firstVoxel_.z, 0}};
    cl::Buffer next = memory_.allocate(sizeof(cl_uint), fieldPurpose);
    layout_.directory = memory_.allocate(entries() * sizeof(cl_int), fieldPurpose);
    device_.queue.enqueueFillBuffer(next, cl_uint(0), 0, sizeof(cl_uint));
    device_.queue.enqueueFillBuffer(layout_.directory, unknownEntry, 0, entries() * sizeof(cl_int));
    for (const Page& page : pages_)
        enqueueBlocks("placeBlocks", page.blocks, frame, first, page.origins, page.values, page.sides, next,
                      layout_.directory, layout_.values);
    const std::size_t columns = std::size_t(frame.blocks[0]) * frame.blocks[1];
    enqueue("markEmpty", cl::NDRange(roundedUp(columns, groupItems)), cl::NDRange(groupItems), frame, layout_.directory,
            layout_.values);
    enqueueBlocks("fillAprons", entries(), frame, layout_.directory, layout_.values);
    device_.queue.finish();
    for (Page& page : pages_)
        for (cl::Buffer* buffer : {&page.origins, &page.values, &page.sides}) memory_.free(*buffer);
    pages_.clear();
    memory_.free(next);
}

void DeviceFieldBuilder::countConflicts() {
    if (!job_.input.conflicts) return;
    enqueueBlocks("countConflicts", entries(), KernelFrame(layout_.frame), layout_.directory, layout_.values, summary_);
    *job_.input.conflicts += std::size_t(readSummary().conflicts);
}

void DeviceFieldBuilder::computeClearances() {
    const KernelFrame frame(layout_.frame);
    const glm::ivec3 size = layout_.frame.coarseCells();
    const std::size_t count = std::size_t(size.x) * size.y * size.z;
    const cl_float far = layout_.frame.findsSurface() ? maxCells * maxCells : 0;
    layout_.centres = memory_.allocate(count * sizeof(cl_char), fieldPurpose);
    std::array<cl::Buffer, 2> distances2;
    for (cl::Buffer& buffer : distances2) buffer = memory_.allocate(count * sizeof(cl_float), fieldPurpose);
    enqueueCells("initialiseCells", frame, far, layout_.directory, layout_.values, distances2[0], layout_.centres);
    for (cl_int axis = 2; axis >= 0; --axis) {
        enqueueCells("transformCells", frame, axis, distances2[0], distances2[1]);
        std::swap(distances2[0], distances2[1]);
    }
    enqueueCells("storeCentres", frame, distances2[0], layout_.centres);
    device_.queue.finish();
    for (cl::Buffer& buffer : distances2) memory_.free(buffer);
    memory_.free(summary_);
}

void checkJob(const FillJob& job) {
    if (job.options.method == Method::prism)
        throw std::invalid_argument(
            "a DeviceField cannot be built by the method prism: build a level set and upload that");
    if (!job.input.sign)
        throw std::invalid_argument(
            "a field that stays on the device takes its signs from normals; those of this mesh contradict each other, "
            "or other signs were asked for: build a level set and upload that");
}

}  // namespace

BuiltDeviceField buildDeviceField(const Device& device, const Mesh& mesh, const BuildOptions& build,
                                  const OpenclOptions& options, DeviceMemory& memory) {
    OpenclOptions fillOptions = options;
    fillOptions.memoryMiB =
        std::max<std::uint64_t>(1, memoryBudget(dataOf(device), options.memoryMiB) / fillPart / mebibyte);
    BuildOptions withoutTriangles = build;
    withoutTriangles.triangles = false;

    DeviceLayout layout;
    DeviceTimes times = fillOnly(mesh, withoutTriangles,
                                 {"opencl", device.info().name, [&](const FillJob& job) {
                                      checkJob(job);
                                      // the first fill had contradictory signs
                                      for (cl::Buffer* buffer : {&layout.directory, &layout.centres, &layout.values})
                                          memory.free(*buffer);
                                      BuiltDeviceField field =
                                          DeviceFieldBuilder(device, fillOptions, memory, job).run();
                                      layout = std::move(field.layout);
                                      return field.times;
                                  }});
    times.peakBytes += memory.peak();
    return {std::move(layout), times};
}

}  // namespace bilayer::detail
