// SPDX-License-Identifier: Apache-2.0
// Tested by tests/sdf/raw_reader.cpp through readMesh().
#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

#include "sdf/io/formats/mesh_readers.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/polygon/polygons.h"
#include "sdf/io/text_source.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t triangleNumbers = 9;   // per line
constexpr std::size_t colouredNumbers = 12;  // per line: three of a colour come first

/// Reads lines of a triangle each. Other lines are names of objects, or comments.
class RawReader {
  public:
    explicit RawReader(const TextSource& source) : source_(source), at_{source.begin(), source.end()} {}

    Polygons run() {
        for (at_.skipSpace(); !at_.atEnd(); at_.skipSpace()) {
            readLine();
            at_.skipLine();
        }
        if (coloured_ > 0)
            polygons_.notes.push_back(
                fmt::format("{} 12 numbers, of which the first three are taken for a colour; the first is line {}",
                            counted(coloured_, "line has", "lines have"), source_.lineOf(firstColoured_)));
        return std::move(polygons_);
    }

  private:
    void readLine() {
        const char* begin = at_.at;
        if (*begin == '#') return;
        double values[colouredNumbers];
        const char* words[colouredNumbers];
        std::size_t count = 0;
        for (; !atLineEnd(); at_.skipBlanks(), ++count) {
            const char* word = at_.at;
            double value = 0;
            if (!at_.number(value) || !(at_.atEnd() || isSpace(*at_.at))) {
                at_.at = word;
                break;
            }
            if (count < colouredNumbers) values[count] = value, words[count] = word;
        }
        if (count == 0) return readName();
        if (count != triangleNumbers && count != colouredNumbers) {
            if (!atLineEnd()) source_.failExpected(at_.at, "a coordinate");
            source_.fail(
                begin, fmt::format("{}, but a triangle has {}", counted(count, "number", "numbers"), triangleNumbers));
        }
        // the name of a texture may follow
        if (count == colouredNumbers && coloured_++ == 0) firstColoured_ = begin;
        add(values + count - triangleNumbers, words + count - triangleNumbers);
    }

    bool atLineEnd() const { return at_.atEnd() || isLineEnd(*at_.at); }

    /// The name of an object has no numbers: these would be a triangle with a damaged first coordinate.
    void readName() {
        const char* begin = at_.at;
        for (; !atLineEnd(); at_.skipBlanks()) {
            double value = 0;
            if (Cursor word = at_; word.number(value) && (word.atEnd() || isSpace(*word.at)))
                source_.failExpected(begin, "a coordinate");
            at_.word();
        }
    }

    void add(const double* values, const char* const* words) {
        for (std::size_t i = 0; i < triangleNumbers; i += 3) {
            for (std::size_t k = i; k < i + 3; ++k) source_.checkCoordinate(words[k], values[k]);
            polygons_.corners.push_back(unsigned(polygons_.points.size()));
            polygons_.points.push_back({values[i], values[i + 1], values[i + 2]});
        }
    }

    const TextSource& source_;
    Cursor at_;
    Polygons polygons_;
    std::size_t coloured_ = 0;
    const char* firstColoured_ = nullptr;
};

}  // namespace

Mesh readRaw(const std::filesystem::path& path, ReadReport& report) {
    MappedFile file(path);
    const TextSource source(path, file.bytes());
    return assembled(file, RawReader(source).run(), path, report);
}

}  // namespace bilayer::detail
