// SPDX-License-Identifier: Apache-2.0
// Formats tables and numbers for the page.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <sstream>
#include <string>
#include <vector>

namespace bilayer::paper {

/// A table in Markdown.
inline std::string table(const std::vector<std::string>& head, const std::vector<std::vector<std::string>>& rows) {
    const auto line = [](const std::vector<std::string>& cells) {
        std::string text = "|";
        for (const std::string& cell : cells) text += " " + cell + " |";
        return text + "\n";
    };
    std::string text = line(head) + "|";
    for (std::size_t i = 0; i < head.size(); ++i) text += "---|";
    text += "\n";
    for (const auto& row : rows) text += line(row);
    return text;
}

/// The same text with paragraphs wrapped at spaces. Tables, headings and pictures stay unchanged.
inline std::string wrapped(const std::string& text, std::size_t width = 128) {
    std::string result;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        while (line.size() > width && line[0] != '|' && line[0] != '#' && line[0] != '!') {
            const std::size_t space = line.rfind(' ', width);
            if (space == std::string::npos || space < 2) break;
            result += line.substr(0, space) + "\n";
            line = (line.starts_with("- ") || line.starts_with("  ") ? "  " : "") + line.substr(space + 1);
        }
        result += line + "\n";
    }
    return result;
}

/// `count` significant digits; all digits before the point.
inline std::string digits(double value, int count = 3) {
    if (value == 0 || !std::isfinite(value)) return fmt::format("{}", value);
    const int before = int(std::floor(std::log10(std::abs(value)))) + 1;
    if (before <= -3) return fmt::format("{:.{}e}", value, count - 1);
    return fmt::format("{:.{}f}", value, std::max(0, count - before));
}

/// A number of the paper's, with two decimals as all its times have.
inline std::string printed(double value) {
    return fmt::format("{:.2f}", value);
}

/// Seconds; "-" for no value.
inline std::string seconds(double value) {
    return std::isfinite(value) ? digits(value) : "-";
}

inline std::string percent(double part, double whole) {
    if (part == 0) return "0";
    return digits(100 * part / whole, 2) + " %";
}

}  // namespace bilayer::paper
