// SPDX-License-Identifier: Apache-2.0
// The version of the program, and of what it was built with.
// Tested by tests/tools/usage.cpp through the program.
#include <Imath/ImathConfig.h>
#include <LinearMath/btScalar.h>
#include <assimp/version.h>
#include <blosc.h>
#include <fmt/format.h>
#include <hwy/highway.h>
#include <libqhull_r/libqhull_r.h>
#include <nanovdb/NanoVDB.h>
#include <openvdb/version.h>
#include <tbb/version.h>
#include <zlib.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <boost/version.hpp>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>
#include <string>

#include "tools/commands.h"

namespace bilayer::tools {

namespace {

#ifdef __clang__
constexpr const char* compiler = "Clang " __clang_version__;
#else
constexpr const char* compiler = "GCC " __VERSION__;
#endif

std::string fmtVersion() {
    return fmt::format("{}.{}.{}", FMT_VERSION / 10000, FMT_VERSION / 100 % 100, FMT_VERSION % 100);
}

std::string boostVersion() {
    std::string version = BOOST_LIB_VERSION;
    std::replace(version.begin(), version.end(), '_', '.');
    return version;
}

}  // namespace

// Versions of libraries as their headers state them, or as CMake found them where headers do not
// (tools/CMakeLists.txt).
std::string versions() {
    return fmt::format(
        "bilayer {}\n"
        "compiler        {}\n"
        "OpenVDB         {}\n"
        "NanoVDB         {}.{}.{}\n"
        "oneTBB          {}.{}\n"
        "Assimp          {}.{}.{}\n"
        "Highway         {}.{}.{}\n"
        "Qhull           {}\n"
        "GLM             {}.{}.{}.{}\n"
        "Bullet          {}.{}\n"
        "OpenCL headers  {}\n"
        "Blosc           {}\n"
        "Boost           {}\n"
        "Imath           {}\n"
        "zlib            {}\n"
        "fmt             {}\n"
        "nlohmann json   {}.{}.{}\n"
        "tinygltf        {}\n"
        "fast_float      {}\n"
        "CLI11           {}",
        BILAYER_VERSION, compiler, OPENVDB_LIBRARY_VERSION_STRING, NANOVDB_MAJOR_VERSION_NUMBER,
        NANOVDB_MINOR_VERSION_NUMBER, NANOVDB_PATCH_VERSION_NUMBER, TBB_VERSION_MAJOR, TBB_VERSION_MINOR,
        aiGetVersionMajor(), aiGetVersionMinor(), aiGetVersionPatch(), HWY_MAJOR, HWY_MINOR, HWY_PATCH, qh_version,
        GLM_VERSION_MAJOR, GLM_VERSION_MINOR, GLM_VERSION_PATCH, GLM_VERSION_REVISION, BT_BULLET_VERSION / 100,
        BT_BULLET_VERSION % 100, OPENCL_HEADERS_VERSION, BLOSC_VERSION_STRING, boostVersion(), IMATH_VERSION_STRING,
        zlibVersion(), fmtVersion(), NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR,
        NLOHMANN_JSON_VERSION_PATCH, TINYGLTF_VERSION, FAST_FLOAT_VERSION, CLI11_VERSION);
}

}  // namespace bilayer::tools
