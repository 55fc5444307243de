// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/field_update.h"
#include "sdf/base/method_names.h"
#include "sdf/base/openvdb.h"

#include <cstddef>
#include <string>

#include <bilayer/sdf/grids.h>
#include "sdf/base/stopwatch.h"
#include "sdf/fill/triangle_bins.h"
#include "sdf/grid/dirty_region.h"
#include "sdf/grid/field_filler.h"
#include "sdf/leaf/build_options.h"
#include "sdf/sign/sign_choice.h"

namespace bilayer::detail {
namespace {

/// Fraction of moved triangles above which the whole field is built: little would be left to copy.
constexpr double maxMoved = 0.5;

// Returns whether a full build would reproduce the old field's blocks where no triangle moved.
bool canCopy(FieldFiller& filler, const LevelSet& old) {
    const BuildOptions& options = filler.options();
    if (options.method != Method::exact || options.unite) return false;
    if (!enclosesSurface(options)) return false;
    if (options.sign == Sign::automatic && !balanced(filler.mesh(), &filler.progress())) return false;
    if (options.sign != Sign::automatic && options.sign != Sign::normals) return false;
    return hasCleanNormalSigns(old, options);
}

// Returns false if the signs then contradict each other.
bool fillMoved(FieldFiller& filler, const LevelSet& old, const Mesh& oldMesh, std::span<const std::uint32_t> moved) {
    Stopwatch watch;
    const BuildOptions& options = filler.options();
    const Mesh& mesh = filler.mesh();
    const double voxelsPerUnit = 1.0 / double(options.voxelSize);
    const float reach = reachOf(options, Sign::normals);
    // The order of triangles in a brick decides between nearest triangles at equal distance, so whole bricks are
    // filled.
    int side = blockSide;
    if (options.triangles) {
        side = brickSideFor(filler.box(), voxelsPerUnit, reach);
        if (side != brickSideFor(bounds(oldMesh), voxelsPerUnit, reach)) return false;
    }
    const DirtyRegion dirty(oldMesh, mesh, moved, voxelsPerUnit, reach, side);
    filler.times().prepare += watch.lap();
    const std::string reason = options.sign == Sign::automatic ? closedAndOriented : asRequested;
    filler.fillFrom(mesh, mesh, Sign::normals, reason, options.method, [&](MeshJob& job, Assembler& assembler) {
        job.wanted = [&](const glm::ivec3& first, int cube) { return dirty.any(first, cube); };
        assembler.copy(old.grids(), [&](const openvdb::Coord& block) {
            return !dirty.any({block.x(), block.y(), block.z()}, blockSide);
        });
    });
    return filler.signs().conflicts == 0 && filler.signs().name == nameOf(Sign::normals);
}

}  // namespace

bool updateField(FieldFiller& filler, const LevelSet& old, const Mesh& oldMesh, std::span<const std::uint32_t> moved) {
    validate(oldMesh);
    checkFieldOf(old, oldMesh, filler.options());
    checkMoved(oldMesh, filler.mesh(), moved);
    return double(moved.size()) <= maxMoved * double(filler.mesh().triangles.size()) && canCopy(filler, old) &&
           fillMoved(filler, old, oldMesh, moved);
}

}  // namespace bilayer::detail
