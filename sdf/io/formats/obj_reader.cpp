// SPDX-License-Identifier: Apache-2.0
// Tested by tests/sdf/obj_reader.cpp through readMesh().
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "sdf/base/parallel_parts.h"
#include "sdf/io/formats/mesh_readers.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/polygon/polygons.h"
#include "sdf/io/text_source.h"

namespace bilayer::detail {
namespace {

/// What is omitted from a file.
enum Omission { pointsAndLines, freeForm, unknown, omissions };
struct OmissionName {
    const char *one, *many;
};
constexpr std::array<OmissionName, omissions> omissionNames{
    {{"element that is points or lines", "elements that are points or lines"},
     {"statement of a free-form curve or surface", "statements of free-form curves or surfaces"},
     {"line that begins with a word that is not known", "lines that begin with a word that is not known"}}};

struct Skipped {
    std::size_t count = 0;
    const char* first = nullptr;
};

struct ObjPart : TextPart {
    std::vector<std::size_t> relativeCorners{};  // counted from the first vertex of this part, not of the file
    std::array<Skipped, omissions> skipped{};
};

constexpr std::string_view withoutShape[] = {"vn",     "vt",       "vp",       "g",          "o",        "s",
                                             "mtllib", "usemtl",   "usemap",   "maplib",     "mg",       "lod",
                                             "bevel",  "c_interp", "d_interp", "shadow_obj", "trace_obj"};
constexpr std::string_view ofFreeForm[] = {"curv",  "curv2", "surf", "cstype", "deg", "bmat", "step",
                                           "parm",  "trim",  "hole", "scrv",   "sp",  "end",  "con",
                                           "ctech", "stech", "bsp",  "bzp",    "cdc", "cdp",  "res"};

bool isOneOf(std::string_view word, std::span<const std::string_view> words) {
    return std::find(words.begin(), words.end(), word) != words.end();
}

/// Reads the lines of a part.
class PartReader {
  public:
    /// Count of vertices of the file, and of those before a part.
    struct Vertices {
        std::size_t all, before;
    };
    /// @param vertices  if known, corners that refer to other vertices are an error
    PartReader(const TextSource& source, ObjPart& part, std::optional<Vertices> vertices = std::nullopt)
        : source_(source), part_(part), at_(part.text), vertices_(vertices) {}

    void run() {
        while (!at_.atEnd()) {
            if (isLineEnd(*at_.at)) {
                ++at_.at;
                continue;
            }
            readLine();
            at_.skipLine();
        }
    }

  private:
    void readLine() {
        while (at_.end - at_.at >= 3 && std::memcmp(at_.at, "\xef\xbb\xbf", 3) == 0) at_.at += 3;
        at_.skipBlanks();
        const char* begin = at_.at;
        while (!atWordEnd()) ++at_.at;
        const std::string_view word(begin, std::size_t(at_.at - begin));
        if (word == "v") return readVertex();
        if (word == "f" || word == "fo") return readFace();
        if (word.empty() || word.front() == '#' || isOneOf(word, withoutShape)) return;
        const bool isElement = word == "l" || word == "p";
        skip(isElement ? pointsAndLines : isOneOf(word, ofFreeForm) ? freeForm : unknown, begin);
    }

    // Returns whether a backslash at the end of a line joins the next line to it. Blanks may follow it.
    bool atContinuation() const {
        if (at_.atEnd() || *at_.at != '\\') return false;
        Cursor rest{at_.at + 1, at_.end};
        rest.skipBlanks();
        return !rest.atEnd() && isLineEnd(*rest.at);
    }

    void skipBlanks() {
        for (at_.skipBlanks(); atContinuation(); at_.skipBlanks()) {
            at_.skipLine();
            const bool both = at_.end - at_.at >= 2 && at_.at[0] == '\r' && at_.at[1] == '\n';
            at_.at += both ? 2 : 1;
        }
    }

    /// Advances to the end of a statement.
    void skipRest() {
        for (skipBlanks(); !at_.atEnd() && !isLineEnd(*at_.at); skipBlanks())
            while (!atWordEnd()) ++at_.at;
    }

    bool atWordEnd() const { return at_.atEnd() || isSpace(*at_.at) || atContinuation(); }
    bool atLineEnd() const { return at_.atEnd() || isLineEnd(*at_.at) || *at_.at == '#'; }

    void readVertex() {
        glm::dvec3 point;
        for (int axis = 0; axis < 3; ++axis) {
            skipBlanks();
            const char* begin = at_.at;
            if (!at_.number(point[axis]) || !atWordEnd()) source_.failExpected(begin, "a coordinate");
            source_.checkCoordinate(begin, point[axis]);
        }
        part_.points.push_back(point);
        skipRest();
    }

    void readFace() {
        const std::size_t first = part_.faces.corners.size();
        for (skipBlanks(); !atLineEnd(); skipBlanks()) readCorner();
        part_.faces.close(first);
        std::vector<std::size_t>& relative = part_.relativeCorners;
        while (!relative.empty() && relative.back() >= part_.faces.corners.size()) relative.pop_back();
    }

    // Reads the vertex index of a corner; texture and normal indices follow after slashes.
    void readCorner() {
        const char* begin = at_.at;
        long long index = 0;
        if (!at_.integer(index) || !(atWordEnd() || *at_.at == '/'))
            source_.failExpected(begin, "the number of a vertex");
        while (!atWordEnd()) ++at_.at;
        const auto points = static_cast<long long>(part_.points.size());
        if (index == 0) source_.fail(begin, "a face refers to vertex 0, but the first one has the number 1");
        if (index < 0) part_.relativeCorners.push_back(part_.faces.corners.size());
        // a vertex before the first of the part wraps around until the offset of the part is added
        part_.faces.corners.push_back(unsigned(index < 0 ? points + index : index - 1));
        constexpr long long max = std::numeric_limits<int>::max();
        const bool isOff = index > max || index < -max;
        const auto all = static_cast<long long>(vertices_ ? vertices_->all : 0);
        const auto before = static_cast<long long>(vertices_ ? vertices_->before : 0);
        if (isOff || (vertices_ && (index > all || before + points + index < 0)))
            source_.fail(begin, fmt::format("a face refers to vertex {}, but {}", index,
                                            isOff       ? "there are never so many"
                                            : index > 0 ? fmt::format("the file has {} vertices", all)
                                                        : fmt::format("only {} come before it", before + points)));
    }

    void skip(Omission kind, const char* begin) {
        Skipped& skipped = part_.skipped[kind];
        if (skipped.count++ == 0) skipped.first = begin;
        skipRest();
    }

    const TextSource& source_;
    ObjPart& part_;
    Cursor at_;
    std::optional<Vertices> vertices_;
};

/// Returns whether a text ends with a backslash and blanks.
bool endsWithContinuation(const char* begin, const char* end) {
    while (end != begin && isBlank(end[-1])) --end;
    return end != begin && end[-1] == '\\';
}

/// Cuts a text into parts that begin at the start of a line that is not joined to the previous one.
std::vector<ObjPart> cut(const TextSource& source) {
    std::vector<ObjPart> parts;
    for (const char* begin = source.begin(); begin != source.end();) {
        const char* end = begin + std::min<std::size_t>(textPartBytes, std::size_t(source.end() - begin));
        while (end != source.end() && !(isLineEnd(end[-1]) && !isLineEnd(*end))) ++end;
        const char* last = end;
        while (last != begin && isLineEnd(last[-1])) --last;
        // joined lines stay in the same part
        while (end != source.end() && endsWithContinuation(begin, last)) {
            while (end != source.end() && !isLineEnd(*end)) ++end;
            last = end;
            while (end != source.end() && isLineEnd(*end)) ++end;
        }
        parts.push_back({{{begin, end}}});
        begin = end;
    }
    return parts;
}

std::vector<std::string> notes(const TextSource& source, const std::vector<ObjPart>& parts) {
    std::vector<std::string> notes;
    for (int kind = 0; kind < omissions; ++kind) {
        Skipped all;
        for (const ObjPart& part : parts) {
            const Skipped& skipped = part.skipped[kind];
            if (all.count == 0) all.first = skipped.first;
            all.count += skipped.count;
        }
        if (all.count > 0)
            notes.push_back(fmt::format("left out: {}; the first is {} on line {}",
                                        counted(all.count, omissionNames[kind].one, omissionNames[kind].many),
                                        source.quoted(all.first), source.lineOf(all.first)));
    }
    return notes;
}

/// Joins all parts.
Polygons joined(const TextSource& source, std::vector<ObjPart>& parts) {
    Polygons all;
    const std::vector<std::size_t> begins = takePoints(all, parts);
    const std::size_t vertices = all.points.size();
    inParallel(parts.size(), [&](std::size_t i) {
        ObjPart& part = parts[i];
        std::vector<unsigned>& corners = part.faces.corners;
        for (const std::size_t corner : part.relativeCorners) corners[corner] += unsigned(begins[i]);
        if (!std::all_of(corners.begin(), corners.end(), [&](unsigned corner) { return corner < vertices; })) {
            ObjPart again{{part.text}};
            PartReader(source, again, PartReader::Vertices{vertices, begins[i]}).run();
        }
    });
    takeFaces(all, parts);
    for (std::string& note : notes(source, parts)) all.notes.push_back(std::move(note));
    return all;
}

}  // namespace

Mesh readObj(const std::filesystem::path& path, ReadReport& report) {
    MappedFile file(path);
    const TextSource source(path, file.bytes());
    std::vector<ObjPart> parts = cut(source);
    inParallel(parts.size(), [&](std::size_t i) { PartReader(source, parts[i]).run(); });
    file.release();
    return assembled(file, joined(source, parts), path, report);
}

}  // namespace bilayer::detail
