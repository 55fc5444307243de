// A plot as an SVG file: panels, up to three in a row, with labelled lines, log-log with decades or linear with round
// steps.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace bilayer::demo {

/// A line: its points and the text at its end.
struct Line {
    std::string label;
    std::vector<double> x, y;  ///< positive, unless the panel is linear
};

struct Panel {
    std::string title, xLabel, yLabel;
    std::vector<double> xTicks;  ///< where x is labelled; empty: at each decade
    std::vector<Line> lines;     ///< at least one, of at least one point
    bool linear = false;         ///< both axes, y from 0; else logarithmic
};

/// Draws the panels; lines of the same place in each panel share a colour. Throws std::invalid_argument where there is
/// nothing to draw.
std::string svg(const std::vector<Panel>& panels);

/// Throws std::runtime_error that names the file when it cannot be written.
void writeSvg(const std::filesystem::path& path, const std::vector<Panel>& panels);

}  // namespace bilayer::demo
