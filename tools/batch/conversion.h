// SPDX-License-Identifier: Apache-2.0
// From one mesh file to one field file: what a worker of a batch does.
// Tested by tests/tools/batch.cpp through the program.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "tools/build.h"
#include "tools/output.h"

namespace bilayer::tools {

/// What all conversions of a batch have in common.
struct ConversionOptions {
    BuildArguments build;
    std::string optionsText;       ///< the options that determine a field, as one line
    std::uint64_t largeBytes = 0;  ///< a mesh whose estimated memory exceeds this is large [bytes]
};

/// One mesh, and where its results go.
struct ConversionTask {
    std::filesystem::path mesh;
    std::filesystem::path output;  ///< the finished field, if there is one
    std::filesystem::path work;    ///< an existing folder for the new field and the thumbnail
    int threads = 1;
    bool mayBeLarge = false;  ///< builds a large mesh too, instead of handing it back
};

/// Is given what a record has so far, in case that the conversion ends the process.
using ReportKnown = std::function<void(const Json&)>;

/// Converts a mesh unless its output is up to date: made from a file of the same contents with the same options.
///
/// Returns the fields of the mesh's record: "outcome" and what is known of the mesh. Outcomes are:
/// - "done": the work folder holds the field;
/// - "skipped": the output is up to date;
/// - "large": the mesh must be built alone; "estimatedBytes" states how much memory it needs;
/// - "failed": "error" states why.
/// The work folder holds a thumbnail if the mesh was read. Throws std::bad_alloc.
Json convert(const ConversionOptions& options, const ConversionTask& task, const ReportKnown& report);

}  // namespace bilayer::tools
