// SPDX-License-Identifier: Apache-2.0
#include "sdf/base/quoted_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstddef>

namespace bilayer::detail {
namespace {

constexpr std::size_t maxQuoted = 40;       // characters
constexpr std::size_t maxLineLength = 300;  // [bytes]: libraries quote the contents of the file

}  // namespace

std::string quotedWord(std::string_view word) {
    std::string shown(word.substr(0, maxQuoted));
    for (char& c : shown)
        if (!std::isprint(static_cast<unsigned char>(c))) c = '?';
    return fmt::format("'{}{}'", shown, word.size() > maxQuoted ? "..." : "");
}

std::string oneLine(std::string text) {
    for (char& c : text)
        if (std::iscntrl(static_cast<unsigned char>(c)) || static_cast<unsigned char>(c) >= 0x80) c = ' ';
    const std::size_t end = text.find_last_not_of(' ');
    text.erase(end == std::string::npos ? 0 : end + 1);
    if (text.size() > maxLineLength)
        text = text.substr(0, std::min(text.rfind(' ', maxLineLength), maxLineLength)) + " ...";
    return text;
}

}  // namespace bilayer::detail
