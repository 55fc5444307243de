// SPDX-License-Identifier: Apache-2.0
#include "cl/detail/host_transfer.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>

#include "sdf/base/progress.h"

namespace bilayer::detail {

namespace {

constexpr std::size_t blocksPerTask = 16;  // blocks that the host receives at once

}  // namespace

void HostTransfer::pass(const std::byte* results, const ResultLayout& layout, std::size_t blocks) const {
    const auto* origins = reinterpret_cast<const glm::ivec3*>(results + layout.origins);
    const auto* distances = reinterpret_cast<const float*>(results + layout.distances);
    const auto* triangles = reinterpret_cast<const std::int32_t*>(results + layout.triangles);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, blocks, blocksPerTask), [&](const auto& range) {
        job_.progress.poll();
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            if (origins[i].x == noBlock) continue;
            const auto values = [&](const auto* all) { return std::span(all + i * blockVoxels, blockVoxels); };
            job_.sink({{origins + i, 1},
                       values(distances),
                       job_.triangles ? values(triangles) : std::span<const std::int32_t>()});
        }
    });
}

// Blocks that fit into a half of the staging memory, with the gaps that align their arrays.
std::size_t HostTransfer::blocksPerDownload() const {
    const ResultLayout one(1, job_.triangles);
    const std::size_t each =
        2 * sizeof(glm::ivec3) + blockVoxels * (sizeof(float) + (job_.triangles ? sizeof(cl_int) : 0));
    return (Staging::halfBytes - one.end) / each;
}

HostTransfer::Download HostTransfer::enqueueDownload(const cl::CommandQueue& queue, const BatchBuffers& from,
                                                     std::size_t first, std::size_t blocks) {
    const std::span<std::byte> to = staging_->half(nextHalf_++);
    const ResultLayout layout(blocks, job_.triangles);
    Download download{to.data(), blocks, {}};
    const auto read = [&](const cl::Buffer& buffer, std::uint64_t at, std::size_t each) {
        queue.enqueueReadBuffer(buffer, CL_FALSE, first * each, blocks * each, to.data() + at, nullptr, &download.done);
        timing_.keep(Timing::Command::download, download.done);
    };
    read(from.origins, layout.origins, sizeof(glm::ivec3));
    read(from.distances, layout.distances, blockVoxels * sizeof(float));
    if (job_.triangles) read(from.triangles, layout.triangles, blockVoxels * sizeof(cl_int));
    queue.flush();
    return download;
}

void HostTransfer::download(const cl::CommandQueue& queue, const BatchBuffers& from, std::size_t blocks) {
    if (!staging_) staging_.emplace(device_);
    const auto next = [&](std::size_t first) {
        const std::size_t count = std::min(blocks - first, blocksPerDownload());
        return count > 0 ? enqueueDownload(queue, from, first, count) : Download{};
    };
    Download arriving = next(0);
    for (std::size_t done = 0; done < blocks;) {
        const Download arrived = std::exchange(arriving, next(done + arriving.blocks));
        arrived.done.wait();
        pass(arrived.results, ResultLayout(arrived.blocks, job_.triangles), arrived.blocks);
        done += arrived.blocks;
    }
}

}  // namespace bilayer::detail
