// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/tile_run.h"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <cstdio>
#include <optional>
#include <regex>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "collider/field/block_summary.h"
#include "collider/field/surface_file.h"
#include "sdf/base/usable_memory.h"
#include "sdf/grid/vdb_grids.h"
#include "sdf/io/content_hash.h"
#include "sdf/tiles/tile_manifest.h"
#include "sdf/tiles/tile_signs.h"
#include "sdf/tiles/tile_sort.h"
#include "tools/mesh_file.h"
#include "tools/tiles/column_files.h"
#include "tools/tiles/flood_run.h"
#include "tools/tiles/mesh_sort.h"
#include "tools/tiles/tile_folder.h"
#include "tools/tiles/tile_plan.h"

namespace bilayer::tools {

using namespace bilayer::detail;
namespace {

constexpr double mib = 1 << 20;
/// Memory of a process that joins the records of tiles [bytes], and per tile: 82,000 tiles took 440 MB in all.
constexpr double bytesOfJoin = 90e6, bytesPerRecord = 4300;

// Throws for options whose results need the whole field.
void requireTileOptions(const BuildArguments& a) {
    const auto refuse = [](bool given, const char* option) {
        if (given) throw CLI::ValidationError(option, "is not for --tiles");
    };
    refuse(a.body, "--body");
    refuse(a.extend, "--extend");
    refuse(a.report, "--report");
    refuse(a.stored.halfFloat, "--half-float");
    refuse(a.backend != "tbb", "--backend opencl");
    try {
        requireLocal(a.options);
    } catch (const std::invalid_argument& error) {
        throw CLI::ValidationError("--tiles", error.what());
    }
}

glm::ivec3 countsOf(const std::string& text) {
    static const std::regex pattern("([1-9][0-9]{0,3})x([1-9][0-9]{0,3})x([1-9][0-9]{0,3})");
    std::smatch match;
    if (!std::regex_match(text, match, pattern))
        throw CLI::ValidationError("--tiles", text + ": must be three counts from 1 to 9999, as 4x4x2");
    return {std::stoi(match[1]), std::stoi(match[2]), std::stoi(match[3])};
}

/// The work of one rank.
class TileRun {
  public:
    TileRun(BuildArguments arguments, const TileArguments& tiles, const Ranks& ranks)
        : a_(std::move(arguments)),
          counts_(countsOf(tiles.counts)),
          budget_(tiles.memoryGiven->count() ? double(tiles.memory) * mib : usableMemory()),
          ranks_(ranks),
          folder_(a_.output) {}

    void run() {
        if (ranks_.isFirst()) prepareAlone();
        ranks_.wait();
        while (!std::filesystem::exists(folder_.manifest())) {
            ranks_.wait();  // else a fast first rank would write the manifest here
            buildMissing();
            ranks_.wait();
        }
        if (!ranks_.isFirst()) return;
        const Json manifest = readJson(folder_.manifest());
        if (a_.json) return print(manifest);
        Table table(a_.output.string());
        addTileRows(table, manifest);
        table.print();
    }

  private:
    // No other build may write the folder. A new folder goes if there is nothing to build.
    void prepareAlone() {
        std::error_code error;
        const bool isNew = std::filesystem::create_directories(folder_.root(), error);
        if (error) throw std::runtime_error(fmt::format("{}: {}", folder_.root().string(), error.message()));
        lock_.emplace(folder_.root());
        try {
            prepare();
        } catch (...) {
            if (isNew) std::filesystem::remove(folder_.root(), error);  // unless it is not empty
            throw;
        }
    }

    // Plans the field, or resumes the existing plan. Afterwards there is the manifest of a finished field, or a plan
    // and the records of exactly those tiles that are intact.
    void prepare() {
        identity_ = identityOf(a_, counts_, hex(meshFileHash(a_.mesh)));
        if (std::filesystem::exists(folder_.manifest())) {
            readTileManifest(folder_.root());  // may throw
            requireSame(readJson(folder_.manifest()));
            if (isFinished()) return;
        } else if (!resume()) {
            sort().run(identity_, 0);
        }
        const TilePlan plan(readRecord(folder_.plan()));
        stateMemory(plan, tilingOf(plan));
    }

    void requireSame(const Json& made) const {
        if (made.at("field") != identity_)
            throw std::runtime_error(fmt::format(
                "{}: holds tiles of another mesh or with other options: choose another folder", a_.output.string()));
    }

    // Returns whether there is a plan to go on with. Sorts the triangles again if some that are needed are damaged.
    bool resume() {
        if (!std::filesystem::exists(folder_.plan())) return false;
        const Json made = readPlanOfKilledRun(folder_);
        if (made.at("field") != identity_ && !folder_.hasTiles()) {
            folder_.clean();
            return false;
        }
        requireSame(made);
        const TilePlan plan(made);
        const Tiling tiling = tilingOf(plan);
        bool isSorted = true;
        for (std::size_t tile = 0; tile < tiling.size(); ++tile) {
            const glm::ivec3 place = tiling.place(tile);
            const bool isDone = tools::isFinished(folder_, place);
            if (!isDone) std::filesystem::remove(folder_.record(place));
            if (!isDone || plan.signs().needSums() || plan.signs().areByFlood())
                isSorted = isSorted && hasTileTriangles(folder_.triangles(place), plan.loads()[tile]);
        }
        const PlannedSigns signs = plan.signs();
        if (!isSorted) sort().run(identity_, signs.round, &signs);
        return true;
    }

    // Also sets the options of the tiles.
    Tiling tilingOf(const TilePlan& plan) {
        setSizes(a_, plan.voxelSize());
        options_ = optionsWith(a_.options, plan.signs().signs);
        return {plan.facts().box, options_, counts_};
    }

    MeshSort sort() { return {a_, counts_, budget_, folder_}; }

    // Returns whether all tiles are intact. If not, the manifest becomes a plan and the records of those that are.
    bool isFinished() {
        const Json manifest = readJson(folder_.manifest()), records = manifest.at("tiles");
        const auto intact = [&](const Json& record) { return isIntact(folder_, record); };
        if (std::all_of(records.begin(), records.end(), intact)) {
            folder_.clean();  // a run that was killed at its end has not done so
            return true;
        }
        const PlannedSigns signs = plannedSigns(manifest.at("signs"));
        folder_.create();
        folder_.removeRecords();
        for (const Json& record : records)
            if (intact(record)) writeRecord(folder_.record(placeOf(record)), record);
        sort().run(identity_, signs.round, &signs);
        std::filesystem::remove(folder_.manifest());
        return false;
    }

    void buildMissing() {
        const TilePlan plan(readRecord(folder_.plan()));
        const Tiling tiling = tilingOf(plan);
        const std::vector<std::size_t> own = ownTiles(plan, tiling);
        ColumnFiles sums(folder_, plan, tiling);
        FloodRun flood(folder_, plan, tiling, options_, ranks_);
        if (plan.signs().needSums()) writeSums(sums, tiling, own);
        if (plan.signs().areByFlood())
            wrapped([&] { flood.prepare(shareOf(plan, tiling, [](std::size_t) { return true; })); });
        for (const std::size_t tile : own) build(plan, tiling, tile, sums, flood);
        ranks_.wait();
        if (ranks_.isFirst()) finish(plan, tiling);
    }

    // Sums of tiles that are built, and of those that are finished, whose sums may be missing too.
    void writeSums(const ColumnFiles& sums, const Tiling& tiling, const std::vector<std::size_t>& own) {
        for (const std::size_t tile : own) wrapped([&] { sums.write(tile); });
        for (std::size_t tile = std::size_t(ranks_.rank); tile < tiling.size(); tile += std::size_t(ranks_.count))
            if (std::filesystem::exists(folder_.record(tiling.place(tile)))) wrapped([&] { sums.write(tile); });
        ranks_.wait();
    }

    double need(const TilePlan& plan, const Tiling& tiling, std::size_t tile) const {
        const TileLoad& load = plan.loads()[tile];
        return tileBytes(load.triangles, load.area, tiling, tile, options_);
    }

    double largestNeed(const TilePlan& plan, const Tiling& tiling) const {
        double largest = 0;
        for (std::size_t tile = 0; tile < tiling.size(); ++tile) largest = std::max(largest, need(plan, tiling, tile));
        return largest;
    }

    static double bytesOfRecords(const Tiling& tiling) { return bytesOfJoin + double(tiling.size()) * bytesPerRecord; }

    // Refuses, before any tile is built, what would not fit.
    void stateMemory(const TilePlan& plan, const Tiling& tiling) const {
        const double largest = largestNeed(plan, tiling), join = bytesOfRecords(tiling);
        if (largest > budget_)
            throw std::runtime_error(
                fmt::format("the largest of {} tiles needs about {:.0f} MiB, and {:.0f} MiB are given: take more tiles",
                            tiling.size(), largest / mib, budget_ / mib));
        if (join > budget_)
            throw std::runtime_error(fmt::format(
                "the records of {} tiles need about {:.0f} MiB, and {:.0f} MiB are given: take fewer, larger tiles",
                tiling.size(), join / mib, budget_ / mib));
        if (a_.json) return;
        fmt::print("each of {} tiles within {:.0f} MiB\n", tiling.size(), std::max(largest, join) / mib);
        std::fflush(stdout);
    }

    // This rank's share of the missing tiles.
    std::vector<std::size_t> ownTiles(const TilePlan& plan, const Tiling& tiling) const {
        std::vector<std::size_t> own = shareOf(plan, tiling, [&](std::size_t tile) {
            return !std::filesystem::exists(folder_.record(tiling.place(tile)));
        });
        ranks_.wait();  // else a record of a fast rank would be missed here
        return own;
    }

    // Some tiles, the largest first, dealt to all ranks in turn.
    template <class Wanted>
    std::vector<std::size_t> shareOf(const TilePlan& plan, const Tiling& tiling, const Wanted& wanted) const {
        std::vector<std::size_t> all, own;
        for (std::size_t tile = 0; tile < tiling.size(); ++tile)
            if (wanted(tile)) all.push_back(tile);
        std::stable_sort(all.begin(), all.end(),
                         [&](std::size_t a, std::size_t b) { return need(plan, tiling, a) > need(plan, tiling, b); });
        for (std::size_t i = std::size_t(ranks_.rank); i < all.size(); i += std::size_t(ranks_.count))
            own.push_back(all[i]);
        return own;
    }

    BuiltTile built(const TilePlan& plan, const Tiling& tiling, std::size_t tile, ColumnFiles& sums) {
        BuiltTile built;
        if (plan.loads()[tile].triangles == 0) return built;
        PartSigns signs = plan.signs().signs;
        std::optional<ColumnSums> below;
        if (plan.signs().needSums()) signs.below = &below.emplace(sums.below(tile));
        const std::vector<TileTriangle> triangles =
            readTileTriangles(folder_.triangles(tiling.place(tile)), plan.loads()[tile]);
        wrapped([&] { built = buildTile(triangles, plan.facts(), tiling, tile, options_, signs); });
        return built;
    }

    void build(const TilePlan& plan, const Tiling& tiling, std::size_t tile, ColumnFiles& sums, FloodRun& flood) {
        const Stopwatch watch;
        const glm::ivec3 place = tiling.place(tile);
        const std::uint64_t count = plan.loads()[tile].triangles;
        const std::uint64_t sumsBefore = sums.readBytes();
        const bool isByFlood = plan.signs().areByFlood();
        BuiltTile built = isByFlood ? flood.build(tile) : this->built(plan, tiling, tile, sums);
        const FloodRun::Load load = flood.takeLoad();
        Json record = recordOf(place, tiling.own(tile).within(tiling.lattice()), count, built);
        record["readBytes"] = count * sizeof(TileTriangle);
        record["sumBytes"] = sums.readBytes() - sumsBefore + load.bytes;
        if (isByFlood && !built.grids) record["side"] = built.inside ? "inside" : "outside";
        if (built.grids) writeTile(std::move(built), place, plan.facts().origin, tiling.own(tile), record);
        built = {};
        ::malloc_trim(0);  // what one tile has used is free for the next
        record["rank"] = ranks_.rank;
        record["seconds"] = watch.seconds() + load.seconds;
        record["peakRssBytes"] = peakMemory();
        writeRecord(folder_.record(place), record);
    }

    void writeTile(BuiltTile tile, const glm::ivec3& place, const glm::dvec3& origin, const BlockBox& own,
                   Json& record) const {
        const std::filesystem::path field = folder_.field(place), cells = folder_.cells(place);
        openvdb::GridCPtrVec grids{withOrigin(tile.grids->distance, origin)};
        if (tile.grids->triangle) grids.push_back(withOrigin(tile.grids->triangle, origin));
        grids.push_back(withOrigin(tile.border, origin));
        writeGrids(field, grids);
        grids.clear();
        writeSurfaceBlocks(cells, surfaceBlocksOf(std::move(tile), own));
        record["file"] = field.filename().string();
        record["hash"] = fileHash(field);
        record["cells"] = cells.filename().string();
        record["cellsHash"] = fileHash(cells);
        record["writtenBytes"] = std::filesystem::file_size(field) + std::filesystem::file_size(cells);
    }

    std::vector<SurfaceBlock> surfaceBlocksOf(BuiltTile tile, const BlockBox& own) const {
        const auto coord = [](const glm::ivec3& v) { return openvdb::Coord(v.x, v.y, v.z); };
        const auto grid = openvdb::ConstPtrCast<openvdb::FloatGrid>(tile.grids->distance);
        addBorder(grid->tree(), tile.border->tree());
        return surfaceBlocks(grid->tree(), {coord(own.first), coord(own.end - 1)}, options_.voxelSize);
    }

    template <class Work>
    void wrapped(const Work& work) const {
        try {
            work();
        } catch (const std::invalid_argument& error) {
            throw std::invalid_argument(fmt::format("{}: {}", a_.mesh.string(), error.what()));
        }
    }

    // Completes the manifest, or plans the tiles anew if their counts show that the signs are not those of build().
    void finish(const TilePlan& plan, const Tiling& tiling) {
        std::vector<Json> records;
        std::vector<SignCounts> counts;
        for (std::size_t tile = 0; tile < tiling.size(); ++tile) {
            records.push_back(readRecord(folder_.record(tiling.place(tile))));
            counts.push_back(signCounts(records.back().at("signs")));
        }
        if (plan.signs().signs.check == NormalsCheck::count)
            if (const SignCounts sum = sumOf(counts); judge(sum) != SignVerdict::right)
                return planAgain(plan, tiling, sum);
        if (std::all_of(records.begin(), records.end(), [](const Json& r) { return r.at("activeVoxels") == 0; }))
            throw std::invalid_argument(
                "the half width is too small for this voxel size: no voxel lies within the band");
        if (!plan.signs().areByFlood()) joinSides(records, counts_);
        Json manifest = plan.manifest(records, ranks_.count);
        manifest["sum"]["estimatedBytes"] = std::uint64_t(std::max(largestNeed(plan, tiling), bytesOfRecords(tiling)));
        writeManifest(folder_.manifest(), std::move(manifest));
        folder_.clean();
    }

    void planAgain(const TilePlan& plan, const Tiling& tiling, const SignCounts& sum) {
        const bool conflict = judge(sum) == SignVerdict::conflict;
        const int round = plan.signs().round;
        if (conflict) {
            sort().run(identity_, round + 1);
            const TilePlan next(readRecord(folder_.plan()));
            if (next.signs().areByFlood()) stateMemory(next, tilingOf(next));  // which needs more than others
        } else {
            for (std::size_t tile = 0; tile < tiling.size(); ++tile) folder_.remove(tiling.place(tile));
            writeRecord(folder_.plan(), plan.with({corrected(plan.signs().signs, sum), round}));
        }
        if (a_.json) return;
        const std::string reason = TilePlan(readRecord(folder_.plan())).signs().signs.reason;
        fmt::print("all tiles again: {}\n", reason);
        std::fflush(stdout);
    }

    BuildArguments a_;
    BuildOptions options_;  // of the tiles
    glm::ivec3 counts_;
    double budget_;  // [bytes]
    const Ranks& ranks_;
    TileFolder folder_;
    std::optional<FolderLock> lock_;  // of the first rank
    Json identity_;                   // of the first rank
};

}  // namespace

CLI::Option* addTileOptions(CLI::App& command, TileArguments& a) {
    auto* tiles = command.add_option("--tiles", a.counts,
                                     "build in tiles, as 4x4x2: -o is then a folder of one .vdb file a tile");
    a.memoryGiven = command
                        .add_option("--memory", a.memory,
                                    "memory that a build in tiles may use [MiB], default all that the process may use")
                        ->check(CLI::Range(std::uint64_t(1), std::uint64_t(1) << 30))
                        ->needs(tiles);
    return tiles;
}

void buildTiles(BuildArguments a, const TileArguments& tiles, const Ranks& ranks) {
    requireTileOptions(a);
    const std::string folder = a.output.string();
    try {
        TileRun(std::move(a), tiles, ranks).run();
    } catch (const Json::exception& error) {
        throw std::runtime_error(
            fmt::format("{}: a file of the tiles is damaged ({}): remove the folder", folder, error.what()));
    }
}

}  // namespace bilayer::tools
