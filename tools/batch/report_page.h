// SPDX-License-Identifier: Apache-2.0
// The report of a batch as a page.
// Tested by tests/tools/batch_report.cpp through the program.
#pragma once

#include <string>
#include <vector>

#include "tools/batch/batch_folder.h"
#include "tools/batch/summary.h"

namespace bilayer::tools {

/// Returns an HTML page that needs no other file. It has tables, histograms and pictures: of the meshes to look at, and
/// of the first rows of the table of all meshes. It states what it leaves out.
std::string reportPage(const BatchFolder& folder, const std::vector<Json>& records, const BatchSummary& summary);

}  // namespace bilayer::tools
