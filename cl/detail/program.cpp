// SPDX-License-Identifier: Apache-2.0
#include "cl/detail/program.h"

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "sdf/io/atomic_file.h"

namespace bilayer::detail {
namespace {

using Binary = std::vector<unsigned char>;

constexpr std::string_view fileMark = "bilayer program\n";  // first bytes of a cache file; its checksum follows

// The names of OpenCL 1.2's codes without "CL_", from 0 down, and without "CL_INVALID_", from CL_INVALID_VALUE down.
constexpr const char* runTimeCodes =
    "SUCCESS DEVICE_NOT_FOUND DEVICE_NOT_AVAILABLE COMPILER_NOT_AVAILABLE MEM_OBJECT_ALLOCATION_FAILURE "
    "OUT_OF_RESOURCES OUT_OF_HOST_MEMORY PROFILING_INFO_NOT_AVAILABLE MEM_COPY_OVERLAP IMAGE_FORMAT_MISMATCH "
    "IMAGE_FORMAT_NOT_SUPPORTED BUILD_PROGRAM_FAILURE MAP_FAILURE MISALIGNED_SUB_BUFFER_OFFSET "
    "EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST COMPILE_PROGRAM_FAILURE LINKER_NOT_AVAILABLE LINK_PROGRAM_FAILURE "
    "DEVICE_PARTITION_FAILED KERNEL_ARG_INFO_NOT_AVAILABLE";
constexpr const char* invalidCodes =
    "VALUE DEVICE_TYPE PLATFORM DEVICE CONTEXT QUEUE_PROPERTIES COMMAND_QUEUE HOST_PTR MEM_OBJECT "
    "IMAGE_FORMAT_DESCRIPTOR IMAGE_SIZE SAMPLER BINARY BUILD_OPTIONS PROGRAM PROGRAM_EXECUTABLE KERNEL_NAME "
    "KERNEL_DEFINITION KERNEL ARG_INDEX ARG_VALUE ARG_SIZE KERNEL_ARGS WORK_DIMENSION WORK_GROUP_SIZE WORK_ITEM_SIZE "
    "GLOBAL_OFFSET EVENT_WAIT_LIST EVENT OPERATION GL_OBJECT BUFFER_SIZE MIP_LEVEL GLOBAL_WORK_SIZE PROPERTY "
    "IMAGE_DESCRIPTOR COMPILER_OPTIONS LINKER_OPTIONS DEVICE_PARTITION_COUNT";

// The word at this index, or nothing beyond the last one.
std::string word(const char* words, int index) {
    std::istringstream stream(words);
    std::string found;
    for (int i = 0; i <= index; ++i)
        if (!(stream >> found)) return {};
    return found;
}

// FNV-1a.
std::uint64_t checksum(std::string_view bytes) {
    std::uint64_t sum = 14695981039346656037u;
    for (const char c : bytes) sum = (sum ^ static_cast<unsigned char>(c)) * 1099511628211u;
    return sum;
}

std::string_view viewed(const Binary& binary) {
    return {reinterpret_cast<const char*>(binary.data()), binary.size()};
}

// Reads a program from the cache. Nothing if the file is missing or damaged: drivers may crash on a damaged one.
std::optional<Binary> readBinary(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::string mark(fileMark.size(), '\0');
    std::uint64_t sum = 0;
    if (!file.read(mark.data(), std::streamsize(mark.size())) || mark != fileMark) return std::nullopt;
    if (!file.read(reinterpret_cast<char*>(&sum), sizeof sum)) return std::nullopt;
    Binary binary{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    if (binary.empty() || checksum(viewed(binary)) != sum) return std::nullopt;
    return binary;
}

// Stores a program in the cache. Errors are not reported: a full disk or a folder without permission only costs time at
// the next start.
void writeBinary(const std::filesystem::path& path, const cl::Program& program) {
    try {
        const Binary binary = program.getInfo<CL_PROGRAM_BINARIES>().front();
        std::filesystem::create_directories(path.parent_path());
        const std::uint64_t sum = checksum(viewed(binary));
        writeWhole(path, [&](std::ostream& file) {
            file.write(fileMark.data(), std::streamsize(fileMark.size()));
            file.write(reinterpret_cast<const char*>(&sum), sizeof sum);
            file.write(viewed(binary).data(), std::streamsize(binary.size()));
        });
    } catch (const cl::Error&) {
    } catch (const std::runtime_error&) {
    }
}

// Null if the driver rejects the binary.
cl::Program loaded(const DeviceImpl& device, const Binary& binary, const std::string& options) try {
    cl::Program program(device.context, {device.device}, {binary});
    program.build(options.c_str());
    return program;
} catch (const cl::Error&) {
    return {};
}

cl::Program compiled(const DeviceImpl& device, const std::string& source, const std::string& options) try {
    cl::Program program(device.context, source);
    program.build(options.c_str());
    return program;
} catch (const cl::Error& error) {
    throw deviceError(error, device.info.name);
}

}  // namespace

std::string errorName(cl_int code) {
    if (code <= 0)
        if (const std::string name = word(runTimeCodes, -code); !name.empty()) return "CL_" + name;
    if (code <= CL_INVALID_VALUE)
        if (const std::string name = word(invalidCodes, CL_INVALID_VALUE - code); !name.empty())
            return "CL_INVALID_" + name;
    return "code " + std::to_string(code);
}

DeviceError deviceError(const cl::Error& error, const std::string& deviceName) {
    std::string text = std::string(error.what()) + ": " + errorName(error.err()) + " on " + deviceName;
    if (const auto* build = dynamic_cast<const cl::BuildError*>(&error))
        for (const auto& [device, log] : build->getBuildLog()) text += "\n" + log;
    return DeviceError(text);
}

std::filesystem::path cachedProgram(const DeviceInfo& device, const std::string& source, const std::string& options) {
    std::filesystem::path folder;
    if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache == '/')
        folder = cache;
    else if (const char* home = std::getenv("HOME"); home && *home == '/')
        folder = std::filesystem::path(home) / ".cache";
    else
        return {};
    std::string key;
    for (const std::string& part :
         {device.platform, device.platformVersion, device.name, device.version, device.driver, options, source})
        key += part + '\0';
    constexpr const char* digits = "0123456789abcdef";
    std::string name;
    for (std::uint64_t sum = checksum(key), i = 0; i < 16; ++i, sum >>= 4) name += digits[sum & 15];
    return folder / "bilayer" / (name + ".program");
}

cl::Program buildProgram(DeviceImpl& device, const std::string& source, const std::string& options) {
    const std::lock_guard lock(device.mutex);
    cl::Program& program = device.programs[{source, options}];
    if (program()) return program;
    const std::filesystem::path path = cachedProgram(device.info, source, options);
    if (const auto binary = readBinary(path)) program = loaded(device, *binary, options);
    if (program()) return program;
    program = compiled(device, source, options);
    if (!path.empty()) writeBinary(path, program);
    return program;
}

cl::Kernel takeKernel(DeviceImpl& device, const cl::Program& program, const char* name) {
    const std::lock_guard lock(device.mutex);
    const auto found = device.kernels.find({program(), name});
    if (found == device.kernels.end()) return {program, name};
    cl::Kernel kernel = std::move(found->second);
    device.kernels.erase(found);
    return kernel;
}

void keepKernel(DeviceImpl& device, const cl::Program& program, const char* name, cl::Kernel kernel) {
    const std::lock_guard lock(device.mutex);
    device.kernels.emplace(std::pair(program(), name), std::move(kernel));
}

}  // namespace bilayer::detail
