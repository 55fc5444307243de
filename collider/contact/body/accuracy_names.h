// SPDX-License-Identifier: Apache-2.0
// The words for contact accuracies, in files, on the command line and in Python.
// Tested by tests/tools/report.cpp through the program.
#pragma once

#include <array>
#include <utility>

#include <bilayer/collider/collider.h>

namespace bilayer::detail {

inline constexpr std::array<std::pair<const char*, ContactAccuracy>, 3> accuracyNames{
    {{"samples", ContactAccuracy::samples},
     {"exact-near-features", ContactAccuracy::exactNearFeatures},
     {"exact", ContactAccuracy::exact}}};

}  // namespace bilayer::detail
