// SPDX-License-Identifier: Apache-2.0
// The records of a batch: one JSON object a line for each mesh.
// Tested by tests/tools/batch.cpp through the program.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/batch/shard.h"
#include "tools/output.h"

namespace bilayer::tools {

/// A file of records, which no other process writes to.
class RecordFile {
  public:
    /// Creates the file on the first record. Its name contains the shard, the machine, the process and the time.
    RecordFile(std::filesystem::path folder, const Shard& shard);
    ~RecordFile();
    RecordFile(const RecordFile&) = delete;
    RecordFile& operator=(const RecordFile&) = delete;

    /// Appends one line at once. Throws std::runtime_error that names the file.
    void add(const std::string& line);

    const std::filesystem::path& path() const { return path_; }

  private:
    std::filesystem::path path_;
    int file_ = -1;
};

/// Returns the name or path of a file as a record has it: as it is, or if it is no UTF-8 with other bytes as "\xff".
std::string textOf(const std::string& name);

/// Returns a record as a line.
std::string lineOf(const Json& record);

/// Returns the time of day in UTC, to the millisecond: "2024-05-01T12:00:00.000Z".
std::string timeText();

/// The last record of each mesh in a folder of records, in the order of their names.
struct RecordList {
    std::vector<Json> records;
    std::size_t damagedLines = 0;  ///< lines that are no record, as after a power failure
};

/// Reads all records of a folder. A mesh that was skipped keeps the record of its conversion. Throws
/// std::runtime_error that names the folder or file that cannot be read.
RecordList readRecords(const std::filesystem::path& folder);

}  // namespace bilayer::tools
