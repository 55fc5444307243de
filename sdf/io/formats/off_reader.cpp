// SPDX-License-Identifier: Apache-2.0
// Tested by tests/sdf/off_reader.cpp through readMesh().
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "sdf/io/formats/mesh_readers.h"
#include "sdf/io/formats/text_records.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/polygon/polygons.h"
#include "sdf/io/text_source.h"

namespace bilayer::detail {
namespace {

/// How the vertices and faces of a text are written.
struct OffLayout {
    /// Count of numbers after the coordinates of a vertex; absent: all up to its line's end.
    std::optional<int> behindVertex;
    /// Colours and other data may follow the corners of a face, up to its line's end.
    bool facesAreLines;
    /// Of a face. Where the layout is guessed, other data must not be taken for faces.
    int minCorners = 0;
};

/// The words and numbers of a text without its comments, which begin with '#'.
class OffWords {
  public:
    OffWords(const TextSource& source, Cursor& at) : source_(source), at_(at) {}

    /// Sets what is being read, for the error at the end of the file.
    void begin(const char* items, std::size_t number, std::size_t count) { item_ = {items, number, count}; }

    const char* next() {
        for (at_.skipSpace(); !at_.atEnd() && *at_.at == '#'; at_.skipSpace()) at_.skipLine();
        if (at_.atEnd() && item_.items)
            source_.fail(at_.at, fmt::format("the file ends after {} of the {} {} that it announces", item_.number,
                                             item_.count, item_.items));
        return at_.at;
    }

    void skipWords(int count) {
        for (; count > 0; --count) {
            next();
            while (!isAtWordEnd()) ++at_.at;
        }
    }

    double coordinate() {
        double value = 0;
        const char* begin = next();
        if (!at_.number(value) || !isAtWordEnd()) source_.failExpected(begin, "a coordinate");
        source_.checkCoordinate(begin, value);
        return value;
    }

    std::size_t count(const char* what) {
        long long value = 0;
        const char* begin = next();
        if (!at_.integer(value) || !isAtWordEnd() || value < 0) source_.failExpected(begin, what);
        return std::size_t(value);
    }

    unsigned corner(std::size_t vertices) {
        const char* begin = next();
        const std::size_t corner = count("the number of a vertex");
        if (corner >= vertices)
            source_.fail(begin,
                         fmt::format("a face refers to vertex {}, but there are {}, counted from 0", corner, vertices));
        return unsigned(corner);
    }

    /// Returns whether the line has another word.
    bool isLineGoingOn() {
        at_.skipBlanks();
        return !at_.atEnd() && !isLineEnd(*at_.at) && *at_.at != '#';
    }

    bool isWordGoingOn() const { return !isAtWordEnd(); }

    void skipLine() { at_.skipLine(); }

  private:
    bool isAtWordEnd() const { return at_.atEnd() || isSpace(*at_.at) || *at_.at == '#'; }

    struct Item {
        const char* items;
        std::size_t number, count;
    };

    const TextSource& source_;
    Cursor& at_;
    Item item_{};
};

struct OffHeader {
    std::size_t vertices = 0, faces = 0;
    std::string kind;          ///< the prefix of OFF: what a vertex has in addition to its coordinates
    std::vector<Cursor> data;  ///< where the data may begin: the count of edges may be missing
};

/// Returns the positions behind the counts of vertices and faces, the likely one first.
std::vector<Cursor> dataOf(const TextSource& source, Cursor text) {
    const bool hasEdges = OffWords(source, text).isLineGoingOn();
    Cursor behindEdges = text;
    OffWords words(source, behindEdges);
    const char* begin = words.next();
    long long edges = 0;
    const bool isCount = behindEdges.integer(edges) && !words.isWordGoingOn();
    if (hasEdges) {
        if (!isCount) source.failExpected(begin, "the number of edges");
        return {behindEdges};
    }
    if (!isCount) return {text};
    // a count of edges stands alone on its line
    return words.isLineGoingOn() ? std::vector{text} : std::vector{behindEdges, text};
}

OffHeader readHeader(const TextSource& source) {
    OffHeader header;
    Cursor text{source.begin(), source.end()};
    OffWords words(source, text);
    const char* begin = words.next();
    while (!text.atEnd() && std::string_view("STCN4n").find(*text.at) != std::string_view::npos) ++text.at;
    header.kind.assign(begin, text.at);
    if (!std::string_view(text.at, std::size_t(text.end - text.at)).starts_with("OFF"))
        source.failExpected(begin, "'OFF'");
    text.at += 3;
    if (header.kind.find_first_of("4n") != std::string::npos)
        source.fail(begin, "it is not in three dimensions: write it as OFF");
    const char* counts = words.next();
    if (std::string_view(counts, std::size_t(source.end() - counts)).starts_with("BINARY"))
        source.fail(counts, "binary OFF is not read: write it as text, or as binary PLY");
    header.vertices = words.count("the number of vertices");
    header.faces = words.count("the number of faces");
    header.data = dataOf(source, text);
    return header;
}

glm::dvec3 readPoint(OffWords& words) {
    glm::dvec3 point;
    for (int axis = 0; axis < 3; ++axis) point[axis] = words.coordinate();
    return point;
}

/// Checks the counts before memory is allocated: a vertex has three numbers, a face at least its count. Throws where
/// the file ends.
void requireRoom(const TextSource& source, const OffHeader& header) {
    Cursor text = header.data.front();
    const auto size = std::size_t(text.end - text.at) + 1;
    if (header.vertices <= size / 6 && header.faces <= size / 2) return;
    OffWords words(source, text);
    for (std::size_t i = 0; i < header.vertices; ++i) {
        words.begin("vertices", i, header.vertices);
        readPoint(words);
        words.skipLine();
    }
    for (std::size_t i = 0; i < header.faces; ++i) {
        words.begin("faces", i, header.faces);
        words.next();
        words.skipLine();
    }
}

std::vector<Faces> readFaces(const TextSource& source, const OffHeader& header, const OffLayout& layout, Cursor& at) {
    return readRecords(at, header.faces, [&](Cursor& text, std::size_t first, std::size_t count) {
        OffWords words(source, text);
        Faces read;
        for (std::size_t i = first; i < first + count; ++i) {
            words.begin("faces", i, header.faces);
            const std::size_t corners = read.corners.size();
            for (std::size_t size = words.count("the number of a face's corners"); size > 0; --size)
                read.corners.push_back(words.corner(header.vertices));
            if (read.corners.size() < corners + std::size_t(layout.minCorners))
                source.fail(text.at, fmt::format("a face has fewer than {} corners", layout.minCorners));
            read.close(corners);
            if (layout.facesAreLines) words.skipLine();
        }
        return read;
    });
}

Polygons read(const TextSource& source, const OffHeader& header, const OffLayout& layout, Cursor at) {
    Polygons polygons;
    polygons.points.resize(header.vertices);
    readRecords(at, header.vertices, [&](Cursor& text, std::size_t first, std::size_t count) {
        OffWords words(source, text);
        for (std::size_t i = first; i < first + count; ++i) {
            words.begin("vertices", i, header.vertices);
            polygons.points[i] = readPoint(words);
            if (layout.behindVertex)
                words.skipWords(*layout.behindVertex);
            else
                words.skipLine();
        }
        return 0;
    });
    setFaces(polygons, readFaces(source, header, layout, at));
    const char* rest = OffWords(source, at).next();
    if (rest == source.end()) return polygons;
    // vertices with more numbers than expected leave a rest
    if (layout.behindVertex) source.failExpected(rest, "the end of the file");
    polygons.notes.push_back(
        fmt::format("left out: what follows the last of the {} that the file announces, from line {} on",
                    counted(header.faces, "face", "faces"), source.lineOf(rest)));
    return polygons;
}

/// Returns the count of words in the first line of data.
int wordsOfFirstLine(const TextSource& source, Cursor data) {
    OffWords words(source, data);
    int count = 0;
    for (words.next(); words.isLineGoingOn(); ++count) words.skipWords(1);
    return count;
}

/// Returns the layouts that a kind of file may have, the likely ones first. Plain OFF has three numbers per vertex, but
/// some programs add colours. Colours of vertices have four numbers, but some programs write three.
std::vector<OffLayout> layoutsOf(const TextSource& source, const OffHeader& header, const Cursor& data) {
    const auto has = [&](const char* letter) { return header.kind.find(letter) != std::string::npos; };
    const int others = (has("N") ? 3 : 0) + (has("ST") ? 2 : 0);
    std::vector<int> counts{others};
    if (has("C")) counts = {others + 4, others + 3};
    const int inFirstLine = wordsOfFirstLine(source, data) - 3;
    // a line may also end within a vertex, so that the other count is possible too
    const auto usual = std::find(counts.begin(), counts.end(), inFirstLine);
    if (usual != counts.end()) std::rotate(counts.begin(), usual, usual + 1);
    std::vector<OffLayout> layouts;
    for (const int count : counts) {
        layouts.push_back({count, true, count == inFirstLine ? 0 : 3});
        layouts.push_back({count, false, 2});
    }
    layouts.push_back({std::nullopt, true});
    return layouts;
}

/// Reads the first layout that fits. If there is none, the last one with the likely start of data reports the error.
Polygons readAnyLayout(const TextSource& source, const OffHeader& header) {
    for (const Cursor& data : header.data)
        for (const OffLayout& layout : layoutsOf(source, header, data)) try {
                return read(source, header, layout, data);
            } catch (const std::runtime_error&) {
                // the next one may fit
            }
    return read(source, header, {std::nullopt, true}, header.data.front());
}

}  // namespace

Mesh readOff(const std::filesystem::path& path, ReadReport& report) {
    MappedFile file(path);
    const TextSource source(path, file.bytes());
    const OffHeader header = readHeader(source);
    requireRoom(source, header);
    return assembled(file, readAnyLayout(source, header), path, report);
}

}  // namespace bilayer::detail
