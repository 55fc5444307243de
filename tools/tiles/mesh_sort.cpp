// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/mesh_sort.h"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>
#include <vector>

#include "sdf/base/stopwatch.h"
#include "sdf/leaf/build_options.h"
#include "sdf/tiles/tile_sort.h"
#include "tools/mesh_file.h"
#include "tools/tiles/tile_plan.h"

namespace bilayer::tools {

using namespace bilayer::detail;
namespace {

constexpr double bytesPerMib = 1 << 20;
/// Memory per triangle to orient a mesh, and to choose its sign by winding numbers [bytes]. Meshes of 1.2 and 1.4
/// million triangles took 140 and 120.
constexpr double bytesPerOriented = 250;

}  // namespace

void MeshSort::run(const Json& identity, int round, const PlannedSigns* known) {
    const Stopwatch watch;
    const SignedSource mesh = open(round);  // may throw; the existing plan then stays
    const MeshFacts& facts = mesh.source->facts();
    const float side = facts.box.longestSide();
    setSizes(a_, a_.resolutionGiven->count() ? side / a_.resolution : a_.options.voxelSize);
    Tiling tiling(facts.box, optionsWith(a_.options, mesh.signs), counts_);
    folder_.create();
    // before the plan: a plan without some of its tiles can be resumed
    for (std::size_t tile = 0; round > 0 && !known && tile < tiling.size(); ++tile) folder_.remove(tiling.place(tile));
    if (!known) folder_.removeRecords();  // of a plan that is lost
    folder_.removePlan();
    const auto fileOf = [&](std::size_t tile) { return folder_.triangles(tiling.place(tile)); };
    const std::vector<TileLoad> loads = sortTriangles(*mesh.source, tiling, a_.options.voxelSize, fileOf);
    const Json sorting{{"seconds", watch.seconds()}, {"peakRssBytes", peakMemory()}, {"streamed", facts.hash == 0}};
    Json signs;
    if (!hasOwnSigns(a_.options.method)) signs = toJson(known ? *known : PlannedSigns{mesh.signs, round});
    writeRecord(folder_.plan(), TilePlan::toJson(identity, facts, a_.options.voxelSize, signs, loads, sorting));
}

// Reads the mesh whole if it fits, since its hash is then known.
SignedSource MeshSort::open(int round) const {
    const double whole = bytesToRead(a_.mesh);
    try {
        if (whole <= budget_) {
            Mesh mesh = readMesh(a_.mesh);
            const std::size_t triangles = mesh.triangles.size();
            return decideSigns(std::move(mesh), a_.options, round, [&] { requireRoomToOrient(triangles, whole); });
        }
        if (auto source = trianglesOfFile(a_.mesh)) return decideSigns(std::move(source), a_.options, round);
    } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(fmt::format("{}: {}", a_.mesh.string(), error.what()));
    }
    throw std::runtime_error(fmt::format(
        "{}: reading it whole needs about {:.0f} MiB, and {:.0f} MiB are given; a binary STL file, or a binary PLY "
        "file of nothing but vertices with float coordinates and triangles, is not read whole",
        a_.mesh.string(), whole / bytesPerMib, budget_ / bytesPerMib));
}

void MeshSort::requireRoomToOrient(std::size_t triangles, double whole) const {
    const double need = whole + double(triangles) * bytesPerOriented;
    if (need <= budget_) return;
    throw std::runtime_error(
        fmt::format("{}: the sign auto must orient this mesh, which needs about {:.0f} MiB, and {:.0f} MiB are given; "
                    "allow more, or take another sign",
                    a_.mesh.string(), need / bytesPerMib, budget_ / bytesPerMib));
}

}  // namespace bilayer::tools
