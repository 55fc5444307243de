// SPDX-License-Identifier: Apache-2.0
// Small greyscale pictures as PNG files.
// Tested by tests/tools/batch_report.cpp through the program.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace bilayer::tools {

struct GreyImage {
    int width = 0, height = 0;
    std::vector<std::uint8_t> pixels;  ///< row by row from the top
};

/// Returns the contents of a PNG file.
std::string pngOf(const GreyImage& image);

}  // namespace bilayer::tools
