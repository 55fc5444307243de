// SPDX-License-Identifier: Apache-2.0
// The checksum line at the end of .vdb files; internal.
// Tested by tests/sdf/vdb_io.cpp through readVdb().
#pragma once

#include <streambuf>
#include <string>
#include <string_view>
#include <vector>

namespace bilayer::detail {

/// Returns the line for the contents of a file. It follows the data that OpenVDB reads, so that damage is detected
/// before OpenVDB decodes the file: its Blosc decoder does not validate its input.
std::string checksumLine(std::string_view bytes);

/// Writes to another stream buffer, and computes the checksum of all that is written.
class ChecksumBuffer : public std::streambuf {
  public:
    explicit ChecksumBuffer(std::streambuf& to);

    /// Returns the checksum line of all that was written. Throws std::runtime_error if the other buffer fails.
    std::string line();

  protected:
    int_type overflow(int_type c) override;
    int sync() override;

  private:
    std::streambuf& to_;
    std::vector<char> waiting_;
    unsigned long sum_;
};

/// Accepts files without a checksum line, which come from other programs. Throws std::runtime_error if the line is
/// truncated, does not match the data, or is not at the end.
void requireChecksum(std::string_view file);

}  // namespace bilayer::detail
