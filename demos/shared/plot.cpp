// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <stdexcept>

namespace bilayer::demo {
namespace {

// [pixels]
constexpr double panelWidth = 620, panelHeight = 400, left = 70, right = 200, top = 44, bottom = 54;
constexpr double labelSpacing = 34;  // min distance of labels at the ends of lines
constexpr std::array colours{"#1f5fa8", "#c4572b", "#3d8a4f", "#7a4fa0", "#b8860b", "#1b98a0", "#b0478c", "#5a5a5a"};

// A point that exceeds a decade by less than this does not add another decade [decades].
constexpr double decadeSlack = 0.02;

constexpr std::size_t maxMarks = 30;  // max points of a line with markers in a linear panel
constexpr double steps = 5;           // approximate count of steps of a linear axis

// Maps an axis to pixels, from whole decade to whole decade or from tick to tick. `low` and `high` are logarithms,
// unless the axis is linear with steps of `step`.
struct Axis {
    double low, high, from, to, step = 0;

    double operator()(double value) const {
        return from + ((step > 0 ? value : std::log10(value)) - low) / (high - low) * (to - from);
    }
};

// Returns an axis that starts at or below 0, with steps of 1, 2 or 5 times a power of ten.
Axis linearAxisOf(const std::vector<double>& values, double from, double to) {
    const auto [smallest, largest] = std::minmax_element(values.begin(), values.end());
    const double low = std::min(0.0, *smallest), high = *largest > low ? *largest : low + 1;
    const double rough = (high - low) / steps, decade = std::pow(10, std::floor(std::log10(rough)));
    const double step = decade * (rough > 5 * decade ? 10 : rough > 2 * decade ? 5 : rough > decade ? 2 : 1);
    return {step * std::floor(low / step + 1e-9), step * std::ceil(high / step - 1e-9), from, to, step};
}

Axis axisOf(const std::vector<double>& values, bool wholeDecades, double from, double to) {
    const auto [smallest, largest] = std::minmax_element(values.begin(), values.end());
    double low = std::log10(*smallest), high = std::log10(*largest);
    if (wholeDecades) {
        low = std::floor(low + decadeSlack);
        high = std::ceil(high - decadeSlack);
    }
    if (high <= low) high = low + 1;
    return {low, high, from, to};
}

std::vector<double> ticksOf(const Axis& axis) {
    std::vector<double> ticks;
    if (axis.step > 0)
        for (int i = 0; axis.low + i * axis.step <= axis.high + 1e-9 * axis.step; ++i)
            ticks.push_back(axis.low + i * axis.step);
    if (axis.step > 0) return ticks;
    for (double power = std::ceil(axis.low - 1e-9); power <= axis.high + 1e-9; ++power)
        ticks.push_back(std::pow(10, power));
    return ticks;
}

// Formats a power of ten as 10 with an exponent, and any other number as it is.
std::string tickText(const Axis& axis, double value) {
    if (axis.step > 0) return fmt::format("{:.6g}", std::abs(value) < 1e-9 * axis.step ? 0 : value);
    const double power = std::log10(value);
    if (std::abs(power - std::round(power)) > 1e-9 || (power >= -1 && power <= 2)) return fmt::format("{:g}", value);
    return fmt::format("10<tspan dy=\"-5\" font-size=\"9\">{:g}</tspan>", std::round(power));
}

std::string rule(double x1, double y1, double x2, double y2, const char* colour) {
    return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\"/>\n", x1, y1, x2,
                       y2, colour);
}

std::string text(double x, double y, const char* attributes, const std::string& words) {
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" {}>{}</text>\n", x, y, attributes, words);
}

std::string grid(const Panel& panel, const Axis& x, const Axis& y) {
    std::string out;
    const auto parts = [](const Axis& axis) { return axis.step > 0 ? 2 : 10; };
    const auto fits = [](const Axis& axis, double value) {
        return axis.step > 0 || value <= std::pow(10, axis.high) * 1.0001;
    };
    for (const double tick : ticksOf(y))
        for (int part = 1; part < parts(y) && fits(y, tick * part); ++part)
            out += rule(x.from, y(tick * part), x.to, y(tick * part), part == 1 ? "#c8c8c8" : "#efefef");
    const bool named = !panel.xTicks.empty();
    for (const double tick : named ? panel.xTicks : ticksOf(x))
        for (int part = 1; part < (named ? 2 : parts(x)) && fits(x, tick * part); ++part)
            out += rule(x(tick * part), y.from, x(tick * part), y.to, part == 1 ? "#c8c8c8" : "#efefef");
    for (const double tick : ticksOf(y)) out += text(x.from - 8, y(tick) + 4, "text-anchor=\"end\"", tickText(y, tick));
    for (const double tick : named ? panel.xTicks : ticksOf(x))
        out += text(x(tick), y.from + 18, "text-anchor=\"middle\"", tickText(x, tick));
    return out;
}

// Labels are at the ends of their lines, and are pushed apart where lines end close together.
std::string lines(const Panel& panel, const Axis& x, const Axis& y) {
    std::vector<std::pair<double, std::size_t>> ends;
    for (std::size_t i = 0; i < panel.lines.size(); ++i) ends.push_back({y(panel.lines[i].y.back()), i});
    std::sort(ends.begin(), ends.end());
    std::string out;
    double above = -std::numeric_limits<double>::infinity();
    for (const auto& [end, i] : ends) {
        const Line& line = panel.lines[i];
        const char* colour = colours[i % colours.size()];
        std::string points;
        for (std::size_t k = 0; k < line.x.size(); ++k) {
            points += fmt::format("{:.1f},{:.1f} ", x(line.x[k]), y(line.y[k]));
            if (!panel.linear || line.x.size() <= maxMarks)
                out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\"/>\n", x(line.x[k]),
                                   y(line.y[k]), colour);
        }
        out +=
            fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\"/>\n", points, colour);
        above = std::max(end, above + labelSpacing);
        const std::size_t comma = line.label.find(", ");
        const std::string fill = fmt::format("fill=\"{}\"", colour);
        out += text(x.to + 10, above + 4, (fill + " font-weight=\"bold\"").c_str(), line.label.substr(0, comma));
        if (comma != std::string::npos) out += text(x.to + 10, above + 19, fill.c_str(), line.label.substr(comma + 2));
    }
    return out;
}

std::string drawn(const Panel& panel) {
    std::vector<double> xs = panel.xTicks, ys;
    for (const Line& line : panel.lines) {
        xs.insert(xs.end(), line.x.begin(), line.x.end());
        ys.insert(ys.end(), line.y.begin(), line.y.end());
    }
    if (xs.empty() || ys.empty()) throw std::invalid_argument("a plot needs points");
    const Axis x = panel.linear ? linearAxisOf(xs, left, panelWidth - right)
                                : axisOf(xs, panel.xTicks.empty(), left, panelWidth - right);
    const Axis y =
        panel.linear ? linearAxisOf(ys, panelHeight - bottom, top) : axisOf(ys, true, panelHeight - bottom, top);
    const double middle = (x.from + x.to) / 2, centre = (y.from + y.to) / 2;
    std::string out = grid(panel, x, y) + rule(x.from, y.from, x.to, y.from, "#444") +
                      rule(x.from, y.from, x.from, y.to, "#444") + lines(panel, x, y);
    out += text(middle, top - 18, "text-anchor=\"middle\" font-size=\"14\" font-weight=\"bold\"", panel.title);
    out += text(middle, panelHeight - 12, "text-anchor=\"middle\"", panel.xLabel);
    const std::string turned = fmt::format("text-anchor=\"middle\" transform=\"rotate(-90 18 {:.1f})\"", centre);
    return out + text(18, centre, turned.c_str(), panel.yLabel);
}

}  // namespace

std::string svg(const std::vector<Panel>& panels) {
    if (panels.empty()) throw std::invalid_argument("a plot needs a panel");
    std::string out = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:g} {1:g}\" width=\"{0:g}\" height=\"{1:g}\" "
        "font-family=\"DejaVu Sans, Helvetica, sans-serif\" font-size=\"12\" fill=\"#222\">\n"
        "<rect width=\"{0:g}\" height=\"{1:g}\" fill=\"white\"/>\n",
        panelWidth, panelHeight * double(panels.size()));
    for (std::size_t i = 0; i < panels.size(); ++i)
        out += fmt::format("<g transform=\"translate(0 {:g})\">\n{}</g>\n", panelHeight * double(i), drawn(panels[i]));
    return out + "</svg>\n";
}

void writeSvg(const std::filesystem::path& path, const std::vector<Panel>& panels) {
    std::ofstream file(path);
    file << svg(panels);
    if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
}

}  // namespace bilayer::demo
