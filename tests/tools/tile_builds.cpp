// SPDX-License-Identifier: Apache-2.0
#include "tests/tools/tile_builds.h"

#include <catch2/catch.hpp>

#include <bilayer/sdf/vdb_io.h>
#include "tests/support/same_fields.h"
#include "tests/support/support.h"

namespace bilayer::test {

namespace fs = std::filesystem;

Words tiled(const fs::path& mesh, const fs::path& folder, const std::string& tiles, const Words& options) {
    return joined({"build", mesh.string(), "-o", folder.string(), "--tiles", tiles, "--json"}, options);
}

LevelSet merged(const fs::path& folder) {
    const fs::path file = folder.string() + ".vdb";
    fs::remove(file);
    built({"merge", folder.string(), "-o", file.string(), "--json"});
    return readVdb(file);
}

LevelSet inOnePiece(const fs::path& mesh, const Words& options) {
    const fs::path file = scratch("whole.vdb");
    built(joined({"build", mesh.string(), "-o", file.string(), "--json"}, options));
    return readVdb(file);
}

nlohmann::json sameInTiles(const fs::path& mesh, const std::string& tiles, const Words& options) {
    CAPTURE(mesh.string(), tiles);
    const fs::path folder = scratch("tiles" + tiles);
    fs::remove_all(folder);
    nlohmann::json manifest = built(tiled(mesh, folder, tiles, options));
    const LevelSet whole = inOnePiece(mesh, options);
    CHECK(sameFields(merged(folder), whole));
    CHECK(!fs::exists(folder / "work"));
    CHECK(manifest == nlohmann::json::parse(contents(folder / "manifest.json")));
    CHECK(manifest["signs"]["name"] == whole.sign());
    CHECK(manifest["signs"]["reason"] == whole.signReason());
    CHECK(manifest["sum"]["leaves"] == whole.leaves());
    CHECK(manifest["sum"]["activeVoxels"] == whole.activeVoxels());
    return manifest;
}

void checkRefusal(const Words& words, int status, const std::string& culprit) {
    const Result r = run(words);
    INFO(r.err);
    CHECK(r.status == status);
    CHECK(r.err.find(culprit) != std::string::npos);
}

}  // namespace bilayer::test
