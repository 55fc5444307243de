// SPDX-License-Identifier: Apache-2.0
// What the records of a batch say together.
// Tested by tests/tools/batch_report.cpp through the program.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "tools/batch/progress_line.h"
#include "tools/batch/records.h"

namespace bilayer::tools {

/// Counts of values between steps of about the square root of ten: 1, 3, 10, 30, ...
struct LogHistogram {
    struct Bin {
        double lower = 0, upper = 0;
        std::size_t count = 0;
    };
    std::string title;
    std::vector<Bin> bins;  ///< neighbouring; empty without values
    std::size_t maxCount() const;
};

/// A mesh that somebody should look at.
struct LookAtMesh {
    const Json* record;
    std::string why;
};

struct BatchSummary {
    BatchCounts counts;
    std::map<std::string, std::size_t> failures;  ///< count by reason
    std::map<std::string, std::size_t> signs;     ///< count by sign method and its reason
    double seconds = 0;                           ///< of all conversions together
    std::vector<LogHistogram> histograms;
    std::vector<LookAtMesh> lookAt;  ///< failures first
};

/// Summarises records, which must outlive the summary.
BatchSummary summaryOf(const std::vector<Json>& records);

/// Returns the text of a string member, or nothing.
std::string textIn(const Json& record, const char* name);

/// Returns a number of a record, or NaN. A path has its members separated by '/': "seconds/total".
double numberIn(const Json& record, const std::string& path);

}  // namespace bilayer::tools
