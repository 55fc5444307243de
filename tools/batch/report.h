// SPDX-License-Identifier: Apache-2.0
// The report of a batch.
// Tested by tests/tools/batch_report.cpp through the program.
#pragma once

#include "tools/batch/batch_folder.h"

namespace bilayer::tools {

/// Reports on all records in the output folder of a batch: prints tables, histograms and the meshes to look at, or one
/// JSON object, and writes the same with thumbnails to report.html in that folder.
/// Throws std::runtime_error if there are no records, or if the page cannot be written.
void reportBatch(const BatchFolder& folder, bool json);

}  // namespace bilayer::tools
