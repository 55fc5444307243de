// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/tile_planner.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "sdf/io/content_hash.h"
#include "sdf/tiles/tile_manifest.h"
#include "sdf/tiles/tile_sort.h"
#include "tools/mesh_file.h"

namespace bilayer::tools {

using namespace bilayer::detail;
namespace {

constexpr double mib = 1 << 20;

}  // namespace

TilePlanner::TilePlanner(BuildArguments arguments, const glm::ivec3& counts, double budget, const TileFolder& folder)
    : a_(std::move(arguments)), counts_(counts), budget_(budget), folder_(folder) {
    std::error_code error;
    isNew_ = std::filesystem::create_directories(folder_.root(), error);
    if (error) throw std::runtime_error(fmt::format("{}: {}", folder_.root().string(), error.message()));
    lock_.emplace(folder_.root());
}

void TilePlanner::prepare() {
    try {
        planOrResume();
    } catch (...) {
        std::error_code error;
        if (isNew_) std::filesystem::remove(folder_.root(), error);  // unless it is not empty
        throw;
    }
}

void TilePlanner::planOrResume() {
    identity_ = identityOf(a_, counts_, hex(meshFileHash(a_.mesh)));
    if (std::filesystem::exists(folder_.manifest())) {
        readTileManifest(folder_.root());  // may throw
        const Json manifest = readJson(folder_.manifest());
        requireSame(manifest);
        if (!reopenIfDamaged(manifest)) return;
    } else if (!resume()) {
        sort().run(identity_, 0);
    }
    requireMemory();
}

void TilePlanner::requireSame(const Json& made) const {
    if (made.at("field") != identity_)
        throw std::runtime_error(fmt::format(
            "{}: holds tiles of another mesh or with other options: choose another folder", a_.output.string()));
}

/// Returns whether there is a plan to go on with. Sorts the triangles again if some that are needed are damaged.
bool TilePlanner::resume() {
    if (!std::filesystem::exists(folder_.plan())) return false;
    const Json made = readPlanOfKilledRun(folder_);
    if (made.at("field") != identity_ && !folder_.hasTiles()) {
        folder_.clean();
        return false;
    }
    requireSame(made);
    const PlannedTiles tiles = plannedTiles(TilePlan(made), a_, counts_);
    const PlannedSigns& signs = tiles.plan.signs();
    bool isSorted = true;
    for (std::size_t tile = 0; tile < tiles.size(); ++tile) {
        const glm::ivec3 place = tiles.tiling.place(tile);
        const bool isDone = isFinished(folder_, place);
        if (!isDone) std::filesystem::remove(folder_.record(place));
        if (!isDone || signs.needSums() || signs.areByFlood())
            isSorted = isSorted && hasTileTriangles(folder_.triangles(place), tiles.load(tile));
    }
    if (!isSorted) sort().run(identity_, signs.round, &signs);
    return true;
}

/// Returns whether a tile is damaged. If one is, the manifest becomes a plan and the records of those that are intact.
bool TilePlanner::reopenIfDamaged(const Json& manifest) {
    const Json& records = manifest.at("tiles");
    const auto intact = [&](const Json& record) { return isIntact(folder_, record); };
    if (std::all_of(records.begin(), records.end(), intact)) {
        folder_.clean();  // a run that was killed at its end has not done so
        return false;
    }
    const PlannedSigns signs = plannedSigns(manifest.at("signs"));
    folder_.create();
    folder_.removeRecords();
    for (const Json& record : records)
        if (intact(record)) writeRecord(folder_.record(placeOf(record)), record);
    sort().run(identity_, signs.round, &signs);
    std::filesystem::remove(folder_.manifest());
    return true;
}

/// Prints the memory that a tile needs. Throws, before any tile is built, if there is not so much.
void TilePlanner::requireMemory() const {
    const PlannedTiles tiles = this->tiles();
    const double largest = tiles.largestNeed(), join = tiles.needOfRecords();
    if (largest > budget_)
        throw std::runtime_error(
            fmt::format("the largest of {} tiles needs about {:.0f} MiB, and {:.0f} MiB are given: take more tiles",
                        tiles.size(), largest / mib, budget_ / mib));
    if (join > budget_)
        throw std::runtime_error(fmt::format(
            "the records of {} tiles need about {:.0f} MiB, and {:.0f} MiB are given: take fewer, larger tiles",
            tiles.size(), join / mib, budget_ / mib));
    if (a_.json) return;
    fmt::print("each of {} tiles within {:.0f} MiB\n", tiles.size(), std::max(largest, join) / mib);
    std::fflush(stdout);
}

void TilePlanner::planAgain(const PlannedTiles& tiles, const SignCounts& sum) {
    const PlannedSigns& signs = tiles.plan.signs();
    const bool isConflict = judge(sum) == SignVerdict::conflict;
    if (isConflict) {
        sort().run(identity_, signs.round + 1);
    } else {
        for (std::size_t tile = 0; tile < tiles.size(); ++tile) folder_.remove(tiles.tiling.place(tile));
        writeRecord(folder_.plan(), tiles.plan.with({corrected(signs.signs, sum), signs.round}));
    }
    const PlannedSigns planned = TilePlan(readRecord(folder_.plan())).signs();
    if (isConflict && planned.areByFlood()) requireMemory();  // a flood needs more than other signs
    if (a_.json) return;
    fmt::print("all tiles again: {}\n", planned.signs.reason);
    std::fflush(stdout);
}

}  // namespace bilayer::tools
