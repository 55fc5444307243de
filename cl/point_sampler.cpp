// SPDX-License-Identifier: Apache-2.0
// Buffers hold the bodies of all queries, concatenated, and grow with new bodies.
// Tested by tests/bullet/sampled_pairs.cpp through openclPointSampler().
#include <bilayer/cl/field.h>
#include <bilayer/collider/contact.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "cl/detail/device_field_build.h"
#include "cl/detail/enqueue.h"
#include "cl/detail/kernel_options.h"
#include "cl/detail/memory.h"
#include "cl/detail/program.h"
#include "cl/detail/queue_guard.h"
#include "cl/detail/timing.h"
#include "collider/contact/search/sampled_points.h"
#include "sdf/base/access.h"

namespace bilayer {

using namespace detail;

namespace detail {
extern const char* const point_sampler_cl;  // the text of point_sampler.cl
}

namespace {

constexpr std::size_t ballsPerProcessorItem = 64;  // bounding spheres
/// Initial capacity for answers, and the factor by which it grows beyond the need.
constexpr std::size_t minAnswers = 1 << 12, growth = 2;
constexpr const char* purpose = "the batch of contacts";  // of memory, for error texts

// `Body` of point_sampler.cl.
struct KernelBody {
    KernelFrame frame;
    cl_ulong directory, centres, values, points, balls;
};
static_assert(sizeof(KernelBody) == sizeof(KernelFrame) + 5 * sizeof(cl_ulong));

// `Query`.
struct KernelQuery {
    cl_float linear[9], shift[3], scale, reach;
    cl_uint body, other, firstBall;

    KernelQuery(const PointQuery& query, cl_uint firstBall)
        : shift{query.shift.x, query.shift.y, query.shift.z},
          scale(query.scale),
          reach(query.reach),
          body(query.body),
          other(query.other),
          firstBall(firstBall) {
        for (int i = 0; i < 9; ++i) linear[i] = query.linear[i / 3][i % 3];
    }
};

// The kernel uses the host's memory layout of balls and points.
static_assert(sizeof(PointBall) == 6 * sizeof(cl_float) && sizeof(glm::vec3) == 3 * sizeof(cl_float));

// `FoundPoint`.
struct KernelFound {
    cl_uint query, point;
    cl_float distance, gradient[3];
    cl_uint inBand;
};

// A growing buffer that keeps its content.
class GrowingBuffer {
  public:
    /// @return index of the first element
    template <class Element>
    cl_ulong append(std::span<const Element> data, const cl::CommandQueue& queue, DeviceMemory& memory,
                    Timing& timing) {
        const std::uint64_t first = used_, bytes = data.size_bytes();
        reserve(used_ + bytes, queue, memory);
        if (bytes > 0)
            queue.enqueueWriteBuffer(buffer_, CL_FALSE, first, bytes, data.data(), nullptr,
                                     timing.event(Timing::Command::upload));
        used_ += bytes;
        return first / sizeof(Element);
    }

    /// Ensures a capacity of at least so many bytes.
    void reserve(std::uint64_t bytes, const cl::CommandQueue& queue, DeviceMemory& memory) {
        if (bytes <= size_) return;
        const std::uint64_t size = std::max(bytes, growth * size_);
        cl::Buffer larger = memory.allocate(size, purpose);
        if (used_ > 0) queue.enqueueCopyBuffer(buffer_, larger, 0, 0, used_);
        queue.finish();
        memory.free(buffer_);
        buffer_ = larger;
        size_ = size;
    }

    /// Discards the content.
    void restart() { used_ = 0; }
    void clear(DeviceMemory& memory) {
        memory.free(buffer_);
        used_ = size_ = 0;
    }

    const cl::Buffer& buffer() const { return buffer_; }

  private:
    cl::Buffer buffer_;
    std::uint64_t used_ = 0, size_ = 0;  // bytes
};

cl::Program samplerProgram(const Device& device) {
    requireDoubles(device.info(), "which samples of fields need");
    return buildProgram(dataOf(device), point_sampler_cl, commonBuildOptions(dataOf(device)));
}

class Sampler {
  public:
    Sampler(const Device& device, const OpenclOptions& options)
        : device_(device),
          profile_(options.profile),
          gpuMapping_(wantsGroups(dataOf(device), options.mapping)),
          memory_(dataOf(device), memoryBudget(dataOf(device), options.memoryMiB)),
          program_(samplerProgram(device)),
          queue_(dataOf(device).context, dataOf(device).device, CL_QUEUE_PROFILING_ENABLE) {}

    void sample(std::span<const SampledBody> bodies, std::span<const PointQuery> queries, FoundPoints& answers);

  private:
    // The location of a body in the buffers.
    struct BodyLocation {
        KernelBody body;
        cl_uint balls;
    };

    void releaseBodies();
    void upload(const SampledBody& body, Timing& timing);
    void uploadMissing(std::span<const SampledBody> bodies, Timing& timing);
    std::vector<KernelFound> answer(std::span<const SampledBody> bodies, std::span<const PointQuery> queries,
                                    Timing& timing);
    std::vector<KernelFound> run(const std::vector<KernelBody>& bodies, const std::vector<KernelQuery>& queries,
                                 cl_uint balls, Timing& timing);

    const Device device_;
    const bool profile_;
    const bool gpuMapping_;
    DeviceMemory memory_;
    cl::Program program_;
    cl::CommandQueue queue_;
    std::map<std::uint64_t, BodyLocation> locations_;
    GrowingBuffer directories_, centres_, values_, points_, balls_;  // of the bodies
    GrowingBuffer bodies_, queries_, count_, answers_;               // of a batch
    std::size_t capacity_ = minAnswers;                              // of answers
    bool failed_ = false;  // in the last batch: the content of the buffers is unknown
};

void Sampler::releaseBodies() {
    queue_.finish();
    locations_.clear();
    for (GrowingBuffer* buffer :
         {&directories_, &centres_, &values_, &points_, &balls_, &bodies_, &queries_, &count_, &answers_})
        buffer->clear(memory_);
}

void Sampler::upload(const SampledBody& body, Timing& timing) {
    const FieldLayout& field = *body.field;
    if (field.storage != Storage::float32) throw std::invalid_argument("points are sampled in fields of float32 only");
    const BallsOfPoints own = body.points();
    const auto append = [&](GrowingBuffer& buffer, const auto* data, std::size_t count) {
        return buffer.append(std::span(data, count), queue_, memory_, timing);
    };
    const KernelBody placed{KernelFrame(field),
                            append(directories_, field.directory.data(), field.directory.size()),
                            append(centres_, field.centres.data(), field.centres.size()),
                            append(values_, field.values.data(), field.values.size()),
                            append(points_, own.points.data(), own.points.size()),
                            append(balls_, own.balls.data(), own.balls.size())};
    queue_.finish();
    locations_.emplace(body.id, BodyLocation{placed, cl_uint(own.balls.size())});
}

// Uploads missing bodies. If they do not fit in addition to the others, all others are released.
void Sampler::uploadMissing(std::span<const SampledBody> bodies, Timing& timing) {
    const auto addMissing = [&] {
        for (const SampledBody& body : bodies)
            if (!locations_.contains(body.id)) upload(body, timing);
    };
    if (locations_.empty()) return addMissing();
    try {
        addMissing();
    } catch (const DeviceError&) {
        releaseBodies();
        addMissing();
    }
}

// Runs the kernel, and again with more capacity if there are more answers than expected.
std::vector<KernelFound> Sampler::run(const std::vector<KernelBody>& bodies, const std::vector<KernelQuery>& queries,
                                      cl_uint balls, Timing& timing) {
    const cl_uint none = 0;
    cl_uint count = 0;
    std::vector<KernelFound> found;
    const QueueGuard guard(queue_);
    for (GrowingBuffer* buffer : {&bodies_, &queries_}) buffer->restart();
    bodies_.append(std::span(bodies), queue_, memory_, timing);
    queries_.append(std::span(queries), queue_, memory_, timing);
    count_.reserve(sizeof none, queue_, memory_);

    const std::size_t each = gpuMapping_ ? 1 : ballsPerProcessorItem, local = gpuMapping_ ? groupItems : 1;
    const std::size_t items = (balls + each - 1) / each, global = (items + local - 1) / local * local;
    do {
        answers_.reserve(capacity_ * sizeof(KernelFound), queue_, memory_);
        queue_.enqueueFillBuffer(count_.buffer(), none, 0, sizeof none);
        enqueueKernel(dataOf(device_), queue_, program_, "samplePoints", cl::NDRange(global), cl::NDRange(local),
                      timing.event(Timing::Command::kernel), bodies_.buffer(), queries_.buffer(),
                      cl_uint(queries.size()), balls, cl_uint(each), directories_.buffer(), centres_.buffer(),
                      values_.buffer(), points_.buffer(), balls_.buffer(), cl_uint(capacity_), count_.buffer(),
                      answers_.buffer());
        queue_.enqueueReadBuffer(count_.buffer(), CL_TRUE, 0, sizeof count, &count, nullptr,
                                 timing.event(Timing::Command::download));
    } while (count > std::exchange(capacity_, std::max<std::size_t>(capacity_, growth * count)));
    found.resize(count);
    if (count > 0)
        queue_.enqueueReadBuffer(answers_.buffer(), CL_TRUE, 0, count * sizeof(KernelFound), found.data(), nullptr,
                                 timing.event(Timing::Command::download));
    return found;
}

std::vector<KernelFound> Sampler::answer(std::span<const SampledBody> bodies, std::span<const PointQuery> queries,
                                         Timing& timing) {
    uploadMissing(bodies, timing);
    std::vector<KernelBody> kernelBodies;
    for (const SampledBody& body : bodies) kernelBodies.push_back(locations_.at(body.id).body);
    std::vector<KernelQuery> kernelQueries;
    cl_uint balls = 0;
    for (const PointQuery& query : queries) {
        kernelQueries.emplace_back(query, balls);
        balls += locations_.at(bodies[query.body].id).balls;
    }
    if (balls == 0) return {};
    return run(kernelBodies, kernelQueries, balls, timing);
}

// The device returns answers in any order.
void Sampler::sample(std::span<const SampledBody> bodies, std::span<const PointQuery> queries, FoundPoints& answers) {
    std::vector<KernelFound> all;
    try {
        Timing timing(profile_);
        if (std::exchange(failed_, true)) releaseBodies();
        all = answer(bodies, queries, timing);
        failed_ = false;
        answers.times = timing.total(memory_.peak());
    } catch (const cl::Error& error) {
        throw deviceError(error, device_.info().name);
    }

    std::sort(all.begin(), all.end(), [](const KernelFound& a, const KernelFound& b) {
        return std::pair(a.query, a.point) < std::pair(b.query, b.point);
    });
    answers.points.clear();
    answers.begins.assign(queries.size() + 1, 0);
    for (const KernelFound& each : all) {
        ++answers.begins[each.query + 1];
        const auto& [x, y, z] = each.gradient;
        answers.points.push_back({each.point, {each.distance, {x, y, z}, each.inBand != 0}});
    }
    for (std::size_t q = 0; q < queries.size(); ++q) answers.begins[q + 1] += answers.begins[q];
}

}  // namespace

PointSampler openclPointSampler(const Device& device, const OpenclOptions& options) try {
    const auto sampler = std::make_shared<Sampler>(device, options);
    const auto mutex = std::make_shared<std::mutex>();
    const auto sample = [=](std::span<const SampledBody> bodies, std::span<const PointQuery> queries,
                            FoundPoints& answers) {
        const std::lock_guard lock(*mutex);
        sampler->sample(bodies, queries, answers);
    };
    return makeOf<PointSampler>(DeviceSampler{"opencl", device.info().name, sample});
} catch (const cl::Error& error) {
    throw deviceError(error, device.info().name);
}

}  // namespace bilayer
