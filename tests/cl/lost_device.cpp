// SPDX-License-Identifier: Apache-2.0
// A device that is lost during a build. This file defines the calls that send work to a device, before the loader's.
// They fail from a chosen call on, as drivers make them fail after the loss of a GPU.
#include <dlfcn.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <climits>
#include <string>

#include <bilayer/cl/field.h>
#include <bilayer/cl/filler.h>
#include <bilayer/collider/contact.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "cl/detail/program.h"
#include "collider/contact/search/sampled_contacts.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "sdf/base/openvdb.h"

namespace bilayer::lost_device_test {
using namespace bilayer::detail;
using Catch::Matchers::Contains;

namespace {

enum Call { kernels, maps, waits, questions };

Call failing;
std::atomic<int> callsLeft = INT_MAX;

// Counts down the calls of the kind that is to fail.
bool fails(Call call) {
    return call == failing && callsLeft != INT_MAX && --callsLeft < 0;
}

template <class Function>
Function* loaders(const char* name) {
    return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

cl_int clEnqueueNDRangeKernel(cl_command_queue queue, cl_kernel kernel, cl_uint dimensions, const size_t* offset,
                              const size_t* global, const size_t* local, cl_uint waits, const cl_event* waitList,
                              cl_event* event) {
    if (fails(kernels)) return CL_DEVICE_NOT_AVAILABLE;
    static const auto call = loaders<decltype(clEnqueueNDRangeKernel)>("clEnqueueNDRangeKernel");
    return call(queue, kernel, dimensions, offset, global, local, waits, waitList, event);
}

void* clEnqueueMapBuffer(cl_command_queue queue, cl_mem buffer, cl_bool blocking, cl_map_flags flags, size_t offset,
                         size_t size, cl_uint waits, const cl_event* waitList, cl_event* event, cl_int* code) {
    if (fails(maps)) {
        *code = CL_OUT_OF_RESOURCES;
        return nullptr;
    }
    static const auto call = loaders<decltype(clEnqueueMapBuffer)>("clEnqueueMapBuffer");
    return call(queue, buffer, blocking, flags, offset, size, waits, waitList, event, code);
}

cl_int clGetMemObjectInfo(cl_mem buffer, cl_mem_info what, size_t room, void* answer, size_t* size) {
    if (fails(questions)) return CL_OUT_OF_RESOURCES;
    static const auto call = loaders<decltype(clGetMemObjectInfo)>("clGetMemObjectInfo");
    return call(buffer, what, room, answer, size);
}

cl_int clWaitForEvents(cl_uint count, const cl_event* events) {
    if (fails(waits)) return CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST;
    static const auto call = loaders<decltype(clWaitForEvents)>("clWaitForEvents");
    return call(count, events);
}
}

TEST_CASE("a device lost half-way is an error that names call and device, and leaves nothing behind") {
    const Device device = openDevice();
    const Mesh mesh = shapes::sphere(1.f, 4);
    BuildOptions options;
    options.method = GENERATE(Method::exact, Method::doubleLayer, Method::prism);
    options.exteriorWidthVoxels = options.interiorWidthVoxels = 2;
    options.voxelSize = voxelSizeFor(mesh, 150);
    const BlockFiller filler = openclFiller(device, {.memoryMiB = 8});
    const std::size_t voxels = build(mesh, options, filler).activeVoxels();
    int failures = 0;
    for (const auto& [call, name] :
         {std::pair{kernels, "clEnqueueNDRangeKernel"}, {maps, "clEnqueueMapBuffer"}, {waits, "clWaitForEvents"}})
        for (int before = 0; before < 64; before += 1 + before / 2) {
            failing = call;
            callsLeft = before;
            CAPTURE(name, before);
            bool complete = false;
            try {
                complete = build(mesh, options, filler).activeVoxels() == voxels;
            } catch (const DeviceError& error) {
                ++failures;
                CHECK_THAT(error.what(), Contains(name) && Contains(device.info().name) && Contains("CL_"));
            }
            const bool all = callsLeft >= 0;  // the work made fewer calls
            callsLeft = INT_MAX;
            CHECK(complete == all);
            if (all) break;
            // remains on the device affect no other build
            REQUIRE(build(mesh, options, filler).activeVoxels() == voxels);
        }
    CHECK(failures > 6);
}

TEST_CASE("a device that does not even answer for its buffers is an error, or keeps none of them") {
    const Device device = openDevice();
    const Mesh mesh = shapes::sphere(1.f, 4);
    BuildOptions options;
    options.method = GENERATE(Method::exact, Method::doubleLayer, Method::prism);
    options.voxelSize = voxelSizeFor(mesh, 60);
    const BlockFiller filler = openclFiller(device);
    const std::size_t voxels = build(mesh, options, filler).activeVoxels();
    for (int before = 0; before < 24; ++before) {
        failing = questions;
        callsLeft = before;
        try {
            const std::size_t found = build(mesh, options, filler).activeVoxels();
            CHECK(found == voxels);
        } catch (const DeviceError& error) {
            CHECK_THAT(error.what(), Contains("clGetMemObjectInfo") && Contains(device.info().name));
        }
        callsLeft = INT_MAX;
        CHECK(build(mesh, options, filler).activeVoxels() == voxels);
    }
}

TEST_CASE("a device lost while a field stays on it is an error, too") {
    const Device device = openDevice();
    const Mesh mesh = shapes::sphere(1.f, 4);
    BuildOptions options;
    options.voxelSize = voxelSizeFor(mesh, 60);
    for (int before = 0;; ++before) {
        failing = kernels;
        callsLeft = before;
        bool complete = false;
        try {
            const DeviceField field(device, mesh, options);
            complete = true;
        } catch (const DeviceError&) {
        }
        const bool all = callsLeft >= 0;
        callsLeft = INT_MAX;
        CHECK(complete == all);
        if (all) {
            CHECK(before > 5);
            break;
        }
    }
}

TEST_CASE("points are sampled again once a device that was lost is back") {
    const Mesh mesh = shapes::sphere(1.f, 3);
    const LevelSet levelSet = build(mesh, {.voxelSize = 0.1f});
    const FieldLayout layout(levelSet);
    const auto points = [&] {
        return BallsOfPoints{mesh.points, {{glm::vec3(0), 1, 0, unsigned(mesh.points.size())}}};
    };
    const SampledBody bodies[] = {{1, &layout, points}, {2, &layout, points}};
    const PointQuery queries[] = {{0, 1, glm::mat3(1), {1.5f, 0, 0}, 1, 0.1f},
                                  {1, 0, glm::mat3(1), {-1.5f, 0, 0}, 1, 0.1f}};
    const PointSampler sampler = openclPointSampler(openDevice());
    FoundPoints expected, found;
    dataOf(sampler).sample(bodies, queries, expected);
    REQUIRE(expected.points.size() > 10);
    failing = kernels;
    callsLeft = 0;
    CHECK_THROWS_WITH(dataOf(sampler).sample(bodies, queries, found),
                      Contains("clEnqueueNDRangeKernel") && Contains("CL_DEVICE_NOT_AVAILABLE"));
    callsLeft = INT_MAX;
    dataOf(sampler).sample(bodies, queries, found);
    CHECK(found.begins == expected.begins);
}
}  // namespace bilayer::lost_device_test
