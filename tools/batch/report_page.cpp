// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/report_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <string_view>

#include "tools/batch/thumbnail.h"

namespace bilayer::tools {
namespace {

// Limits of a page that a browser opens at once: a thumbnail is about 3 kB, a row 300 bytes.
constexpr std::size_t maxThumbnails = 1000, maxRows = 20000;
constexpr int barPixels = 240, rowPixels = 18;  // of a histogram

constexpr const char* pageStart = R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>bilayer batch</title><style>
body { font: 14px sans-serif; margin: 2em; color: #222 }
table { border-collapse: collapse }
td, th { padding: 2px 10px; text-align: left; border-bottom: 1px solid #ddd; vertical-align: middle }
td.number { text-align: right; font-variant-numeric: tabular-nums }
tr.failed td { color: #a00 }
.histograms { display: flex; flex-wrap: wrap; gap: 2em }
img { display: block }
</style></head><body>
)";

std::string escaped(std::string_view text) {
    std::string result;
    for (const char c : text) switch (c) {
            case '&':
                result += "&amp;";
                break;
            case '<':
                result += "&lt;";
                break;
            case '>':
                result += "&gt;";
                break;
            case '"':
                result += "&quot;";
                break;
            default:
                result += c;
        }
    return result;
}

std::string base64(std::string_view bytes) {
    constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (std::size_t at = 0; at < bytes.size(); at += 3) {
        const std::size_t count = std::min<std::size_t>(3, bytes.size() - at);
        std::uint32_t bits = 0;
        for (std::size_t k = 0; k < 3; ++k) bits = bits << 8 | (k < count ? std::uint8_t(bytes[at + k]) : 0u);
        for (std::size_t k = 0; k < 4; ++k) text += k <= count ? digits[bits >> (18 - 6 * k) & 63] : '=';
    }
    return text;
}

// Pictures of meshes, as long as the page has room for them.
class Thumbnails {
  public:
    explicit Thumbnails(const BatchFolder& folder) : folder_(folder) {}

    std::string of(const Json& record) {
        if (left_ == 0) return {};
        std::ifstream stream(folder_.thumbnail(textIn(record, "file")), std::ios::binary);
        const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
        if (bytes.empty()) return {};
        --left_;
        return fmt::format(R"(<img width="{0}" height="{0}" alt="" src="data:image/png;base64,{1}">)", thumbnailSize,
                           base64(bytes));
    }

  private:
    const BatchFolder& folder_;
    std::size_t left_ = maxThumbnails;
};

std::string cell(double value, const char* format) {
    return fmt::format(R"(<td class="number">{}</td>)",
                       std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : std::string());
}

std::string countsTable(const BatchSummary& summary) {
    std::string rows;
    const auto row = [&](const std::string& label, std::size_t count) {
        rows += fmt::format("<tr><td>{}</td><td class=\"number\">{}</td></tr>\n", escaped(label), grouped(count));
    };
    row("meshes", summary.counts.total);
    row("done", summary.counts.done);
    row("skipped: up to date", summary.counts.skipped);
    row("failed", summary.counts.failed);
    for (const auto& [reason, count] : summary.failures) row("failed: " + reason, count);
    for (const auto& [sign, count] : summary.signs) row("sign by " + sign, count);
    return "<table>\n" + rows + "</table>\n";
}

std::string drawn(const LogHistogram& histogram) {
    if (histogram.bins.empty()) return {};
    std::string bars;
    int y = 0;
    for (const LogHistogram::Bin& bin : histogram.bins) {
        const int length = int(double(barPixels) * double(bin.count) / double(histogram.maxCount()));
        bars += fmt::format(
            R"(<text x="70" y="{}" text-anchor="end">{:g}</text><rect x="76" y="{}" width="{}" height="{}" fill="#47a"/><text x="{}" y="{}">{}</text>)"
            "\n",
            y + rowPixels - 5, bin.lower, y + 2, length, rowPixels - 4, 82 + length, y + rowPixels - 5,
            grouped(bin.count));
        y += rowPixels;
    }
    return fmt::format("<div><h3>{}</h3><svg width=\"{}\" height=\"{}\" font-size=\"12\">\n{}</svg></div>\n",
                       escaped(histogram.title), barPixels + 150, y, bars);
}

std::string lookAtTable(const BatchSummary& summary, Thumbnails& thumbnails) {
    if (summary.lookAt.empty()) return "<p>None.</p>\n";
    std::string rows;
    for (std::size_t i = 0; i < std::min(maxRows, summary.lookAt.size()); ++i) {
        const LookAtMesh& mesh = summary.lookAt[i];
        rows += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n", thumbnails.of(*mesh.record),
                            escaped(textIn(*mesh.record, "file")), escaped(mesh.why));
    }
    return "<table>\n" + rows + "</table>\n";
}

std::string meshTable(const std::vector<Json>& records, Thumbnails& thumbnails) {
    std::string rows;
    for (std::size_t i = 0; i < std::min(maxRows, records.size()); ++i) {
        const Json& record = records[i];
        rows +=
            fmt::format(R"(<tr class="{}"><td>{}</td><td>{}</td><td>{}</td>)", escaped(textIn(record, "outcome")),
                        thumbnails.of(record), escaped(textIn(record, "file")), escaped(textIn(record, "outcome"))) +
            cell(numberIn(record, "triangles"), "{:.0f}") + cell(numberIn(record, "activeVoxels"), "{:.0f}") +
            fmt::format("<td>{}</td>", escaped(textIn(record, "sign"))) +
            cell(numberIn(record, "signConflicts"), "{:.0f}") + cell(numberIn(record, "seconds/total"), "{:.3f}") +
            cell(numberIn(record, "peakBytes") / (1 << 20), "{:.0f}") + "</tr>\n";
    }
    return "<table>\n<tr><th></th><th>mesh</th><th>outcome</th><th>triangles</th><th>active voxels</th><th>sign</th>"
           "<th>conflicts</th><th>seconds</th><th>MiB</th></tr>\n" +
           rows + "</table>\n";
}

}  // namespace

std::string reportPage(const BatchFolder& folder, const std::vector<Json>& records, const BatchSummary& summary) {
    Thumbnails thumbnails(folder);
    std::string page = pageStart;
    page += fmt::format("<h1>{}</h1>\n", escaped(folder.root().string())) + countsTable(summary);
    page += "<h2>Histograms</h2>\n<div class=\"histograms\">\n";
    for (const LogHistogram& histogram : summary.histograms) page += drawn(histogram);
    page += fmt::format("</div>\n<h2>{} meshes to look at</h2>\n", grouped(summary.lookAt.size()));
    page += lookAtTable(summary, thumbnails);
    page += fmt::format("<h2>{} meshes</h2>\n", grouped(records.size()));
    if (records.size() > std::min(maxRows, maxThumbnails))
        page += fmt::format("<p>Tables have up to {} rows, and the page up to {} pictures. The records have all.</p>\n",
                            grouped(maxRows), grouped(maxThumbnails));
    return page + meshTable(records, thumbnails) + "</body></html>\n";
}

}  // namespace bilayer::tools
