// SPDX-License-Identifier: Apache-2.0
// Text from files in messages: short, on one line, and without characters that steer a terminal; internal.
// Tested by tests/sdf/vdb_io.cpp.
#pragma once

#include <string>
#include <string_view>

namespace bilayer::detail {

/// Returns a word of a file in quotation marks, truncated to 40 characters. Unprintable characters become question
/// marks.
std::string quotedWord(std::string_view word);

/// Makes one line of a text that a library made of damaged input, truncated to about 300 bytes. Characters other than
/// printable ASCII become spaces.
std::string oneLine(std::string text);

}  // namespace bilayer::detail
