// Text files of meshes: their words and numbers, and errors that say where they stand; internal.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

namespace bilayer::detail {

/// The text of a file. UTF-16 is decoded, and a byte order mark at its beginning is left out.
class TextSource {
  public:
    /// @param bytes  of the file; must outlive this
    TextSource(std::filesystem::path path, std::string_view bytes);
    TextSource(const TextSource&) = delete;
    TextSource& operator=(const TextSource&) = delete;

    std::string_view text() const { return text_; }
    const char* begin() const { return text_.data(); }
    const char* end() const { return text_.data() + text_.size(); }

    /// The line that a place of the text lies on, counted from 1. Lines end with LF, CR LF, or CR.
    std::size_t lineOf(const char* at) const;

    /// The word that begins at a place, in quotation marks and cut after 40 characters, or what else stands there.
    std::string quoted(const char* at) const;

    /// Throws std::runtime_error if the coordinate that was read at a place is no number or too large for a float.
    void checkCoordinate(const char* at, double value) const;

    /// Throws std::runtime_error: file, line, and what is wrong.
    [[noreturn]] void fail(const char* at, const std::string& why) const;

    /// Throws std::runtime_error: at a place stands something else than what is named here ("a coordinate").
    [[noreturn]] void failExpected(const char* at, const std::string& what) const;

  private:
    std::filesystem::path path_;
    std::string decoded_;
    std::string_view text_;
};

inline bool isLineEnd(char c) {
    return c == '\n' || c == '\r';
}
/// Blanks within a line. Zero bytes count: some programs pad lines with them.
inline bool isBlank(char c) {
    return c == ' ' || c == '\t' || c == '\v' || c == '\f' || c == '\0';
}
inline bool isSpace(char c) {
    return isBlank(c) || isLineEnd(c);
}

/// A place in a text that moves on.
struct Cursor {
    const char* at;
    const char* end;

    bool atEnd() const { return at == end; }
    /// To the next character of the line that is no blank, or to its end.
    void skipBlanks() {
        while (at != end && isBlank(*at)) ++at;
    }
    /// To the next character of the text that is none.
    void skipSpace() {
        while (at != end && isSpace(*at)) ++at;
    }
    /// To the end of the line.
    void skipLine() {
        while (at != end && !isLineEnd(*at)) ++at;
    }
    /// The word here, up to the next space; moves behind it.
    std::string_view word() {
        const char* from = at;
        while (at != end && !isSpace(*at)) ++at;
        return {from, std::size_t(at - from)};
    }
    /// The number here, in decimal digits with or without a sign, a fraction and an exponent; also infinity and NaN.
    /// Moves behind it. False, and stays, where there is none.
    bool number(double& value);
    /// The same for an integer in decimal digits.
    bool integer(long long& value);
};

/// A word of a file in quotation marks, cut after 40 characters; what cannot be printed is a question mark.
std::string quotedWord(std::string_view word);

/// "1 face", "2 faces".
std::string counted(std::size_t count, std::string_view one, std::string_view many);

/// Whether two words are the same but for upper and lower case of ASCII letters.
bool sameWord(std::string_view a, std::string_view b);

}  // namespace bilayer::detail
