// SPDX-License-Identifier: Apache-2.0
// Text files of meshes: words, numbers, and errors with line numbers; internal.
// Tested by tests/sdf/mesh_readers.cpp.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "sdf/base/quoted_text.h"

namespace bilayer::detail {

/// Text that one task reads [bytes].
inline constexpr std::size_t textPartBytes = 1 << 17;

/// The text of a file. UTF-16 is decoded, and a leading byte order mark is skipped.
class TextSource {
  public:
    /// @param bytes  contents of the file; must outlive this object
    TextSource(std::filesystem::path path, std::string_view bytes);
    TextSource(const TextSource&) = delete;
    TextSource& operator=(const TextSource&) = delete;

    std::string_view text() const { return text_; }
    const char* begin() const { return text_.data(); }
    const char* end() const { return text_.data() + text_.size(); }

    /// Returns the line of a text position, counted from 1. Lines end with LF, CR LF, or CR.
    std::size_t lineOf(const char* at) const;

    /// Returns the word at a position, in quotation marks and truncated to 40 characters, or describes what else is
    /// there.
    std::string quoted(const char* at) const;

    /// Throws std::runtime_error if the coordinate read at a position is not a number or too large for a float.
    void checkCoordinate(const char* at, double value) const;

    /// Throws std::runtime_error with file, line, and the reason.
    [[noreturn]] void fail(const char* at, const std::string& why) const;

    /// Throws std::runtime_error: the text at a position is not what was expected ("a coordinate").
    [[noreturn]] void failExpected(const char* at, const std::string& what) const;

  private:
    std::filesystem::path path_;
    std::string decoded_;
    std::string_view text_;
};

inline bool isLineEnd(char c) {
    return c == '\n' || c == '\r';
}
/// Blanks within a line. Zero bytes count, since some programs pad lines with them.
inline bool isBlank(char c) {
    return c == ' ' || c == '\t' || c == '\v' || c == '\f' || c == '\0';
}
inline bool isSpace(char c) {
    return isBlank(c) || isLineEnd(c);
}

/// A position in a text that advances.
struct Cursor {
    const char* at;
    const char* end;

    bool atEnd() const { return at == end; }
    /// Advances to the next non-blank character of the line, or to its end.
    void skipBlanks() {
        while (at != end && isBlank(*at)) ++at;
    }
    /// Advances to the next character of the text that is not a space.
    void skipSpace() {
        while (at != end && isSpace(*at)) ++at;
    }
    /// Advances to the end of the line.
    void skipLine() {
        while (at != end && !isLineEnd(*at)) ++at;
    }
    /// Reads the word up to the next space, and advances past it.
    std::string_view word() {
        const char* from = at;
        while (at != end && !isSpace(*at)) ++at;
        return {from, std::size_t(at - from)};
    }
    /// Reads a decimal number with optional sign, fraction and exponent, or infinity or NaN, and advances past it.
    /// Returns false and does not advance if there is none.
    bool number(double& value);
    /// Reads a decimal integer in the same way.
    bool integer(long long& value);
};

/// "1 face", "2 faces".
std::string counted(std::size_t count, std::string_view one, std::string_view many);

/// Returns whether two words are equal, ignoring the case of ASCII letters.
bool sameWord(std::string_view a, std::string_view b);

}  // namespace bilayer::detail
