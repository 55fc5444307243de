// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/report.h"

#include <fmt/format.h>

#include "tools/batch/records.h"
#include "tools/batch/report_page.h"
#include "tools/batch/summary.h"
#include "tools/output.h"

namespace bilayer::tools {
namespace {

constexpr std::size_t barLength = 40;    // characters of the longest bar of a histogram
constexpr std::size_t maxListed = 1000;  // meshes to look at in the text; the page and the records have more

void printHistogram(const LogHistogram& histogram) {
    if (histogram.bins.empty()) return;
    fmt::print("{}\n", histogram.title);
    for (const LogHistogram::Bin& bin : histogram.bins)
        fmt::print("  {:>6g} .. {:<6g} {:>8}  {}\n", bin.lower, bin.upper, grouped(bin.count),
                   std::string((barLength * bin.count + histogram.maxCount() - 1) / histogram.maxCount(), '#'));
}

void printLookAt(const BatchSummary& summary) {
    if (summary.lookAt.empty()) return;
    fmt::print("to look at\n");
    for (std::size_t i = 0; i < std::min(maxListed, summary.lookAt.size()); ++i)
        fmt::print("  {}: {}\n", textIn(*summary.lookAt[i].record, "file"), summary.lookAt[i].why);
    if (summary.lookAt.size() > maxListed) fmt::print("  and {} more\n", summary.lookAt.size() - maxListed);
}

void printText(const std::filesystem::path& root, const BatchSummary& summary, std::size_t damagedLines) {
    const BatchCounts& counts = summary.counts;
    Table table(root.string());
    table.row("meshes", grouped(counts.total));
    table.row("done", grouped(counts.done));
    table.row("skipped", grouped(counts.skipped));
    table.row("failed", grouped(counts.failed));
    for (const auto& [reason, count] : summary.failures) table.row("  " + reason, grouped(count));
    for (const auto& [sign, count] : summary.signs) table.row("sign", fmt::format("{} {}", grouped(count), sign));
    table.row("time", fmt::format("{:.1f} s of all workers", summary.seconds));
    if (damagedLines) table.row("damaged", fmt::format("{} lines of the records", grouped(damagedLines)));
    table.print();
    for (const LogHistogram& histogram : summary.histograms) printHistogram(histogram);
    printLookAt(summary);
}

Json summaryJson(const BatchSummary& summary, std::size_t damagedLines) {
    Json histograms = Json::object(), lookAt = Json::array();
    for (const LogHistogram& histogram : summary.histograms) {
        Json bins = Json::array();
        for (const LogHistogram::Bin& bin : histogram.bins)
            bins.push_back({{"lower", bin.lower}, {"upper", bin.upper}, {"count", bin.count}});
        histograms[histogram.title] = bins;
    }
    for (const LookAtMesh& mesh : summary.lookAt)
        lookAt.push_back({{"file", textIn(*mesh.record, "file")}, {"why", mesh.why}});
    return {{"meshes", summary.counts.total},  {"done", summary.counts.done},  {"skipped", summary.counts.skipped},
            {"failed", summary.counts.failed}, {"failures", summary.failures}, {"signs", summary.signs},
            {"seconds", summary.seconds},      {"histograms", histograms},     {"lookAt", lookAt},
            {"damagedLines", damagedLines}};
}

}  // namespace

void reportBatch(const BatchFolder& folder, bool json) {
    const RecordList list = readRecords(folder.records());
    const BatchSummary summary = summaryOf(list.records);
    if (json)
        print(summaryJson(summary, list.damagedLines));
    else
        printText(folder.root(), summary, list.damagedLines);
    writeText(folder.root() / "report.html", reportPage(folder, list.records, summary));
}

}  // namespace bilayer::tools
