// SPDX-License-Identifier: Apache-2.0
// The version of the program, and of what it was built with.
// Tested by tests/tools/usage.cpp through run().
#include <LinearMath/btScalar.h>
#include <assimp/version.h>
#include <fmt/format.h>
#include <hwy/highway.h>
#include <libqhull_r/libqhull_r.h>
#include <openvdb/version.h>
#include <tbb/version.h>
#include <zlib.h>

#include <CLI/CLI.hpp>
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

}  // namespace

std::string versions() {
    return fmt::format(
        "bilayer {}\n"
        "compiler       {}\n"
        "OpenVDB        {}\n"
        "oneTBB         {}.{}\n"
        "Assimp         {}.{}.{}\n"
        "Highway        {}.{}.{}\n"
        "Qhull          {}\n"
        "GLM            {}.{}.{}.{}\n"
        "Bullet         {}.{}\n"
        "zlib           {}\n"
        "fmt            {}\n"
        "nlohmann json  {}.{}.{}\n"
        "CLI11          {}",
        BILAYER_VERSION, compiler, OPENVDB_LIBRARY_VERSION_STRING, TBB_VERSION_MAJOR, TBB_VERSION_MINOR,
        aiGetVersionMajor(), aiGetVersionMinor(), aiGetVersionPatch(), HWY_MAJOR, HWY_MINOR, HWY_PATCH, qh_version,
        GLM_VERSION_MAJOR, GLM_VERSION_MINOR, GLM_VERSION_PATCH, GLM_VERSION_REVISION, BT_BULLET_VERSION / 100,
        BT_BULLET_VERSION % 100, zlibVersion(), fmtVersion(), NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR,
        NLOHMANN_JSON_VERSION_PATCH, CLI11_VERSION);
}

}  // namespace bilayer::tools
