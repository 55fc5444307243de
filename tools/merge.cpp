// SPDX-License-Identifier: Apache-2.0
// `bilayer merge`: the tiles of a field become one .vdb file.
// Tested by tests/tools/tiles.cpp through the program.
#include <fmt/format.h>

#include <memory>

#include <bilayer/sdf/vdb_io.h>
#include "sdf/grid/vdb_grids.h"
#include "sdf/tiles/tile_manifest.h"
#include "sdf/tiles/tile_merge.h"
#include "tools/commands.h"
#include "tools/output.h"

namespace bilayer::tools {

using namespace bilayer::detail;
namespace {

struct Arguments {
    std::filesystem::path folder, output;
    bool json = false;
};

void run(const Arguments& a) {
    requireWritable(a.output);
    const Stopwatch watch;
    TileMerger merger;
    for (const TileRecord& tile : readTileManifest(a.folder).tiles) {
        if (tile.field.path.empty()) continue;
        tile.field.requireIntact();
        merger.add(*readGrids(tile.field.path));
    }
    const LevelSet field = merger.merged();
    writeVdb(a.output, field);
    if (a.json) {
        Json json{{"output", a.output.string()}, {"activeVoxels", field.activeVoxels()},
                  {"leaves", field.leaves()},    {"memoryBytes", field.memoryBytes()},
                  {"seconds", watch.seconds()},  {"peakRssBytes", peakMemory()}};
        json.update(provenance(field));
        return print(json);
    }
    Table table(a.output.string());
    addRows(table, field);
    table.row("merged in", fmt::format("{:.3f} s", watch.seconds()));
    table.row("peak memory", bytes(peakMemory()));
    table.print();
}

}  // namespace

void addMerge(CLI::App& app) {
    auto* command = app.add_subcommand("merge", "Join the tiles of a field into one file");
    const auto a = std::make_shared<Arguments>();
    command->add_option("folder", a->folder, "what build --tiles wrote")->required();
    command->add_option("-o,--output", a->output, "the .vdb file")->required();
    command->add_flag("--json", a->json, "print one JSON object");
    command->callback([a] { run(*a); });
}

}  // namespace bilayer::tools
