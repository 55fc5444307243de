// SPDX-License-Identifier: Apache-2.0
// Plots as an SVG file: panels with labelled lines, below each other, either log-log with decades or linear with
// round steps.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace bilayer::demo {

/// A line: its points and the label at its end.
struct Line {
    std::string label;
    std::vector<double> x, y;  ///< positive, unless the panel is linear
};

struct Panel {
    std::string title, xLabel, yLabel;
    std::vector<double> xTicks;  ///< labelled positions; empty: each decade
    std::vector<Line> lines;     ///< at least one line of at least one point
    bool linear = false;         ///< both axes are linear and y starts at 0; otherwise both are logarithmic
};

/// Draws the panels. Lines with the same index in different panels share a colour. Throws std::invalid_argument if
/// there is nothing to draw.
std::string svg(const std::vector<Panel>& panels);

/// Throws std::runtime_error that names the file if it cannot be written.
void writeSvg(const std::filesystem::path& path, const std::vector<Panel>& panels);

}  // namespace bilayer::demo
