// SPDX-License-Identifier: Apache-2.0
// The checksum line at the end of .vdb files; internal.
// Tested by tests/sdf/vdb_io.cpp.
#pragma once

#include <string>
#include <string_view>

namespace bilayer::detail {

/// Returns the line for the contents of a file. It follows the data that OpenVDB reads, so that damage is detected
/// before OpenVDB decodes the file: its Blosc decoder does not validate its input.
std::string checksumLine(std::string_view bytes);

/// Accepts files without a checksum line, which come from other programs. Throws std::runtime_error if the line is
/// truncated, does not match the data, or is not at the end.
void requireChecksum(std::string_view file);

}  // namespace bilayer::detail
