// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <iterator>
#include <span>
#include <utility>

#include "sdf/base/large_array.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/mesh_readers.h"
#include "sdf/io/ply_binary.h"
#include "sdf/io/ply_elements.h"
#include "sdf/io/ply_fixed_records.h"
#include "sdf/io/ply_header.h"
#include "sdf/io/polygons.h"
#include "sdf/io/text_source.h"

namespace bilayer::detail {
namespace {

/// Reads the elements of a file in their order.
template <class Scalar>
class PlyReader {
  public:
    explicit PlyReader(const PlyHeader& header) : header_(header) {}

    PolygonsOf<Scalar> readText(const TextSource& source, Cursor text) {
        for (const PlyElement& element : header_.elements) {
            if (element.properties.empty()) continue;
            makeRoom(element, std::size_t(text.end - text.at), 2);
            add(element, readPlyElements(header_, element, source, text, polygons_.points));
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
            makeRoom(element, data.size(), 1);
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

    /// Checks before allocation that the file is large enough: each property of an element takes some bytes.
    void makeRoom(const PlyElement& element, std::size_t bytes, std::size_t bytesOfProperty) {
        const std::size_t size = element.properties.size() * bytesOfProperty;
        if (size > 0 && element.count > (bytes + 1) / size) header_.failTooShort();
        if (element.kind() == PlyElementKind::vertex) resizeLarge(polygons_.points, element.count);
    }

    void add(const PlyElement& element, std::vector<Faces> parts) {
        if (element.kind() == PlyElementKind::other && element.count > 0)
            polygons_.notes.push_back(fmt::format("left out: {} {}", counted(element.count, "element", "elements"),
                                                  quotedWord(element.name)));
        std::move(parts.begin(), parts.end(), std::back_inserter(faces_));
    }

    PolygonsOf<Scalar> finished() {
        if (polygons_.triangles.empty()) setFaces(polygons_, faces_);
        return std::move(polygons_);
    }

    const PlyHeader& header_;
    PolygonsOf<Scalar> polygons_;
    std::vector<Faces> faces_;
};

}  // namespace

Mesh readPly(const std::filesystem::path& path, ReadReport& report) {
    const MappedFile file(path);
    const TextSource source(path, file.bytes());
    const PlyHeader header = readPlyHeader(path, source);
    if (header.format == PlyFormat::text)
        return assembled(PlyReader<double>(header).readText(source, {header.end, source.end()}), path, report);
    const bool isBig = std::endian::native == std::endian::big;
    const PlyData data{header.end, source.end(), (header.format == PlyFormat::binaryBig) != isBig};
    if (header.storesFloats()) return assembled(PlyReader<float>(header).readBinary(data), path, report);
    return assembled(PlyReader<double>(header).readBinary(data), path, report);
}

}  // namespace bilayer::detail
