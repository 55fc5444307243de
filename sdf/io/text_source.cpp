// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/text_source.h"

#include <fmt/format.h>

#include <fast_float/fast_float.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <utility>

namespace bilayer::detail {
namespace {

enum class Encoding { bytes, utf16Little, utf16Big };

// Detects the encoding by the byte order mark, or by the zero bytes of ASCII letters in UTF-16.
Encoding encodingOf(std::string_view bytes) {
    if (bytes.size() < 4) return Encoding::bytes;
    if (bytes.starts_with("\xff\xfe")) return Encoding::utf16Little;
    if (bytes.starts_with("\xfe\xff")) return Encoding::utf16Big;
    const auto isLetter = [&](int i) { return std::isprint(static_cast<unsigned char>(bytes[i])) != 0; };
    if (isLetter(0) && bytes[1] == 0 && isLetter(2) && bytes[3] == 0) return Encoding::utf16Little;
    if (bytes[0] == 0 && isLetter(1) && bytes[2] == 0 && isLetter(3)) return Encoding::utf16Big;
    return Encoding::bytes;
}

// Mesh data is ASCII; other characters occur only in names and comments.
std::string decoded(std::string_view bytes, bool little) {
    std::string text;
    text.reserve(bytes.size() / 2);
    for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
        const auto low = static_cast<unsigned char>(bytes[i + !little]),
                   high = static_cast<unsigned char>(bytes[i + little]);
        text.push_back(high == 0 && low < 0x80 ? char(low) : '?');
    }
    return text;
}

}  // namespace

TextSource::TextSource(std::filesystem::path path, std::string_view bytes) : path_(std::move(path)), text_(bytes) {
    const Encoding encoding = encodingOf(bytes);
    if (encoding != Encoding::bytes) {
        if (bytes.starts_with("\xff\xfe") || bytes.starts_with("\xfe\xff")) bytes.remove_prefix(2);
        decoded_ = decoded(bytes, encoding == Encoding::utf16Little);
        text_ = decoded_;
    }
    if (text_.starts_with("\xef\xbb\xbf")) text_.remove_prefix(3);
}

std::size_t TextSource::lineOf(const char* at) const {
    std::size_t line = 1;
    for (const char* c = begin(); c < at; ++c) line += *c == '\n' || (*c == '\r' && (c + 1 == end() || c[1] != '\n'));
    return line;
}

std::string TextSource::quoted(const char* at) const {
    if (at == end()) return "the end of the file";
    if (isLineEnd(*at)) return "the end of the line";
    return quotedWord(Cursor{at, end()}.word());
}

void TextSource::checkCoordinate(const char* at, double value) const {
    if (std::isfinite(float(value))) return;
    fail(at, fmt::format("the coordinate {} is {}", quoted(at),
                         std::isfinite(value) ? "too large for a float" : "not finite"));
}

void TextSource::fail(const char* at, const std::string& why) const {
    throw std::runtime_error(fmt::format("{}: line {}: {}", path_.string(), lineOf(at), why));
}

void TextSource::failExpected(const char* at, const std::string& what) const {
    fail(at, fmt::format("{} stands where {} should", quoted(at), what));
}

bool Cursor::number(double& value) {
    const char* from = at + (at != end && *at == '+');
    const auto [next, error] = fast_float::from_chars(from, end, value);
    // a value that is too large becomes infinite, one that is too small zero; infinity is then reported as not finite
    if (error == std::errc::invalid_argument || (from != at && from != end && *from == '-')) return false;
    at = next;
    return true;
}

bool Cursor::integer(long long& value) {
    const char* from = at + (at != end && *at == '+');
    const auto [next, error] = std::from_chars(from, end, value);
    if (error != std::errc() || (from != at && from != end && *from == '-')) return false;
    at = next;
    return true;
}

std::string counted(std::size_t count, std::string_view one, std::string_view many) {
    return fmt::format("{} {}", count, count == 1 ? one : many);
}

bool sameWord(std::string_view a, std::string_view b) {
    const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; };
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [&](char x, char y) { return lower(x) == lower(y); });
}

}  // namespace bilayer::detail
