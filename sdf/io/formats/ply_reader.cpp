// SPDX-License-Identifier: Apache-2.0
// Tested by tests/sdf/ply_reader.cpp through readMesh().
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <iterator>
#include <span>
#include <stdexcept>
#include <utility>

#include "sdf/base/large_array.h"
#include "sdf/io/formats/mesh_readers.h"
#include "sdf/io/formats/ply_binary.h"
#include "sdf/io/formats/ply_elements.h"
#include "sdf/io/formats/ply_fixed_records.h"
#include "sdf/io/formats/ply_header.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/polygon/polygons.h"
#include "sdf/io/text_source.h"

namespace bilayer::detail {
namespace {

/// Reads the elements of a file in their order.
template <class Scalar>
class PlyReader {
  public:
    explicit PlyReader(const PlyHeader& header) : header_(header) {}

    /// Advances the text past what is read.
    PolygonsOf<Scalar> readText(const TextSource& source, Cursor& text, PlyTextLayout layout) {
        for (const PlyElement& element : header_.elements) {
            if (element.properties.empty()) continue;
            if (!mayHold(std::size_t(text.end - text.at), element, 2))
                requirePlyElements(header_, element, source, text, layout);
            makeRoom(element);
            add(element, readPlyElements(header_, element, source, text, layout, polygons_.points));
        }
        text.skipSpace();
        if (!text.atEnd())
            polygons_.notes.push_back(fmt::format(
                "left out: what follows all that the header announces, from line {} on", source.lineOf(text.at)));
        return finished();
    }

    PolygonsOf<Scalar> readBinary(PlyData data) {
        for (const PlyElement& element : header_.elements) {
            if (element.properties.empty()) continue;
            if (!mayHold(data.size(), element, 1)) requirePlyElements(header_, element, data);
            makeRoom(element);
            if (readFixedVertices(element, data, polygons_.points)) continue;
            if (holdsAllFaces(element) && readFixedTriangles(element, header_.vertices, data, polygons_.triangles))
                continue;
            add(element, readPlyElements(header_, element, data, std::span(polygons_.points)));
        }
        if (data.size() > 0)
            polygons_.notes.push_back(
                fmt::format("left out: {} after all that the header announces", counted(data.size(), "byte", "bytes")));
        return finished();
    }

  private:
    bool holdsAllFaces(const PlyElement& element) const {
        return element.kind() == PlyElementKind::face &&
               std::count_if(header_.elements.begin(), header_.elements.end(),
                             [](const PlyElement& e) { return e.hasFaces(); }) == 1;
    }

    /// Returns whether so many bytes may hold an element, before memory is allocated: each property takes some bytes.
    static bool mayHold(std::size_t bytes, const PlyElement& element, std::size_t bytesOfProperty) {
        return element.count <= (bytes + 1) / (element.properties.size() * bytesOfProperty);
    }

    void makeRoom(const PlyElement& element) {
        if (element.kind() == PlyElementKind::vertex) resizeLarge(polygons_.points, element.count);
    }

    void add(const PlyElement& element, std::vector<Faces> parts) {
        if (element.kind() == PlyElementKind::other && element.count > 0)
            polygons_.notes.push_back(fmt::format("left out: {} {}", counted(element.count, "element", "elements"),
                                                  quotedWord(element.name)));
        std::move(parts.begin(), parts.end(), std::back_inserter(faces_));
    }

    PolygonsOf<Scalar> finished() {
        if (polygons_.triangles.empty()) setFaces(polygons_, std::move(faces_));
        return std::move(polygons_);
    }

    const PlyHeader& header_;
    PolygonsOf<Scalar> polygons_;
    std::vector<Faces> faces_;
};

/// Reads records that are one per line. If they are not, reads them as a sequence of words, which must hold exactly
/// what the header announces.
Polygons readText(const PlyHeader& header, const TextSource& source) {
    Cursor text{header.end, source.end()};
    try {
        return PlyReader<double>(header).readText(source, text, PlyTextLayout::lines);
    } catch (const std::runtime_error&) {
        try {
            text = {header.end, source.end()};
            Polygons polygons = PlyReader<double>(header).readText(source, text, PlyTextLayout::words);
            if (text.atEnd()) return polygons;
        } catch (const std::runtime_error&) {
            // the error of the usual layout is reported
        }
        throw;
    }
}

}  // namespace

Mesh readPly(const std::filesystem::path& path, ReadReport& report) {
    MappedFile file(path);
    const TextSource source(path, file.bytes());
    const PlyHeader header = readPlyHeader(path, source);
    if (header.format == PlyFormat::text) return assembled(file, readText(header, source), path, report);
    const bool isBig = std::endian::native == std::endian::big;
    const PlyData data{header.end, source.end(), (header.format == PlyFormat::binaryBig) != isBig};
    if (header.storesFloats()) return assembled(file, PlyReader<float>(header).readBinary(data), path, report);
    return assembled(file, PlyReader<double>(header).readBinary(data), path, report);
}

}  // namespace bilayer::detail
