// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/tile_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <regex>
#include <stdexcept>
#include <utility>
#include <vector>

#include <bilayer/sdf/build.h>
#include "sdf/base/usable_memory.h"
#include "sdf/leaf/build_options.h"
#include "sdf/tiles/tile_signs.h"
#include "tools/tiles/planned_tiles.h"
#include "tools/tiles/tile_builder.h"
#include "tools/tiles/tile_folder.h"
#include "tools/tiles/tile_plan.h"
#include "tools/tiles/tile_planner.h"

namespace bilayer::tools {

using namespace bilayer::detail;
namespace {

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
          budget_(tiles.memoryGiven->count() ? double(tiles.memory << 20) : usableMemory()),
          ranks_(ranks),
          folder_(a_.output) {}

    void run() {
        if (ranks_.isFirst()) planner_.emplace(a_, counts_, budget_, folder_).prepare();
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
    void buildMissing() {
        const PlannedTiles tiles = plannedTiles(TilePlan(readRecord(folder_.plan())), a_, counts_);
        const std::vector<std::size_t> own = ownMissing(tiles);
        TileBuilder builder(a_.mesh, folder_, tiles, ranks_);
        builder.prepare(own, shareOf(tiles, [](std::size_t) { return true; }));
        for (const std::size_t tile : own) builder.build(tile);
        ranks_.wait();
        if (ranks_.isFirst()) finish(tiles);
    }

    // This rank's share of the missing tiles.
    std::vector<std::size_t> ownMissing(const PlannedTiles& tiles) const {
        std::vector<std::size_t> own = shareOf(tiles, [&](std::size_t tile) {
            return !std::filesystem::exists(folder_.record(tiles.tiling.place(tile)));
        });
        ranks_.wait();  // else a record of a fast rank would be missed here
        return own;
    }

    // Some tiles, the largest first, dealt to all ranks in turn.
    template <class Wanted>
    std::vector<std::size_t> shareOf(const PlannedTiles& tiles, const Wanted& wanted) const {
        std::vector<std::size_t> all, own;
        for (std::size_t tile = 0; tile < tiles.size(); ++tile)
            if (wanted(tile)) all.push_back(tile);
        std::stable_sort(all.begin(), all.end(),
                         [&](std::size_t a, std::size_t b) { return tiles.need(a) > tiles.need(b); });
        for (std::size_t i = std::size_t(ranks_.rank); i < all.size(); i += std::size_t(ranks_.count))
            own.push_back(all[i]);
        return own;
    }

    // Completes the manifest, or plans the tiles anew if their counts show that the signs are not those of build().
    void finish(const PlannedTiles& tiles) {
        std::vector<Json> records;
        std::vector<SignCounts> counts;
        for (std::size_t tile = 0; tile < tiles.size(); ++tile) {
            records.push_back(readRecord(folder_.record(tiles.tiling.place(tile))));
            counts.push_back(signCounts(records.back().at("signs")));
        }
        const PlannedSigns& signs = tiles.plan.signs();
        if (signs.signs.check == NormalsCheck::count)
            if (const SignCounts sum = sumOf(counts); judge(sum) != SignVerdict::right)
                return planner_->planAgain(tiles, sum);
        if (std::all_of(records.begin(), records.end(), [](const Json& r) { return r.at("activeVoxels") == 0; }))
            throw std::invalid_argument(noVoxelInBand(tiles.options));
        if (!signs.areByFlood()) joinSides(records, counts_);
        Json manifest = tiles.plan.manifest(records, ranks_.count);
        manifest["sum"]["estimatedBytes"] = std::uint64_t(std::max(tiles.largestNeed(), tiles.needOfRecords()));
        writeManifest(folder_.manifest(), std::move(manifest));
        folder_.clean();
    }

    BuildArguments a_;
    glm::ivec3 counts_;
    double budget_;  // [bytes]
    const Ranks& ranks_;
    TileFolder folder_;
    std::optional<TilePlanner> planner_;  // of the first rank
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
