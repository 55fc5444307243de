// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace bilayer::tools {
namespace {

constexpr double outlierFactor = 10;                  // times the median
constexpr double slowSeconds = 1, largeMemory = 1e8;  // smaller outliers hurt nobody

// The step of a histogram below a value: 1 or 3 times a power of ten.
double stepBelow(double value) {
    const double power = std::pow(10, std::floor(std::log10(value)));
    return value >= 3 * power ? 3 * power : power;
}

double nextStep(double step) {
    const double power = std::pow(10, std::floor(std::log10(step) + 1e-9));
    return step > 2 * power ? 10 * power : 3 * power;
}

std::vector<double> numbersIn(const std::vector<const Json*>& records, const std::string& path) {
    std::vector<double> values;
    for (const Json* record : records)
        if (const double value = numberIn(*record, path); value > 0) values.push_back(value);
    return values;
}

LogHistogram histogramOf(std::string title, std::vector<double> values) {
    LogHistogram histogram{std::move(title), {}};
    std::sort(values.begin(), values.end());
    for (const double value : values) {
        if (histogram.bins.empty()) {
            const double lower = stepBelow(value);
            histogram.bins.push_back({lower, nextStep(lower), 0});
        }
        while (value >= histogram.bins.back().upper) {
            const double lower = histogram.bins.back().upper;
            histogram.bins.push_back({lower, nextStep(lower), 0});
        }
        ++histogram.bins.back().count;
    }
    return histogram;
}

double medianOf(std::vector<double> values) {
    if (values.empty()) return std::numeric_limits<double>::infinity();
    const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

struct Medians {
    double seconds, bytes;
};

// Returns why somebody should look at a mesh that was converted, or nothing.
std::string oddity(const Json& record, const Medians& medians) {
    std::vector<std::string> reasons;
    const double conflicts = numberIn(record, "signConflicts"), seconds = numberIn(record, "seconds/total"),
                 bytes = numberIn(record, "peakBytes");
    if (conflicts > 0) reasons.push_back(fmt::format("{:.0f} sign conflicts", conflicts));
    if (const auto read = record.find("read"); read != record.end() && read->is_object())
        if (const auto notes = read->find("notes"); notes != read->end() && notes->is_array())
            for (const Json& note : *notes)
                if (note.is_string()) reasons.push_back(note);
    if (seconds > slowSeconds && seconds > outlierFactor * medians.seconds)
        reasons.push_back(fmt::format("took {:.3g} s, the median is {:.3g} s", seconds, medians.seconds));
    if (bytes > largeMemory && bytes > outlierFactor * medians.bytes)
        reasons.push_back(fmt::format("took {:.0f} MB, the median is {:.0f} MB", bytes / 1e6, medians.bytes / 1e6));
    return fmt::format("{}", fmt::join(reasons, "; "));
}

void count(BatchSummary& summary, const Json& record) {
    const std::string outcome = textIn(record, "outcome");
    BatchCounts& counts = summary.counts;
    ++counts.total;
    ++(outcome == "done" ? counts.done : outcome == "skipped" ? counts.skipped : counts.failed);
    if (outcome == "done")
        ++summary.signs[fmt::format("{}: {}", textIn(record, "sign"), textIn(record, "signReason"))];
    else if (outcome != "skipped")
        ++summary.failures[textIn(record, "reason")];
    if (const double seconds = numberIn(record, "seconds/total"); seconds > 0) summary.seconds += seconds;
}

}  // namespace

std::size_t LogHistogram::maxCount() const {
    std::size_t count = 0;
    for (const Bin& bin : bins) count = std::max(count, bin.count);
    return count;
}

std::string textIn(const Json& record, const char* name) {
    const auto member = record.find(name);
    return member != record.end() && member->is_string() ? member->get<std::string>() : std::string();
}

double numberIn(const Json& record, const std::string& path) {
    const Json::json_pointer pointer("/" + path);
    if (!record.contains(pointer) || !record[pointer].is_number()) return std::numeric_limits<double>::quiet_NaN();
    return record[pointer].get<double>();
}

BatchSummary summaryOf(const std::vector<Json>& records) {
    BatchSummary summary;
    std::vector<const Json*> done;
    for (const Json& record : records) {
        count(summary, record);
        if (record["outcome"] == "done") done.push_back(&record);
        if (record["outcome"] == "failed")
            summary.lookAt.push_back({&record, textIn(record, "reason") + ": " + textIn(record, "error")});
    }
    const std::vector<double> seconds = numbersIn(done, "seconds/total"), bytes = numbersIn(done, "peakBytes");
    const Medians medians{medianOf(seconds), medianOf(bytes)};
    for (const Json* record : done)
        if (const std::string why = oddity(*record, medians); !why.empty()) summary.lookAt.push_back({record, why});
    summary.histograms = {histogramOf("triangles", numbersIn(done, "triangles")),
                          histogramOf("active voxels", numbersIn(done, "activeVoxels")),
                          histogramOf("seconds", seconds), histogramOf("peak memory [bytes]", bytes)};
    return summary;
}

}  // namespace bilayer::tools
