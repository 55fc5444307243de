// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/field_filler.h"

#include <fmt/format.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/inspect.h>
#include "sdf/base/method_names.h"
#include "sdf/base/openvdb.h"
#include "sdf/fill/double_layer.h"
#include "sdf/fill/exact.h"
#include "sdf/fill/pseudonormal.h"
#include "sdf/grid/part_signs.h"
#include "sdf/leaf/build_options.h"
#include "sdf/mesh/orient.h"
#include "sdf/mesh/unite.h"
#include "sdf/sign/flood.h"
#include "sdf/sign/sign_choice.h"
#include "sdf/sign/sign_repair.h"
#include "sdf/sign/winding.h"

namespace bilayer::detail {
namespace {

// Returns the distances of blocks, negated where another field of the same surface is negative.
std::vector<float> withSides(const openvdb::FloatGrid& sides, const FilledBlocks& blocks) {
    std::vector<float> distances(blocks.distances.begin(), blocks.distances.end());
    const auto values = sides.getConstAccessor();
    for (std::size_t i = 0; i < distances.size(); ++i) {
        const glm::ivec3& block = blocks.origins[i / blockVoxels];
        const int voxel = int(i % blockVoxels);
        const openvdb::Coord at(block.x + voxel / 64, block.y + voxel / 8 % 8, block.z + voxel % 8);
        if (values.getValue(at) < 0) distances[i] = -distances[i];
    }
    return distances;
}

Assembler::Plain plainBlocks(const BuildOptions& options, Sign sign) {
    return sign == Sign::normals && enclosesSurface(options) ? Assembler::Plain::drop : Assembler::Plain::keep;
}

void makePositive(openvdb::FloatGrid& distance) {
    openvdb::tree::LeafManager<openvdb::FloatTree> leaves(distance.tree());
    leaves.foreach ([](auto& leaf, std::size_t) {
        float* values = leaf.buffer().data();
        std::transform(values, values + blockVoxels, values, [](float value) { return std::abs(value); });
    });
}

// Maximum distance of a corrected voxel from the surface [m].
float repairLimit(const BuildOptions& options) {
    return enclosesSurface(options) ? options.voxelSize : 0;
}

// The normals of a balanced mesh that self-intersects can be wrong without a conflict, where two walls are near all
// voxels between them. Signs of voxels within one voxel of the surface are corrected. Farther wrong regions may extend
// beyond the band.
void repair(openvdb::FloatGrid& distance, const Mesh& mesh, const BuildOptions& options, Progress& progress,
            FieldSigns& signs) {
    const SignRepair repair = repairSigns(distance, mesh, repairLimit(options), &progress);
    signs.conflicts += repair.refused;
    if (repair.repaired == 0) return;
    signs.name = nameOf(Sign::winding);
    signs.reason = repairedReason(signs.reason, repair.repaired);
}

}  // namespace

FieldFiller::FieldFiller(const Mesh& mesh, const BuildOptions& options, const DeviceFiller* device,
                         const FieldPart* part)
    : mesh_(mesh), options_(options), device_(device), part_(part), progress_(options.progress) {
    progress_.poll();
    validate(mesh_);
    progress_.poll();
    extent_ = extentOf(mesh_);
    const bool layers = options_.method == Method::doubleLayer;
    checkSize(mesh_, extent_, options_, layers ? fillParameters(options_).reach : reachOf(options_, options_.sign));
    if (part_) extent_.box = part_->mesh;
    progress_.poll();
}

void FieldFiller::fillWithOwnSigns() {
    Stopwatch watch;
    const bool prism = options_.method == Method::prism;
    if (prism)
        field_.signs = {prismSigns, "the side of the nearest triangle whose prism holds the voxel"};
    else
        field_.signs = {layerSigns, "the nearer of two layers decides the side"};
    FillParameters parameters = fillParameters(options_);
    if (prism) parameters.reach = reachOf(options_, Sign::normals);
    Assembler assembler(bandOf(options_), options_.triangles, Assembler::Plain::keep, progress_, part_);
    Counts counts;
    const MeshJob job = jobFor(mesh_, parameters.reach, true, assembler, counts);
    if (device_)
        times_.device += device_->fill({job, options_, extent_.box, parameters});
    else
        fillDoubleLayer(job, extent_.box, options_.doubleLayer, parameters);
    times_.fill += watch.lap();
    field_.signs.undecided = counts.undecided;
    field_.join(assembler, options_.voxelSize);
    if (part_) field_.trim(*part_);
    times_.assemble += watch.lap();
}

Sign FieldFiller::fill(const Mesh& mesh, Sign sign, const std::string& reason, Method method) {
    if (options_.unite && sign != Sign::flood && fillUnion(mesh)) return Sign::winding;
    fillFrom(mesh, mesh, sign, reason, method);
    return sign;
}

// Fills the union of the mesh after orient(), as outwardMesh() documents. Returns false and fills nothing if no wall
// lies inside the union.
bool FieldFiller::fillUnion(const Mesh& mesh) {
    Stopwatch watch;
    UnionSurface united = unite(mesh, &progress_);
    if (!united.changed()) return false;
    const Orientation solids = orient(mesh, &progress_);
    if (solids.flippedTriangles > 0) united = unite(solids.mesh, &progress_);
    times_.prepare += watch.lap();
    fillFrom(united.mesh, solids.mesh, Sign::winding, unionReason(united), options_.method);
    return true;
}

void FieldFiller::fillFrom(const Mesh& mesh, const Mesh& solids, Sign sign, const std::string& reason, Method method,
                           const Adapt& adapt) {
    Stopwatch watch;
    const bool byNormals = sign == Sign::normals;
    const float reach = reachOf(options_, sign);
    const BandWidths widths = bandOf(options_);
    Assembler assembler(byNormals ? widths : BandWidths{reach, reach, options_.voxelSize}, options_.triangles,
                        plainBlocks(options_, sign), progress_, part_);
    Counts counts;
    MeshJob job = jobFor(mesh, reach, byNormals, assembler, counts);
    if (adapt) adapt(job, assembler);
    // Flipping triangles does not change the bounding box.
    if (device_)
        times_.device += device_->fill({job, options_, extent_.box, {}});
    else if (method == Method::exact)
        fillExact(job, extent_.box);
    else
        fillPseudonormal(job);
    times_.fill += watch.lap();
    field_.join(assembler, options_.voxelSize);
    progress_.poll();
    if (sign == Sign::winding && part_)
        signPartByWinding(*field_.distance, mesh, widths, *part_, enclosesSurface(options_), progress_);
    else if (sign == Sign::winding)
        signByWinding(*field_.distance, solids, widths, balanced(solids, &progress_), &progress_);
    if (sign == Sign::flood && !part_) signByFlood(*field_.distance, mesh, options_.gapVoxels, widths, &progress_);
    if (byNormals) counts.conflicts += assembler.conflicts(*field_.distance);
    field_.signs = {nameOf(sign), reason, counts.conflicts, counts.undecided};
    if (byNormals && part_ && part_->signs.check != NormalsCheck::none)
        field_.part.compared = comparePart(*field_.distance, mesh, *part_, repairLimit(options_), progress_);
    if (part_ && !part_->signs.name.empty()) field_.signs.name = part_->signs.name;
    const bool isKnownToBeClean = options_.inspected && options_.inspected->selfIntersections == 0;
    if (byNormals && !part_ && options_.sign == Sign::automatic && field_.signs.conflicts == 0 && !isKnownToBeClean)
        repair(*field_.distance, mesh, options_, progress_, field_.signs);
    if (part_) field_.trim(*part_);
    times_.assemble += watch.lap();
}

// A job that fills the part, or the whole field, into an assembler.
MeshJob FieldFiller::jobFor(const Mesh& mesh, float reach, bool sign, Assembler& assembler, Counts& counts) {
    MeshJob job{.mesh = mesh,
                .voxelSize = options_.voxelSize,
                .reach = reach,
                .triangles = options_.triangles,
                .sign = sign,
                .sink = [this, &assembler](const FilledBlocks& blocks) { take(assembler, blocks); },
                .progress = progress_,
                .undecided = &counts.undecided,
                .conflicts = &counts.conflicts};
    if (!part_) return job;
    job.isPart = true;
    job.wanted = [box = part_->filled()](const glm::ivec3& first, int side) { return box.overlaps(first, side); };
    return job;
}

// A second field of the mesh gives the signs: the one that was filled last.
void FieldFiller::fillWithSidesOfLast(const Mesh& mesh, const std::string& reason) {
    const openvdb::FloatGrid::ConstPtr sides = field_.distance;
    const FieldSigns signs = field_.signs;
    fillFrom(mesh, mesh, Sign::normals, reason, options_.method, [&](MeshJob& job, Assembler& assembler) {
        job.sign = false;
        job.sink = [this, &sides, &assembler](const FilledBlocks& blocks) {
            const std::vector<float> distances = withSides(*sides, blocks);
            take(assembler, {blocks.origins, distances, blocks.triangles});
        };
    });
    field_.signs = signs;
}

// With equal widths on both sides, the active voxels do not depend on the signs. The sides of a closed mesh follow from
// its triangles alone. A device that keeps the field leaves no block here.
bool FieldFiller::signAgainByWinding(const Mesh& mesh, const std::string& reason) {
    Stopwatch watch;
    const BandWidths widths = bandOf(options_);
    const bool isComplete =
        filledBlocks_ > 0 && enclosesSurface(options_) && widths.exterior == widths.interior && !part_;
    if (!isComplete || options_.unite || !balanced(mesh, &progress_)) return false;
    makePositive(*field_.distance);
    signByWinding(*field_.distance, mesh, widths, true, &progress_);
    field_.signs = {nameOf(Sign::winding), reason, 0, 0};
    times_.assemble += watch.lap();
    return true;
}

void FieldFiller::take(Assembler& assembler, const FilledBlocks& blocks) {
    filledBlocks_ += blocks.origins.size();
    assembler.take(blocks);
}

LevelSet FieldFiller::levelSet() {
    if (field_.distance->empty() || field_.distance->activeVoxelCount() == 0)
        throw std::invalid_argument(noVoxelInBand(options_));
    progress_.poll();
    return LevelSet(grids());
}

FilledPart FieldFiller::part() {
    FilledPart filled = field_.part;
    filled.grids = grids();
    filled.conflicts = field_.signs.conflicts;
    return filled;
}

std::shared_ptr<Grids> FieldFiller::grids() {
    Stopwatch watch;
    const std::shared_ptr<Grids> grids = field_.finish(mesh_, part_ ? part_->meshHash : hash(mesh_), options_);
    progress_.finish();
    times_.assemble += watch.lap();
    times_.total = total_.lap();
    times_.filledBlocks = filledBlocks_;
    grids->times = times_;
    return grids;
}

}  // namespace bilayer::detail
