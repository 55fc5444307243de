// SPDX-License-Identifier: Apache-2.0
#include "cl/detail/batch_memory.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <utility>

#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

ResultLayout::ResultLayout(std::uint64_t blocks, bool withTriangles) {
    constexpr std::uint64_t alignment = 4096;
    const auto after = [](std::uint64_t begin, std::uint64_t bytes) {
        return begin + (bytes + alignment - 1) / alignment * alignment;
    };
    origins = after(counts, sizeof(BatchCounts));
    open = after(origins, blocks * sizeof(glm::ivec3));
    distances = after(open, blocks * sizeof(glm::ivec3));
    triangles = after(distances, blocks * blockVoxels * sizeof(float));
    end = withTriangles ? after(triangles, blocks * blockVoxels * sizeof(cl_int)) : triangles;
}

void BatchBuffers::allocate(DeviceMemory& memory, const BatchSize& size, const PartBytes& bytes, bool withTriangles) {
    capacity = size;
    const auto buffer = [&](std::uint64_t bytesOf) { return memory.allocate(bytesOf, "a batch of bricks"); };
    for (const auto& [part, each] : {std::pair{&parts, bytes.piece},
                                     {&unsorted, bytes.unsorted},
                                     {&sorted, bytes.sorted},
                                     {&cells, bytes.cell},
                                     {&columns, bytes.columns},
                                     {&begins, bytes.groupBegin}})
        if (each > 0) *part = buffer(size.slots * each);
    ofBricks = buffer(size.bricks * bytes.brick);
    const ResultLayout layout(size.blocks, withTriangles);
    results = buffer(layout.end);
    const auto part = [&](std::uint64_t begin, std::uint64_t end) {
        const cl_buffer_region region{std::size_t(begin), std::size_t(end - begin)};
        return results.createSubBuffer(CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &region);
    };
    counts = part(layout.counts, layout.origins);
    origins = part(layout.origins, layout.open);
    open = part(layout.open, layout.distances);
    distances = part(layout.distances, layout.triangles);
    if (withTriangles) triangles = part(layout.triangles, layout.end);
}

void BatchBuffers::freeAll(DeviceMemory& memory) {
    for (cl::Buffer* part : {&counts, &origins, &open, &distances, &triangles}) *part = {};
    for (cl::Buffer* buffer : {&parts, &unsorted, &sorted, &cells, &columns, &begins, &ofBricks, &results})
        memory.free(*buffer);
}

std::uint64_t totalBytes(const BatchSize& size, const PartBytes& bytes, bool withTriangles) {
    return size.slots * bytes.perPart() + size.bricks * bytes.brick + ResultLayout(size.blocks, withTriangles).end;
}

std::uint64_t largestBuffer(const BatchSize& size, const PartBytes& bytes, bool withTriangles) {
    const std::uint64_t perPart =
        std::max({bytes.piece, bytes.unsorted, bytes.sorted, bytes.cell, bytes.columns, bytes.groupBegin});
    return std::max({ResultLayout(size.blocks, withTriangles).end, size.slots * perPart, size.bricks * bytes.brick});
}

}  // namespace bilayer::detail
