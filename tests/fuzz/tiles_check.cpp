// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>
#include <glm/vec3.hpp>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/grids.h>
#include "collider/field/layout/block_summary.h"
#include "collider/field/layout/field_layout.h"
#include "collider/field/layout/surface_file.h"
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/grid/vdb_grids.h"
#include "sdf/io/content_hash.h"
#include "sdf/tiles/tile_build.h"
#include "sdf/tiles/tiling.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/checks.h"
#include "tests/support/support.h"

namespace bilayer::test {
namespace {

using namespace detail;
using Json = nlohmann::json;
namespace fs = std::filesystem;

constexpr unsigned maxTileEdits = 3;
constexpr std::size_t budget = 1 << 20;  // of tiles that are kept [bytes]

Json triple(const glm::ivec3& v) {
    return {v.x, v.y, v.z};
}

/// A valid field in tiles: its manifest, and the surface blocks of each tile. The .vdb files stay in a folder.
class TilesOfBox {
  public:
    TilesOfBox() : folder_(scratch("fuzz-tiles")) {
        fs::create_directories(folder_);
        const Mesh mesh = shapes::box({0.4f, 0.2f, 0.2f});
        const BuildOptions options{.voxelSize = 0.02f, .sign = Sign::normals};
        Tiling tiling(bounds(mesh), options, {2, 1, 1});
        std::vector<std::vector<TileTriangle>> triangles(tiling.size());
        for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
            const glm::uvec3& t = mesh.triangles[i];
            const TileTriangle triangle{i, {mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]}};
            const auto at = [&](int k) { return glm::dvec3(triangle.corners[k]) / double(options.voxelSize); };
            tiling.forEachTileOf({at(0), at(1), at(2)}, [&](std::size_t tile) { triangles[tile].push_back(triangle); });
        }
        const MeshFacts facts{bounds(mesh), mesh.origin, hash(mesh), mesh.triangles.size()};
        manifest_ = {{"field", {{"tiles", triple(tiling.counts())}}}, {"mesh", {{"origin", {0.0, 0.0, 0.0}}}}};
        for (std::size_t tile = 0; tile < tiling.size(); ++tile)
            manifest_["tiles"].push_back(added(tile, buildTile(triangles[tile], facts, tiling, tile, options), tiling));
    }

    const fs::path& folder() const { return folder_; }
    const Json& manifest() const { return manifest_; }
    const std::vector<std::vector<SurfaceBlock>>& blocks() const { return blocks_; }

  private:
    Json added(std::size_t tile, const BuiltTile& built, const Tiling& tiling) {
        const BlockBox own = tiling.own(tile), box = own.within(tiling.lattice());
        const std::string name = "tile" + std::to_string(tile) + ".vdb";
        writeGrids(folder_ / name, {built.grids->distance, built.border});
        const openvdb::CoordBBox band = built.grids->distance->evalActiveVoxelBoundingBox();
        const auto place = [](const openvdb::Coord& v) { return triple({v.x(), v.y(), v.z()}); };
        const auto coord = [](const glm::ivec3& v) { return openvdb::Coord(v.x, v.y, v.z); };
        const auto grid = openvdb::ConstPtrCast<openvdb::FloatGrid>(built.grids->distance);
        addBorder(grid->tree(), built.border->tree());
        blocks_.push_back(surfaceBlocks(grid->tree(), {coord(own.first), coord(own.end - 1)}, 0.02f));
        return {{"file", name},
                {"hash", fileHash(folder_ / name)},
                {"lower", triple(box.first)},
                {"upper", triple(box.end - 1)},
                {"band", {{"lower", place(band.min())}, {"upper", place(band.max())}}},
                {"side", "outside"}};
    }

    fs::path folder_;
    Json manifest_;
    std::vector<std::vector<SurfaceBlock>> blocks_;
};

/// A value of any type, often a whole number near the old one.
Json arbitraryValue(const Json& old, ByteSource& bytes) {
    switch (bytes.below(8)) {
        case 0:
            return nullptr;
        case 1:
            return double(bytes.anyFloat());
        case 2:
            return std::string(bytes.below(300), char(bytes.byte() & 127));
        case 3:
            return Json::array({bytes.number<std::int32_t>()});
        case 4:
            return bytes.number<std::int64_t>();
        case 5:
            return bytes.number<std::int32_t>();
        default:
            if (!old.is_number_integer()) return bytes.flag();
            return old.get<std::int64_t>() + (bytes.flag() ? blockSide : 1) * bytes.number<std::int8_t>();
    }
}

void editManifest(Json& manifest, ByteSource& bytes) {
    const Json leaves = manifest.flatten();
    auto leaf = leaves.begin();
    std::advance(leaf, bytes.below(unsigned(leaves.size())));
    const Json::json_pointer at(leaf.key());
    if (bytes.byte() % 8 == 0)
        manifest = manifest.patch(Json::array({{{"op", "remove"}, {"path", leaf.key()}}}));
    else
        manifest[at] = arbitraryValue(leaf.value(), bytes);
}

/// Moves the border of the two tiles.
void moveBorder(Json& manifest, ByteSource& bytes) {
    Json& tiles = manifest["tiles"];
    const int shift = blockSide * bytes.number<std::int8_t>();
    tiles[0]["upper"][0] = tiles[0]["upper"][0].get<int>() + shift;
    tiles[1]["lower"][0] = tiles[1]["lower"][0].get<int>() + shift;
}

void editBlocks(std::vector<SurfaceBlock>& blocks, ByteSource& bytes) {
    if (blocks.empty()) return;
    SurfaceBlock& block = blocks[bytes.below(unsigned(blocks.size()))];
    const int axis = int(bytes.below(3));
    block.first[axis] = bytes.flag() ? bytes.number<std::int32_t>() : block.first[axis] + bytes.number<std::int8_t>();
    if (bytes.byte() % 4 == 0) blocks.clear();
}

/// @param isValid  the field must open
void useTiles(const fs::path& folder, ByteSource& bytes, bool isValid) {
    try {
        const FieldOptions options{bytes.flag() ? Storage::fixed16 : Storage::float32};
        const TiledField field(folder, budget, options);
        for (int i = 0; i < 8; ++i) {
            const glm::vec3 point = i % 2 ? bytes.anyVector() : 0.5f * bytes.latticePoint();
            (void)field.sample(point);
            (void)field.inside(point);
            (void)field.closest(point, 1);
            (void)field.raycast({point, {1, 0.5f, 0.25f}, 10});
        }
    } catch (const std::runtime_error& error) {
        require(!isValid, error.what());
        require(std::string(error.what()).starts_with(folder.string()), "an error does not name the file");
        requirePlainError(std::string(error.what()).substr(folder.string().size()));
    }
}

}  // namespace

void checkTiles(Bytes edits) {
    static const TilesOfBox valid;
    ByteSource bytes(edits);
    Json manifest = valid.manifest();
    auto blocks = valid.blocks();
    const unsigned count = bytes.below(maxTileEdits + 1);
    for (unsigned i = 0; i < count; ++i)
        if (bytes.byte() % 4 == 0) editBlocks(blocks[bytes.below(unsigned(blocks.size()))], bytes);
    for (std::size_t tile = 0; tile < blocks.size(); ++tile) {
        const std::string name = "tile" + std::to_string(tile) + ".cells";
        writeSurfaceBlocks(valid.folder() / name, blocks[tile]);
        manifest["tiles"][tile]["cells"] = name;
        manifest["tiles"][tile]["cellsHash"] = fileHash(valid.folder() / name);
    }
    if (count > 0 && bytes.flag()) moveBorder(manifest, bytes);
    for (unsigned i = 1; i < count; ++i) editManifest(manifest, bytes);
    std::string text = manifest.dump();
    if (bytes.byte() % 8 == 0)
        for (unsigned i = 0; i < count; ++i) text[bytes.below(65536) % text.size()] = char(bytes.byte());
    std::ofstream(valid.folder() / "manifest.json", std::ios::binary) << text;
    useTiles(valid.folder(), bytes, count == 0);
}

}  // namespace bilayer::test
