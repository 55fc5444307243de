// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/triangle_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sdf/io/formats/ply_fixed_records.h"
#include "sdf/io/formats/ply_header.h"
#include "sdf/io/formats/stl_records.h"
#include "sdf/io/input_file.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/polygon/polygons.h"
#include "sdf/io/text_source.h"
#include "sdf/mesh/topology.h"
#include "sdf/sign/sign_choice.h"

namespace bilayer::detail {
namespace {

/// Triangles that are visited at once. Pages of a file are released after each batch: at most 96 MiB, where each corner
/// lies on a page of its own.
constexpr std::size_t batchTriangles = 1 << 13;

// 0 and -0 are equal, as when a mesh is welded.
bool isCollapsed(const glm::vec3* corners) {
    return corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0];
}

class MeshTriangles : public TriangleSource {
  public:
    MeshTriangles(Mesh mesh, std::uint64_t hash) : mesh_(std::move(mesh)) {
        facts_ = {bounds(mesh_), mesh_.origin, hash, mesh_.triangles.size()};
    }

    bool isBalanced() const override { return balanced(mesh_); }

    void forEach(const Visit& visit) const override {
        std::vector<TileTriangle> batch;
        for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
            const glm::uvec3& t = mesh_.triangles[i];
            batch.push_back({std::uint32_t(i), {mesh_.points[t.x], mesh_.points[t.y], mesh_.points[t.z]}});
            if (batch.size() < batchTriangles) continue;
            visit(batch);
            batch.clear();
        }
        visit(batch);
    }

  private:
    Mesh mesh_;
};

/// A mapped file whose triangles are found by their number in the file.
class FileTriangles : public TriangleSource {
  public:
    explicit FileTriangles(const std::filesystem::path& path)
        : file_(path, MappedFile::Paging::onDemand), path_(path) {}

    void forEach(const Visit& visit) const override {
        std::uint32_t number = 0;
        std::vector<TileTriangle> batch(batchTriangles);
        for (std::uint64_t first = 0; first < count(); first += batchTriangles) {
            batch.resize(std::size_t(std::min<std::uint64_t>(batchTriangles, count() - first)));
            read(first, batch);
            std::erase_if(batch, [](const TileTriangle& t) { return isCollapsed(t.corners); });
            for (TileTriangle& t : batch) t.number = number++;
            file_.release();
            visit(batch);
        }
    }

    // Sums modulo 2^64, as balanced(). The file is read once more.
    bool isBalanced() const override {
        std::uint64_t sum = 0;
        forEach([&](std::span<const TileTriangle> batch) {
            for (const TileTriangle& t : batch) {
                const std::uint64_t a = hashVertex(t.corners[0]), b = hashVertex(t.corners[1]),
                                    c = hashVertex(t.corners[2]);
                sum += hashEdge(a, b) + hashEdge(b, c) + hashEdge(c, a);
            }
        });
        return sum == 0;
    }

  protected:
    virtual std::uint64_t count() const = 0;
    virtual void read(std::uint64_t first, std::span<TileTriangle> triangles) const = 0;

    // Call this at the end of the constructor.
    void setFacts() {
        if (count() >= std::uint64_t(std::numeric_limits<int>::max()))
            fail(fmt::format("has {} triangles, and a field has room for 2^31 - 2", count()));
        forEach([&](std::span<const TileTriangle> batch) {
            for (const TileTriangle& t : batch)
                for (const glm::vec3& corner : t.corners) facts_.box.add(corner);
            facts_.triangles += batch.size();
        });
        if (facts_.triangles == 0) fail("holds no triangle with three different corners");
        const glm::vec3 farthest = glm::max(glm::abs(facts_.box.lower), glm::abs(facts_.box.upper));
        if (isTooFarForFloats(double(std::max({farthest.x, farthest.y, farthest.z})), double(facts_.box.longestSide())))
            fail(
                "is so far from zero that floats round its coordinates, and cannot be built in tiles; move it closer, "
                "or build it without tiles");
    }

    [[noreturn]] void fail(const std::string& why) const {
        throw std::runtime_error(fmt::format("{}: {}", path_.string(), why));
    }

    MappedFile file_;
    std::filesystem::path path_;
};

class StlTriangles : public FileTriangles {
  public:
    explicit StlTriangles(const std::filesystem::path& path) : FileTriangles(path) { setFacts(); }

    static bool accepts(std::string_view bytes) {
        return bytes.size() >= stlBinarySize(0) && bytes.size() == stlBinarySize(stlFacetCount(bytes));
    }

  private:
    std::uint64_t count() const override { return stlFacetCount(file_.bytes()); }

    void read(std::uint64_t first, std::span<TileTriangle> triangles) const override {
        const char* at = file_.bytes().data() + stlBinarySize(first) + stlNormalBytes;
        for (std::size_t i = 0; i < triangles.size(); ++i, at += stlFacetBytes) {
            glm::vec3* corners = triangles[i].corners;
            std::memcpy(corners, at, 3 * sizeof(glm::vec3));
            for (int k = 0; k < 3; ++k)
                for (int axis = 0; axis < 3; ++axis)
                    if (!std::isfinite(corners[k][axis]))
                        fail(
                            fmt::format("triangle {}, counted from 0, has a coordinate that is not finite", first + i));
        }
    }
};

class PlyTriangles : public FileTriangles {
  public:
    PlyTriangles(const std::filesystem::path& path, const PlyHeader& header) : FileTriangles(path) {
        std::size_t at = std::size_t(header.end - header.begin);
        swapped_ = (header.format == PlyFormat::binaryBig) != (std::endian::native == std::endian::big);
        vertices_ = header.vertices;
        points_ = *PlyVertexRecords::of(header.elements[0]);
        pointsAt_ = at;
        count_ = header.elements[1].count;
        faces_ = *PlyTriangleRecords::of(header.elements[1], vertices_);
        facesAt_ = at + points_.size * vertices_;
        if (file_.bytes().size() < facesAt_) fail("ends within its vertices");
        setFacts();
    }

    static bool accepts(const PlyHeader& header) {
        if (header.format == PlyFormat::text || !header.storesFloats() || header.elements.size() != 2) return false;
        const PlyElement &first = header.elements[0], &second = header.elements[1];
        return PlyVertexRecords::of(first) && second.kind() == PlyElementKind::face &&
               PlyTriangleRecords::of(second, header.vertices);
    }

  private:
    std::uint64_t count() const override { return count_; }

    void read(std::uint64_t first, std::span<TileTriangle> triangles) const override {
        const std::string_view bytes = file_.bytes();
        if ((bytes.size() - facesAt_) / faces_.size < first + triangles.size()) fail("ends within its faces");
        std::vector<glm::uvec3> corners(triangles.size());
        if (!faces_.read(bytes.data() + facesAt_ + first * faces_.size, swapped_, corners))
            fail(
                fmt::format("a face from face {} on, counted from 0, is no triangle, or has a corner beyond the {} "
                            "vertices; such a file is read whole or not at all",
                            first, vertices_));
        for (std::size_t i = 0; i < triangles.size(); ++i)
            for (int k = 0; k < 3; ++k)
                if (!points_.read(bytes.data() + pointsAt_ + corners[i][k] * points_.size, swapped_,
                                  std::span(triangles[i].corners + k, 1)))
                    fail(fmt::format("vertex {}, counted from 0, has a coordinate that is not finite", corners[i][k]));
    }

    bool swapped_ = false;
    std::uint64_t vertices_ = 0, count_ = 0;
    PlyVertexRecords points_{};
    PlyTriangleRecords faces_{};
    std::size_t pointsAt_ = 0, facesAt_ = 0;  // [bytes]
};

}  // namespace

std::unique_ptr<TriangleSource> trianglesOf(Mesh mesh) {
    const std::uint64_t known = hash(mesh);
    return trianglesOf(std::move(mesh), known);
}

std::unique_ptr<TriangleSource> trianglesOf(Mesh flipped, std::uint64_t hash) {
    return std::make_unique<MeshTriangles>(std::move(flipped), hash);
}

std::unique_ptr<TriangleSource> trianglesOfFile(const std::filesystem::path& path) {
    const std::string extension = lowerExtension(path);
    const MappedFile file(path, MappedFile::Paging::onDemand);
    if (extension == ".stl" && StlTriangles::accepts(file.bytes())) return std::make_unique<StlTriangles>(path);
    if (extension != ".ply") return nullptr;
    const TextSource source(path, file.bytes());
    const PlyHeader header = readPlyHeader(path, source);
    if (!PlyTriangles::accepts(header)) return nullptr;
    return std::make_unique<PlyTriangles>(path, header);
}

}  // namespace bilayer::detail
