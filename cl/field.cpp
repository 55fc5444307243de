// SPDX-License-Identifier: Apache-2.0
// Two batches of points alternate: while the device samples one, the other is uploaded or downloaded.
#include <bilayer/cl/field.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <utility>

#include "cl/detail/device_field_build.h"
#include "cl/detail/enqueue.h"
#include "cl/detail/kernel_options.h"
#include "cl/detail/memory.h"
#include "cl/detail/program.h"
#include "cl/detail/queue_guard.h"
#include "cl/detail/timing.h"
#include "collider/field/layout/batch.h"
#include "collider/field/layout/field_layout.h"
#include "sdf/base/access.h"

namespace bilayer {

using namespace detail;

namespace detail {
extern const char* const field_cl;  // the text of field.cl
}

namespace {

/// Points in a batch: 4 MiB of points and samples, which take a GPU about as long as ten kernel launches.
constexpr std::size_t batchPoints = 1 << 17;
constexpr std::size_t pointsPerProcessorItem = 1024;

// The kernel uses the host's memory layout of points and samples.
static_assert(sizeof(glm::vec3) == 3 * sizeof(cl_float));
static_assert(sizeof(Sample) == 5 * sizeof(cl_float) && offsetof(Sample, gradient) == sizeof(cl_float) &&
              offsetof(Sample, inBand) == 4 * sizeof(cl_float) && sizeof(bool) == sizeof(cl_uchar));

// A batch of points in flight, with its own queue.
struct PointBatch {
    cl::CommandQueue queue;
    cl::Buffer points, samples;
};

cl::Program samplingProgram(const Device& device) {
    requireDoubles(device.info(), "which samples of fields need");
    return buildProgram(dataOf(device), field_cl, commonBuildOptions(dataOf(device)));
}

}  // namespace

struct DeviceField::Data {
    Device device;
    const bool gpuMapping;
    DeviceMemory memory;
    cl::Program program;
    std::optional<FieldLayout> shared;  // memory of the layout's buffers if host and device share memory
    DeviceLayout layout;
    std::array<PointBatch, batchesInFlight> batches;
    std::mutex mutex;  // guards `batches`
    const bool profile;
    DeviceTimes buildTimes;

    Data(const Device& device, const OpenclOptions& options, std::uint64_t budget);

    void upload(FieldLayout from);
    void start(PointBatch& batch, std::span<const glm::vec3> points, std::span<Sample> samples, Timing& timing);
    void sample(std::span<const glm::vec3> points, std::span<Sample> samples, Timing& timing);
};

DeviceField::Data::Data(const Device& device, const OpenclOptions& options, std::uint64_t budget)
    : device(device),
      gpuMapping(wantsGroups(dataOf(device), options.mapping)),
      memory(dataOf(device), budget),
      program(samplingProgram(device)),
      profile(options.profile) {
    const DeviceImpl& impl = dataOf(device);
    for (PointBatch& batch : batches) {
        batch.queue = cl::CommandQueue(impl.context, impl.device, CL_QUEUE_PROFILING_ENABLE);
        if (impl.info.unifiedMemory) continue;
        batch.points = memory.allocate(batchPoints * sizeof(glm::vec3), "a batch of points");
        batch.samples = memory.allocate(batchPoints * sizeof(Sample), "a batch of points");
    }
}

void DeviceField::Data::upload(FieldLayout from) {
    Timing timing(profile);
    const QueueGuard guard(dataOf(device).queue);
    const auto uploaded = [&](const auto* data, std::size_t count) {
        return memory.upload(data, count * sizeof *data, "the field", timing.event(Timing::Command::upload));
    };
    layout = {from, uploaded(from.directory.data(), from.directory.size()),
              uploaded(from.centres.data(), from.centres.size()), uploaded(from.values.data(), from.values.size())};
    dataOf(device).queue.finish();
    buildTimes = timing.total(memory.peak());
    if (device.info().unifiedMemory) shared = std::move(from);
}

// Enqueues a batch; in place if host and device share memory.
void DeviceField::Data::start(PointBatch& batch, std::span<const glm::vec3> points, std::span<Sample> samples,
                              Timing& timing) {
    const cl::CommandQueue& queue = batch.queue;
    const bool unified = device.info().unifiedMemory;
    if (unified) {
        // OpenCL's signature takes a pointer to mutable data; it is only read
        batch.points = cl::Buffer(dataOf(device).context, CL_MEM_READ_ONLY | CL_MEM_USE_HOST_PTR, points.size_bytes(),
                                  const_cast<glm::vec3*>(points.data()));
        batch.samples = cl::Buffer(dataOf(device).context, CL_MEM_WRITE_ONLY | CL_MEM_USE_HOST_PTR,
                                   samples.size_bytes(), samples.data());
    } else {
        queue.enqueueWriteBuffer(batch.points, CL_FALSE, 0, points.size_bytes(), points.data(), nullptr,
                                 timing.event(Timing::Command::upload));
    }
    const std::size_t each = gpuMapping ? 1 : pointsPerProcessorItem, local = gpuMapping ? groupItems : 1;
    const std::size_t items = (points.size() + each - 1) / each, global = (items + local - 1) / local * local;
    enqueueKernel(dataOf(device), queue, program, "sampleField", cl::NDRange(global), cl::NDRange(local),
                  timing.event(Timing::Command::kernel), KernelFrame(layout.frame), layout.directory, layout.centres,
                  layout.values, batch.points, cl_uint(points.size()), cl_uint(each), batch.samples);
    cl::Event* const download = timing.event(Timing::Command::download);
    if (unified) {
        void* const mapped =
            queue.enqueueMapBuffer(batch.samples, CL_FALSE, CL_MAP_READ, 0, samples.size_bytes(), nullptr, download);
        queue.enqueueUnmapMemObject(batch.samples, mapped);
    } else {
        queue.enqueueReadBuffer(batch.samples, CL_FALSE, 0, samples.size_bytes(), samples.data(), nullptr, download);
    }
    queue.flush();
}

void DeviceField::Data::sample(std::span<const glm::vec3> points, std::span<Sample> samples, Timing& timing) {
    const std::array<QueueGuard, batchesInFlight> guards{QueueGuard(batches[0].queue), QueueGuard(batches[1].queue)};
    std::size_t next = 0;
    for (std::size_t first = 0; first < points.size(); first += batchPoints) {
        PointBatch& batch = batches[next++ % batchesInFlight];
        batch.queue.finish();
        const std::size_t count = std::min(batchPoints, points.size() - first);
        start(batch, points.subspan(first, count), samples.subspan(first, count), timing);
    }
    for (PointBatch& batch : batches) batch.queue.finish();
}

DeviceField::DeviceField(const Device& device, const LevelSet& levelSet, const OpenclOptions& options) try {
    data_ = std::make_shared<Data>(device, options, memoryBudget(dataOf(device), options.memoryMiB));
    data_->upload(FieldLayout(levelSet));
} catch (const cl::Error& error) {
    throw deviceError(error, device.info().name);
}

DeviceField::DeviceField(const Device& device, const Mesh& mesh, const BuildOptions& build,
                         const OpenclOptions& options) try {
    const std::uint64_t budget = memoryBudget(dataOf(device), options.memoryMiB);
    data_ = std::make_shared<Data>(device, options, budget - budget / fillPart);
    BuiltDeviceField field = buildDeviceField(device, mesh, build, options, data_->memory);
    data_->layout = std::move(field.layout);
    data_->buildTimes = field.times;
} catch (const cl::Error& error) {
    throw deviceError(error, device.info().name);
}

DeviceTimes DeviceField::sample(std::span<const glm::vec3> points, std::span<Sample> samples) const {
    requireSameLength(points.size(), "points", samples.size(), "samples");
    const std::lock_guard lock(data_->mutex);
    Timing timing(data_->profile);
    try {
        data_->sample(points, samples, timing);
        return timing.total(data_->memory.used());
    } catch (const cl::Error& error) {
        throw deviceError(error, data_->device.info().name);
    }
}

const Bounds& DeviceField::bounds() const {
    return data_->layout.frame.bounds;
}

std::size_t DeviceField::memoryBytes() const {
    return data_->memory.used();
}

const DeviceTimes& DeviceField::buildTimes() const {
    return data_->buildTimes;
}

}  // namespace bilayer
