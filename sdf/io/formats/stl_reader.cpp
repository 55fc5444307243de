// SPDX-License-Identifier: Apache-2.0
// Tested by tests/sdf/stl_reader.cpp through readMesh().
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sdf/base/large_array.h"
#include "sdf/base/parallel_parts.h"
#include "sdf/io/formats/mesh_readers.h"
#include "sdf/io/formats/stl_records.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/polygon/polygons.h"
#include "sdf/io/text_source.h"

namespace bilayer::detail {
namespace {

/// Decides between text and binary. A file is binary if its size matches its count of facets, or if its bytes are not
/// text. Headers do not help: some binary files begin with "solid".
bool isText(std::string_view bytes, std::string_view text) {
    if (bytes.size() >= stlBinarySize(0) && bytes.size() == stlBinarySize(stlFacetCount(bytes))) return false;
    constexpr std::size_t sample = 1024;
    const std::string_view begin = text.substr(0, sample);
    const auto isOfText = [](char c) { return c != '\0' && (static_cast<unsigned char>(c) >= ' ' || isSpace(c)); };
    return !text.empty() && std::all_of(begin.begin(), begin.end(), isOfText);
}

void requireFinite(const glm::vec3* corners, std::size_t triangle, const std::filesystem::path& path) {
    for (int k = 0; k < 3; ++k)
        for (int axis = 0; axis < 3; ++axis)
            if (!std::isfinite(corners[k][axis]))
                throw std::runtime_error(
                    fmt::format("{}: triangle {}, counted from 0, has the coordinate {}, which is not finite",
                                path.string(), triangle, corners[k][axis]));
}

PolygonsOf<float> readBinary(std::string_view bytes, const std::filesystem::path& path) {
    static_assert(std::endian::native == std::endian::little, "STL files are little-endian");
    const std::uint32_t count = stlFacetCount(bytes);
    if (bytes.size() < stlBinarySize(0))
        throw std::runtime_error(
            fmt::format("{}: has {}; a binary STL file has {} bytes at least, and a text one begins with 'solid'",
                        path.string(), counted(bytes.size(), "byte", "bytes"), stlBinarySize(0)));
    if (bytes.size() < stlBinarySize(count))
        throw std::runtime_error(
            fmt::format("{}: ends early, after {} bytes: of the {} triangles that it announces there are {}",
                        path.string(), bytes.size(), count, (bytes.size() - stlBinarySize(0)) / stlFacetBytes));
    PolygonsOf<float> polygons;
    if (const std::uint64_t more = bytes.size() - stlBinarySize(count))
        polygons.notes.push_back(fmt::format("left out: {} after the last triangle", counted(more, "byte", "bytes")));
    resizeLarge(polygons.points, std::size_t(3) * count);
    resizeLarge(polygons.triangles, count);
    constexpr std::size_t partFacets = 1 << 14;
    inParallel((count + partFacets - 1) / partFacets, [&](std::size_t part) {
        const char* facets = bytes.data() + stlBinarySize(0) + stlNormalBytes;
        for (std::size_t i = part * partFacets; i < std::min<std::size_t>((part + 1) * partFacets, count); ++i) {
            glm::vec3* corners = &polygons.points[3 * i];
            polygons.triangles[i] = unsigned(3 * i) + glm::uvec3(0, 1, 2);
            std::memcpy(corners, facets + stlFacetBytes * i, 3 * sizeof(glm::vec3));
            const glm::vec3 sum = corners[0] + corners[1] + corners[2];
            // infinite if the sum of finite numbers overflows: rare, and then checked one by one
            if (!std::isfinite(sum.x + sum.y + sum.z)) requireFinite(corners, i, path);
        }
    });
    return polygons;
}

/// A part of a text file. Its points are the corners of its faces, in order.
struct StlPart : TextPart {
    bool endsSolid = false;     // the last keyword was `endsolid`
    std::size_t linesLeft = 0;  // after an `endsolid`, of other content
    const char* firstLeft = nullptr;
};

/// Reads facets. Keywords are case-insensitive; a name extends to the end of its line, whatever it contains.
class TextReader {
  public:
    TextReader(const TextSource& source, StlPart& part) : source_(source), part_(part), at_(part.text) {}

    void run() {
        for (at_.skipSpace(); !at_.atEnd(); at_.skipSpace()) {
            const char* begin = at_.at;
            const std::string_view word = at_.word();
            const bool ends = sameWord(word, "endsolid");
            if (sameWord(word, "facet")) {
                readFacet(begin);
            } else if (ends || sameWord(word, "solid") || word.front() == '#') {
                at_.skipLine();
            } else if (part_.endsSolid) {
                at_.skipLine();
                if (part_.linesLeft++ == 0) part_.firstLeft = begin;
                continue;
            } else {
                source_.failExpected(begin, "'facet', 'solid' or 'endsolid'");
            }
            if (word.front() != '#') part_.endsSolid = ends;
        }
    }

  private:
    // The normal is ignored: an invalid normal does not invalidate the triangle.
    void readFacet(const char* begin) {
        const std::size_t first = part_.points.size();
        for (;;) {
            at_.skipSpace();
            const char* here = at_.at;
            const std::string_view word = at_.word();
            if (word.empty()) source_.fail(begin, "the file ends within this facet");
            if (sameWord(word, "vertex")) readVertex();
            if (sameWord(word, "endfacet")) break;
            if (sameWord(word, "facet") || sameWord(word, "endsolid")) source_.failExpected(here, "'endfacet'");
        }
        for (std::size_t i = first; i < part_.points.size(); ++i) part_.faces.corners.push_back(unsigned(i));
        if (part_.points.size() - first < 3)
            source_.fail(begin,
                         fmt::format("a facet has {} vertices; it must have three", part_.points.size() - first));
        part_.faces.close(first);
    }

    void readVertex() {
        glm::dvec3 point;
        for (int axis = 0; axis < 3; ++axis) {
            at_.skipSpace();
            const char* begin = at_.at;
            if (!at_.number(point[axis]) || !(at_.atEnd() || isSpace(*at_.at)))
                source_.failExpected(begin, "a coordinate");
            source_.checkCoordinate(begin, point[axis]);
        }
        part_.points.push_back(point);
    }

    const TextSource& source_;
    StlPart& part_;
    Cursor at_;
};

/// Returns the next line from a position on that begins with `facet`, or the end. Names and vertices cannot be on such
/// a line.
const char* nextFacet(const char* at, const char* end) {
    Cursor cursor{at, end};
    for (cursor.skipLine(); !cursor.atEnd(); cursor.skipLine()) {
        cursor.skipSpace();
        Cursor word = cursor;
        if (sameWord(word.word(), "facet")) return cursor.at;
    }
    return end;
}

Polygons readText(const TextSource& source) {
    std::vector<StlPart> parts;
    for (const char* begin = source.begin(); begin != source.end();) {
        const std::size_t size = std::min(textPartBytes, std::size_t(source.end() - begin));
        const char* end = nextFacet(begin + size, source.end());
        parts.push_back({{{begin, end}}});
        begin = end;
    }
    inParallel(parts.size(), [&](std::size_t i) { TextReader(source, parts[i]).run(); });
    if (!parts.back().endsSolid) source.fail(source.end(), "the file ends before its 'endsolid'");
    Polygons polygons;
    const std::vector<std::size_t> begins = takePoints(polygons, parts);
    inParallel(parts.size(), [&](std::size_t i) {
        for (unsigned& corner : parts[i].faces.corners) corner += unsigned(begins[i]);
    });
    for (const StlPart& part : parts)
        if (part.linesLeft > 0)
            polygons.notes.push_back(fmt::format("left out: {} after 'endsolid'; the first is {} on line {}",
                                                 counted(part.linesLeft, "line", "lines"),
                                                 source.quoted(part.firstLeft), source.lineOf(part.firstLeft)));
    takeFaces(polygons, parts);
    return polygons;
}

}  // namespace

Mesh readStl(const std::filesystem::path& path, ReadReport& report) {
    MappedFile file(path);
    const TextSource source(path, file.bytes());
    if (isText(file.bytes(), source.text())) return assembled(file, readText(source), path, report);
    return assembled(file, readBinary(file.bytes(), path), path, report);
}

}  // namespace bilayer::detail
