// SPDX-License-Identifier: Apache-2.0
// The names of build methods and sign methods: on the command line, in metadata, in errors and in benchmarks.
// Tested by tests/sdf/build.cpp.
#pragma once

#include <array>
#include <utility>

#include <bilayer/sdf/options.h>

namespace bilayer::detail {

inline constexpr std::array<std::pair<const char*, Method>, 4> methodNames{{{"exact", Method::exact},
                                                                            {"double-layer", Method::doubleLayer},
                                                                            {"pseudonormal", Method::pseudonormal},
                                                                            {"prism", Method::prism}}};
inline constexpr std::array<std::pair<const char*, Sign>, 4> signNames{
    {{"auto", Sign::automatic}, {"normals", Sign::normals}, {"winding", Sign::winding}, {"flood", Sign::flood}}};

/// What LevelSet::sign() returns for the methods that have their own signs.
inline constexpr const char *layerSigns = "layers", *prismSigns = "prisms";

constexpr const char* nameOf(Method method) {
    for (const auto& [name, named] : methodNames)
        if (named == method) return name;
    return "";
}

constexpr const char* nameOf(Sign sign) {
    for (const auto& [name, named] : signNames)
        if (named == sign) return name;
    return "";
}

}  // namespace bilayer::detail
