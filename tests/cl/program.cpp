// SPDX-License-Identifier: Apache-2.0
// Compiled programs: build logs, the cache on disk, the names of error codes.
#include "cl/detail/program.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <iterator>

#include "sdf/base/access.h"
#include "tests/support/support.h"

namespace bilayer::program_test {
using namespace bilayer::detail;
using Catch::Matchers::Contains;

namespace {

const std::string source = "kernel void answer(global int* out) { out[get_global_id(0)] = ANSWER; }";
const std::string options = "-D ANSWER=42";

// The kernel's output.
int answer(DeviceImpl& device, const cl::Program& program) {
    cl::Kernel kernel(program, "answer");
    const cl::Buffer out(device.context, CL_MEM_WRITE_ONLY, sizeof(cl_int));
    kernel.setArg(0, out);
    device.queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(1));
    cl_int value = 0;
    device.queue.enqueueReadBuffer(out, CL_TRUE, 0, sizeof value, &value);
    return value;
}

// Opens the device again, so that its in-memory program cache is empty, and runs the kernel.
int answerAnew() {
    const Device device = openDevice();
    return answer(dataOf(device), buildProgram(dataOf(device), source, options));
}

void overwrite(const std::filesystem::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
}

// Redirects the cache to this folder for the rest of the process. Each test runs in its own process or sets the folder
// again.
void cacheIn(const std::filesystem::path& folder) {
    // PoCL also keeps its own files there and fails without them
    ::setenv("POCL_CACHE_DIR", bilayer::test::scratch("pocl").c_str(), 1);
    ::setenv("XDG_CACHE_HOME", folder.c_str(), 1);
}

}  // namespace

TEST_CASE("a kernel that does not compile is an error with the log") {
    const Device device = openDevice();
    const auto build = [&] {
        buildProgram(dataOf(device), "kernel void broken(global int* out) { *out = unheardOf; }", "");
    };
    CHECK_THROWS_AS(build(), DeviceError);
    CHECK_THROWS_WITH(build(), Contains("clBuildProgram") && Contains("CL_BUILD_PROGRAM_FAILURE") &&
                                   Contains(device.info().name) && Contains("unheardOf"));
}

TEST_CASE("a failed call is reported with its name, its code and the device") {
    const Device device = openDevice();
    const cl::Program program = buildProgram(dataOf(device), source, options);
    try {
        cl::Kernel(program, "question");
        FAIL("there is no such kernel");
    } catch (const cl::Error& error) {
        CHECK_THAT(deviceError(error, device.info().name).what(),
                   Contains("clCreateKernel") && Contains("CL_INVALID_KERNEL_NAME") && Contains(device.info().name));
    }
}

TEST_CASE("error codes have the names of the standard") {
    CHECK(errorName(CL_SUCCESS) == "CL_SUCCESS");
    CHECK(errorName(CL_MEM_OBJECT_ALLOCATION_FAILURE) == "CL_MEM_OBJECT_ALLOCATION_FAILURE");
    CHECK(errorName(CL_OUT_OF_RESOURCES) == "CL_OUT_OF_RESOURCES");
    CHECK(errorName(CL_KERNEL_ARG_INFO_NOT_AVAILABLE) == "CL_KERNEL_ARG_INFO_NOT_AVAILABLE");
    CHECK(errorName(CL_INVALID_VALUE) == "CL_INVALID_VALUE");
    CHECK(errorName(CL_INVALID_BINARY) == "CL_INVALID_BINARY");
    CHECK(errorName(CL_INVALID_WORK_GROUP_SIZE) == "CL_INVALID_WORK_GROUP_SIZE");
    CHECK(errorName(CL_INVALID_BUFFER_SIZE) == "CL_INVALID_BUFFER_SIZE");
    CHECK(errorName(CL_INVALID_DEVICE_PARTITION_COUNT) == "CL_INVALID_DEVICE_PARTITION_COUNT");
    CHECK(errorName(-9999) == "code -9999");
    CHECK(errorName(-25) == "code -25");
    CHECK(errorName(1) == "code 1");
}

TEST_CASE("a device compiles a program once") {
    cacheIn(bilayer::test::scratch("once"));
    const Device device = openDevice();
    const cl::Program first = buildProgram(dataOf(device), source, options);
    CHECK(buildProgram(dataOf(device), source, options)() == first());
    CHECK(buildProgram(dataOf(device), source, "-D ANSWER=43")() != first());
}

TEST_CASE("a program comes back from the disk") {
    const auto folder = bilayer::test::scratch("disk");
    cacheIn(folder);
    const std::filesystem::path path = cachedProgram(openDevice().info(), source, options);
    CHECK(path.parent_path() == folder / "bilayer");
    REQUIRE_FALSE(std::filesystem::exists(path));
    CHECK(answerAnew() == 42);
    REQUIRE(std::filesystem::exists(path));
    const auto written = std::filesystem::last_write_time(path);
    CHECK(answerAnew() == 42);
    CHECK(std::filesystem::last_write_time(path) == written);

    // stores the other program under this one's name, which shows whose binary runs
    const Device device = openDevice();
    const std::string other = "-D ANSWER=7";
    CHECK(answer(dataOf(device), buildProgram(dataOf(device), source, other)) == 7);
    std::filesystem::copy_file(cachedProgram(device.info(), source, other), path,
                               std::filesystem::copy_options::overwrite_existing);
    CHECK(answerAnew() == 7);
}

TEST_CASE("damaged files in the cache are compiled anew and replaced") {
    cacheIn(bilayer::test::scratch("damage"));
    const std::filesystem::path path = cachedProgram(openDevice().info(), source, options);
    CHECK(answerAnew() == 42);
    const std::string whole = test::contentsOf(path);
    REQUIRE(whole.size() > 100);
    std::string flipped = whole;
    flipped[whole.size() / 2] = char(flipped[whole.size() / 2] ^ 1);
    const std::string damaged =
        GENERATE_COPY(std::string(), std::string("garbage"), whole.substr(0, 20), whole.substr(0, whole.size() - 1),
                      whole.substr(0, whole.size() / 2), flipped, whole + "more");
    CAPTURE(damaged.size());
    overwrite(path, damaged);
    CHECK(answerAnew() == 42);
    // replaced by one that is used the next time; its size may differ, since PoCL's binaries are not reproducible
    CHECK(test::contentsOf(path) != damaged);
    const auto written = std::filesystem::last_write_time(path);
    CHECK(answerAnew() == 42);
    CHECK(std::filesystem::last_write_time(path) == written);
}

TEST_CASE("a cache that cannot be written is done without") {
    const auto file = bilayer::test::scratch("a file where the folder would be");
    overwrite(file, "");
    cacheIn(file);
    CHECK(answerAnew() == 42);
}

TEST_CASE("without a home there is no cache") {
    const Device device = openDevice();
    ::unsetenv("XDG_CACHE_HOME");
    const std::string home = std::getenv("HOME") ? std::getenv("HOME") : "";
    ::unsetenv("HOME");
    CHECK(cachedProgram(device.info(), source, options).empty());
    CHECK(answer(dataOf(device), buildProgram(dataOf(device), source, options)) == 42);
    ::setenv("HOME", "/home/someone", 1);
    CHECK(cachedProgram(device.info(), source, options).parent_path() == "/home/someone/.cache/bilayer");
    ::setenv("HOME", home.c_str(), 1);
}

TEST_CASE("another driver, platform, source or option is another file in the cache") {
    const DeviceInfo info = openDevice().info();
    const auto path = cachedProgram(info, source, options);
    CHECK(cachedProgram(info, source, options) == path);
    CHECK(cachedProgram(info, source + " ", options) != path);
    CHECK(cachedProgram(info, source, "-D ANSWER=43") != path);
    for (std::string DeviceInfo::*member :
         {&DeviceInfo::driver, &DeviceInfo::name, &DeviceInfo::version, &DeviceInfo::platformVersion}) {
        DeviceInfo other = info;
        other.*member += "x";
        CHECK(cachedProgram(other, source, options) != path);
    }
}
}  // namespace bilayer::program_test
