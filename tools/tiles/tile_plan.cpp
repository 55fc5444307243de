// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/tile_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <bilayer/sdf/grids.h>
#include "tools/tiles/tile_folder.h"

namespace bilayer::tools {

using namespace bilayer::detail;
namespace {

Json triple(const glm::ivec3& v) {
    return Json::array({v.x, v.y, v.z});
}

template <class Vec>
Vec numbers(const Json& json) {
    using Scalar = typename Vec::value_type;
    return {json.at(0).get<Scalar>(), json.at(1).get<Scalar>(), json.at(2).get<Scalar>()};
}

// The box of the active voxels; null if there is none.
Json bandOf(const openvdb::FloatGrid& grid) {
    const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
    if (box.empty()) return nullptr;
    const auto corner = [](const openvdb::Coord& c) { return Json::array({c.x(), c.y(), c.z()}); };
    return {{"lower", corner(box.min())}, {"upper", corner(box.max())}};
}

// What each rank has read and written, and what other ranks wrote of that.
Json loadOfRanks(const std::vector<Json>& records, const Json& plan, const Json& sorting, int count) {
    // a run with more ranks may have been killed
    for (const Json& record : records) count = std::max(count, record.at("rank").get<int>() + 1);
    Json ranks = Json::array();
    for (int rank = 0; rank < count; ++rank) {
        std::uint64_t tiles = 0, read = 0, written = 0, fromOthers = rank > 0 ? recordBytes(plan) : 0;
        std::uint64_t peak = rank > 0 ? 0 : sorting.at("peakRssBytes").get<std::uint64_t>();
        double seconds = 0;
        for (const Json& record : records) {
            const std::uint64_t triangles = record.at("readBytes"), sums = record.value("sumBytes", std::uint64_t(0));
            const bool own = record.at("rank") == rank;
            if (rank == 0 && !own) fromOthers += recordBytes(record);
            if (!own) continue;
            ++tiles;
            read += triangles + sums;
            if (count > 1) fromOthers += sums;
            written += record.value("writtenBytes", std::uint64_t(0));
            if (rank > 0) fromOthers += triangles;
            seconds += record.at("seconds").get<double>();
            peak = std::max(peak, record.at("peakRssBytes").get<std::uint64_t>());
        }
        ranks.push_back({{"rank", rank},
                         {"tiles", tiles},
                         {"seconds", seconds},
                         {"peakRssBytes", peak},
                         {"readBytes", read},
                         {"writtenBytes", written},
                         {"exchangedBytes", fromOthers}});
    }
    return ranks;
}

const char* nameOf(const VoxelSides& sides) {
    return sides.inside && sides.outside ? "both" : sides.inside ? "inside" : "outside";
}

}  // namespace

Json identityOf(const BuildArguments& a, const glm::ivec3& counts, const std::string& meshFileHash) {
    const DoubleLayerOptions& layers = a.options.doubleLayer;
    const bool byResolution = a.resolutionGiven->count() > 0;
    return {{"version", BILAYER_VERSION},
            {"meshFile", meshFileHash},
            {"tiles", triple(counts)},
            {"method", a.method},
            {"sign", a.sign},
            {"gap", number(a.options.gapVoxels)},
            {byResolution ? "resolution" : "voxelSize", number(byResolution ? a.resolution : a.options.voxelSize)},
            {"bandUnit", a.bandUnit},
            {"exteriorWidth", number(a.exteriorGiven->count() ? a.exteriorWidth : a.halfWidth)},
            {"interiorWidth", number(a.interiorGiven->count() ? a.interiorWidth : a.halfWidth)},
            {"layers", {number(layers.delta), number(layers.epsilon), layers.neighbourhood, layers.maxSubdivision}},
            {"triangles", a.options.triangles}};
}

Json TilePlan::toJson(const Json& identity, const MeshFacts& facts, float voxelSize, const Json& signs,
                      const std::vector<TileLoad>& loads, const Json& sorting) {
    Json tiles = Json::array();
    for (const TileLoad& load : loads)
        tiles.push_back({{"triangles", load.triangles}, {"area", load.area}, {"hash", load.hash}});
    return {{"field", identity},
            {"voxelSize", number(voxelSize)},
            {"mesh",
             {{"triangles", facts.triangles},
              {"lower", vector(facts.box.lower)},
              {"upper", vector(facts.box.upper)},
              {"origin", vector(facts.origin)},
              {"hash", facts.hash}}},
            {"signs", signs},
            {"sorting", sorting},
            {"loads", tiles}};
}

TilePlan::TilePlan(Json plan) : plan_(std::move(plan)) {
    try {
        const Json& mesh = plan_.at("mesh");
        facts_ = {{numbers<glm::vec3>(mesh.at("lower")), numbers<glm::vec3>(mesh.at("upper"))},
                  numbers<glm::dvec3>(mesh.at("origin")),
                  mesh.at("hash").get<std::uint64_t>(),
                  mesh.at("triangles").get<std::uint64_t>()};
        voxelSize_ = plan_.at("voxelSize").get<float>();
        signs_ = plannedSigns(plan_.at("signs"));
        for (const Json& load : plan_.at("loads"))
            loads_.push_back({load.at("triangles").get<std::uint64_t>(), load.at("area").get<double>(),
                              load.at("hash").get<std::uint64_t>()});
    } catch (const Json::exception& error) {
        throw std::runtime_error(
            fmt::format("the plan of the tiles is damaged: remove the folder `work` of the tiles ({})", error.what()));
    }
}

Json TilePlan::with(const PlannedSigns& signs) const {
    Json plan = plan_;
    plan["signs"] = tools::toJson(signs);
    return plan;
}

Json TilePlan::manifest(const std::vector<Json>& records, int ranks) const {
    std::uint64_t files = 0, leaves = 0, voxels = 0, peak = plan_.at("sorting").at("peakRssBytes");
    double seconds = 0;
    for (const Json& record : records) {
        files += !record.at("file").is_null();
        leaves += record.at("leaves").get<std::uint64_t>();
        voxels += record.at("activeVoxels").get<std::uint64_t>();
        seconds += record.at("seconds").get<double>();
        peak = std::max(peak, record.at("peakRssBytes").get<std::uint64_t>());
    }
    Json manifest = plan_;
    manifest.erase("loads");
    manifest["mesh"]["hash"] = facts_.hash == 0 ? Json() : Json(hex(facts_.hash));
    manifest["sum"] = {{"files", files},     {"leaves", leaves}, {"activeVoxels", voxels},
                       {"seconds", seconds}, {"ranks", ranks},   {"peakRssBytes", peak}};
    manifest["ranks"] = loadOfRanks(records, plan_, plan_.at("sorting"), ranks);
    manifest["tiles"] = records;
    return manifest;
}

void addTileRows(Table& table, const Json& manifest) {
    const Json &counts = manifest.at("field").at("tiles"), &sum = manifest.at("sum"), &signs = manifest.at("signs");
    table.row("tiles", fmt::format("{} x {} x {}, {} of them with leaves", counts[0].get<int>(), counts[1].get<int>(),
                                   counts[2].get<int>(), sum.at("files").get<std::size_t>()));
    table.row("leaves", grouped(sum.at("leaves")));
    table.row("active voxels", grouped(sum.at("activeVoxels")));
    table.row("triangles", grouped(manifest.at("mesh").at("triangles")));
    if (!signs.is_null())
        table.row("signs",
                  fmt::format("{}: {}", signs.at("name").get<std::string>(), signs.at("reason").get<std::string>()));
    table.row("sorted in", fmt::format("{:.3f} s, peak memory {}", manifest.at("sorting").at("seconds").get<double>(),
                                       bytes(manifest.at("sorting").at("peakRssBytes"))));
    table.row("built in", fmt::format("{:.3f} s of all tiles", sum.at("seconds").get<double>()));
    table.row("peak memory", bytes(sum.at("peakRssBytes")));
}

Json recordOf(const glm::ivec3& place, const BlockBox& box, std::uint64_t triangles, const BuiltTile& tile) {
    Json faces = Json::array();
    if (tile.grids)
        for (const VoxelSides& sides : tile.faces) faces.push_back(nameOf(sides));
    const auto count = [&](auto of) { return tile.grids ? std::uint64_t(of(*tile.grids->distance)) : 0; };
    return {{"tile", triple(place)},
            {"file", nullptr},
            {"lower", triple(box.first)},
            {"upper", triple(box.end - 1)},
            {"triangles", triangles},
            {"leaves", count([](const openvdb::FloatGrid& grid) { return grid.tree().leafCount(); })},
            {"activeVoxels", count([](const openvdb::FloatGrid& grid) { return grid.activeVoxelCount(); })},
            {"signs", toJson(tile.counts)},
            {"band", tile.grids ? bandOf(*tile.grids->distance) : Json()},
            {"faces", faces}};
}

glm::ivec3 placeOf(const Json& record) {
    return numbers<glm::ivec3>(record.at("tile"));
}

// A tile without leaves is all on one side, and so are the voxels on its neighbours' faces towards it.
void joinSides(std::vector<Json>& records, const glm::ivec3& counts) {
    const auto at = [&](const glm::ivec3& p) -> Json* {
        for (int axis = 0; axis < 3; ++axis)
            if (p[axis] < 0 || p[axis] >= counts[axis]) return nullptr;
        return &records[std::size_t((p.x * counts.y + p.y) * counts.z + p.z)];
    };
    // the side that a neighbour gives; empty if its side is unknown too
    const auto sideFrom = [&](const glm::ivec3& place, int face) -> std::string {
        glm::ivec3 next = place;
        next[face % 3] += face < 3 ? -1 : 1;
        const Json* neighbour = at(next);
        if (!neighbour) return "outside";
        if (!neighbour->at("file").is_null()) return neighbour->at("faces").at(std::size_t((face + 3) % 6));
        return neighbour->value("side", "");
    };
    for (bool changed = true; changed;) {
        changed = false;
        for (Json& record : records) {
            if (!record.at("file").is_null()) continue;
            for (int face = 0; face < 6; ++face) {
                const std::string side = sideFrom(placeOf(record), face), known = record.value("side", "");
                if (side.empty() || side == known) continue;
                if (side == "both" || !known.empty())
                    throw std::invalid_argument(fmt::format(
                        "the tiles around the empty tile {} contradict each other: build this field in one piece",
                        record.at("tile").dump()));
                record["side"] = side;
                changed = true;
            }
        }
    }
}

}  // namespace bilayer::tools
