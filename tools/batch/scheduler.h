// SPDX-License-Identifier: Apache-2.0
// Runs the conversions of a batch.
// Tested by tests/tools/batch_limits.cpp through the program.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tools/batch/batch_folder.h"
#include "tools/batch/conversion.h"
#include "tools/batch/mesh_list.h"
#include "tools/batch/progress_line.h"
#include "tools/batch/shard.h"
#include "tools/batch/worker.h"

namespace bilayer::tools {

/// A shard of a batch.
struct BatchPlan {
    std::vector<BatchMesh> meshes;
    BatchFolder folder;
    Shard shard;
    ConversionOptions conversion;
    WorkerLimits limits;
    int threads = 1;           ///< maximum thread count of all workers together
    bool printsLines = false;  ///< also prints the records on standard output
};

struct BatchResult {
    BatchCounts counts;
    int signal = 0;            ///< that interrupted the batch, or 0
    std::string firstFailure;  ///< name and error of the first mesh that failed
};

/// Converts the meshes of a plan in processes of their own, one after the other in each. A mesh whose process ends is
/// tried again in a new one if the process had converted others, and fails alone. Small meshes run side by side; a
/// large mesh runs alone, with all threads, after the small ones. Meshes that other batches convert meanwhile are
/// looked at again at the end. Each mesh that is finished has a record. A signal ends all workers and leaves no partial
/// output.
///
/// The calling process must be single-threaded. Throws std::runtime_error if records, locks or folders cannot be
/// written, and std::system_error if processes cannot be created; workers are ended before that.
BatchResult runBatch(const BatchPlan& plan);

}  // namespace bilayer::tools
