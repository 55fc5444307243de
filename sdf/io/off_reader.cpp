// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "sdf/io/mapped_file.h"
#include "sdf/io/mesh_readers.h"
#include "sdf/io/polygons.h"
#include "sdf/io/text_records.h"
#include "sdf/io/text_source.h"

namespace bilayer::detail {
namespace {

/// The layout of a text. In `words`, items may be spread over lines, and a line may hold several of them. In `lines`,
/// each vertex or face ends with its line; normals, colours and other data may follow its numbers there.
enum class Layout { words, lines };

/// The words and numbers of a text without its comments, which begin with '#'.
class OffWords {
  public:
    OffWords(const TextSource& source, Cursor& at) : source_(source), at_(at) {}

    const char* next() {
        for (at_.skipSpace(); !at_.atEnd() && *at_.at == '#'; at_.skipSpace()) at_.skipLine();
        return at_.at;
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

    void skipLine() { at_.skipLine(); }

  private:
    bool isAtWordEnd() const { return at_.atEnd() || isSpace(*at_.at) || *at_.at == '#'; }

    const TextSource& source_;
    Cursor& at_;
};

struct OffHeader {
    std::size_t vertices = 0, faces = 0;
    bool hasMore = false;  ///< more than three numbers per vertex: normals, colours or texture coordinates
    Cursor data;
};

OffHeader readHeader(const TextSource& source) {
    OffHeader header{0, 0, false, {source.begin(), source.end()}};
    OffWords words(source, header.data);
    const char* begin = words.next();
    while (!header.data.atEnd() && std::string_view("STCN4n").find(*header.data.at) != std::string_view::npos)
        ++header.data.at;
    const std::string_view kind(begin, std::size_t(header.data.at - begin));
    if (!std::string_view(header.data.at, std::size_t(header.data.end - header.data.at)).starts_with("OFF"))
        source.failExpected(begin, "'OFF'");
    header.data.at += 3;
    if (kind.find_first_of("4n") != std::string_view::npos)
        source.fail(begin, "it is not in three dimensions: write it as OFF");
    header.hasMore = !kind.empty();
    const char* counts = words.next();
    if (std::string_view(counts, std::size_t(source.end() - counts)).starts_with("BINARY"))
        source.fail(counts, "binary OFF is not read: write it as text, or as binary PLY");
    header.vertices = words.count("the number of vertices");
    header.faces = words.count("the number of faces");
    // the count of edges has no effect, and may be missing
    if (words.isLineGoingOn()) words.count("the number of edges");
    return header;
}

/// Checks the counts before memory is allocated: a vertex has three numbers, a face at least its count.
void requireRoom(const TextSource& source, const OffHeader& header) {
    const auto size = std::size_t(header.data.end - header.data.at);
    if (header.vertices > size / 5 || header.faces > size / 2)
        source.fail(header.data.at, fmt::format("{} vertices and {} faces are announced, but the file ends before them",
                                                header.vertices, header.faces));
}

Polygons read(const TextSource& source, const OffHeader& header, Layout vertices, Layout faces) {
    Polygons polygons;
    polygons.points.resize(header.vertices);
    Cursor at = header.data;
    readRecords(at, header.vertices, [&](Cursor& text, std::size_t first, std::size_t count) {
        OffWords words(source, text);
        for (std::size_t i = first; i < first + count; ++i) {
            for (int axis = 0; axis < 3; ++axis) polygons.points[i][axis] = words.coordinate();
            if (vertices == Layout::lines) words.skipLine();
        }
        return 0;
    });
    setFaces(polygons, readRecords(at, header.faces, [&](Cursor& text, std::size_t, std::size_t count) {
                 OffWords words(source, text);
                 Faces read;
                 for (; count > 0; --count) {
                     const std::size_t first = read.corners.size();
                     for (std::size_t size = words.count("the number of a face's corners"); size > 0; --size)
                         read.corners.push_back(words.corner(header.vertices));
                     read.close(first);
                     if (faces == Layout::lines) words.skipLine();
                 }
                 return read;
             }));
    const char* rest = OffWords(source, at).next();
    if (rest == source.end()) return polygons;
    // vertices with colours, read as words, leave a rest
    if (vertices == Layout::words) source.failExpected(rest, "the end of the file");
    polygons.notes.push_back(
        fmt::format("left out: what follows the last of the {} that the file announces, from line {} on",
                    counted(header.faces, "face", "faces"), source.lineOf(rest)));
    return polygons;
}

/// Returns the first layout that fits. Plain OFF has three numbers per vertex, but some programs add colours.
Polygons readAnyLayout(const TextSource& source, const OffHeader& header) {
    constexpr std::pair<Layout, Layout> plain[]{{Layout::words, Layout::lines}, {Layout::words, Layout::words}};
    for (const auto& [vertices, faces] : plain) {
        if (header.hasMore) break;
        try {
            return read(source, header, vertices, faces);
        } catch (const std::runtime_error&) {
            // the last layout reports the error
        }
    }
    return read(source, header, Layout::lines, Layout::lines);
}

}  // namespace

Mesh readOff(const std::filesystem::path& path, ReadReport& report) {
    const MappedFile file(path);
    const TextSource source(path, file.bytes());
    const OffHeader header = readHeader(source);
    requireRoom(source, header);
    return assembled(readAnyLayout(source, header), path, report);
}

}  // namespace bilayer::detail
