// The phases of a build: bin triangles into bricks, fill blocks on a device, assemble the tree, sign the voxels far
// from the surface.
#include <bilayer/sdf/build.h>

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_reduce.h>
#include <oneapi/tbb/task_arena.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/inspect.h>
#include "sdf/base/openvdb.h"
#include "sdf/base/physical_memory.h"
#include "sdf/base/progress.h"
#include "sdf/fill/double_layer.h"
#include "sdf/fill/exact.h"
#include "sdf/fill/pseudonormal.h"
#include "sdf/fill/triangle_bins.h"
#include "sdf/grid/assemble.h"
#include "sdf/grid/dirty_region.h"
#include "sdf/leaf/band.h"
#include "sdf/leaf/blocks.h"
#include "sdf/mesh/orient.h"
#include "sdf/mesh/unite.h"
#include "sdf/sign/flood.h"
#include "sdf/sign/sign_choice.h"
#include "sdf/sign/sign_repair.h"
#include "sdf/sign/winding.h"

namespace bilayer {

using namespace detail;

namespace {

/// Limit of index coordinates: well within 32 bits, with room for the band.
constexpr double farthestIndex = 1e9;
/// OpenVDB treats a transform with a determinant below 3e-15 as singular.
constexpr float smallestVoxel = 2e-5f;
/// Scale factor that the error for a small voxel size suggests, applied repeatedly: metres to millimetres.
constexpr double unitStep = 1000;
/// Maximum brick count of the mesh's box: a cube of 40,000 voxels a side.
constexpr int brickSide = 64;  // [voxels]
constexpr double maxBricks = double(1u << 28);
/// Approximate memory of a build per triangle (bins or hierarchy) and per block [bytes].
constexpr double bytesPerTriangle = 60, bytesPerBlock = 2300;
/// Fraction of moved triangles above which the whole field is built: little would be left to copy.
constexpr double maxMoved = 0.5;
/// Guaranteed error of exact distances [voxels]; ten times the largest observed error.
constexpr float exactError = 1e-4f;
/// Minimum layer distance: rounding makes closer layers indistinguishable [voxels].
constexpr float minDelta = 0.1f;
/// Maximum distance from a point of a triangle to its nearest sample, in units of sqrt(epsilon).
constexpr float coveringRadius = 3;
/// Margin of the sample reach against rounding [voxels].
constexpr float reachSlack = 1e-3f;

void require(bool condition, const char* option, const char* range, double value) {
    if (!condition) throw std::invalid_argument(fmt::format("{} must be {}, not {}", option, range, value));
}

void checkWidth(const char* option, float voxels, float voxelSize) {
    require(voxels > 0 && voxels <= 1000, option, "in (0, 1000] voxels", voxels);
    // Background of the field [m].
    const float width = voxels * voxelSize;
    require(std::isnormal(width), option, "a width that floats can hold", width);
}

bool hasOwnSigns(Method method) {
    return method == Method::doubleLayer || method == Method::prism;
}

void checkVoxelSize(float voxelSize) {
    if (voxelSize >= smallestVoxel) return;
    double scale = unitStep;
    while (scale * double(voxelSize) < double(smallestVoxel)) scale *= unitStep;
    throw std::invalid_argument(
        fmt::format("voxelSize {:g} is below {:g}, the smallest that OpenVDB takes: scale the mesh by {:g}{}, so that "
                    "voxels are {:g}",
                    voxelSize, smallestVoxel, scale, scale == unitStep ? " (from metres to millimetres)" : "",
                    scale * double(voxelSize)));
}

void check(const BuildOptions& options) {
    // Comparison in the type of the value, so that 1e-4f passes a limit of 1e-4f; false for NaN.
    const auto within = [](auto value, decltype(value) low, decltype(value) high) {
        return value >= low && value <= high;
    };
    const DoubleLayerOptions& layers = options.doubleLayer;
    require(options.voxelSize > 0 && std::isnormal(options.voxelSize), "voxelSize", "a positive length",
            options.voxelSize);
    checkVoxelSize(options.voxelSize);
    checkWidth("exteriorWidth", options.exteriorWidth, options.voxelSize);
    checkWidth("interiorWidth", options.interiorWidth, options.voxelSize);
    require(within(options.gap, 0, 100), "gap", "in 0..100 voxels", options.gap);
    require(layers.delta >= minDelta && layers.delta <= 4, "delta", "in [0.1, 4] voxels", layers.delta);
    require(within(layers.epsilon, 1e-4f, 1e4f), "epsilon", "in 1e-4..1e4 square voxels", layers.epsilon);
    require(within(layers.neighbourhood, 1, 64), "neighbourhood", "in 1..64", layers.neighbourhood);
    require(within(layers.maxSubdivision, 1, 1024), "maxSubdivision", "in 1..1024", layers.maxSubdivision);
    require(within(options.threads, 0, 4096), "threads", "in 0..4096", options.threads);
    if (options.unite && (hasOwnSigns(options.method) || options.sign == Sign::flood))
        throw std::invalid_argument(
            "unite needs the method exact or pseudonormal and a sign by normals or winding numbers");
}

// Returns the options with widths in voxels.
BuildOptions inVoxels(BuildOptions options) {
    if (options.bandUnit == BandUnit::world) {
        require(options.voxelSize > 0, "voxelSize", "a positive length", options.voxelSize);
        options.exteriorWidth /= options.voxelSize;
        options.interiorWidth /= options.voxelSize;
        options.bandUnit = BandUnit::voxels;
    }
    return options;
}

// Bounds and area of a mesh, from one pass over the triangles.
struct Survey {
    Bounds box;
    double area = 0;  // [m^2]
};

Survey survey(const Mesh& mesh) {
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, mesh.triangles.size(), 4096), Survey{},
        [&](const auto& range, Survey seen) {
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                const glm::uvec3 t = mesh.triangles[i];
                const glm::vec3 &a = mesh.points[t.x], &b = mesh.points[t.y], &c = mesh.points[t.z];
                for (const glm::vec3* p : {&a, &b, &c}) seen.box.add(*p);
                seen.area +=
                    0.5 * glm::length(glm::cross(glm::dvec3(b) - glm::dvec3(a), glm::dvec3(c) - glm::dvec3(a)));
            }
            return seen;
        },
        [](const Survey& a, const Survey& b) {
            return Survey{{glm::min(a.box.lower, b.box.lower), glm::max(a.box.upper, b.box.upper)}, a.area + b.area};
        });
}

// Estimates the count of blocks that the band meets. It is the volume near the surface or, for a surface that folds
// over itself, near its bounding box.
double countBlocks(const Bounds& box, double area, double h, double reach) {
    const double pi = glm::pi<double>(), r = reach + 0.5 * blockSide;
    const glm::dvec3 s = glm::dvec3(box.size()) / h;
    const double aroundSurface = 2 * r * area + 8 * pi / 3 * r * r * r;
    const double aroundBox = s.x * s.y * s.z + 2 * r * (s.x * s.y + s.y * s.z + s.z * s.x) +
                             pi * r * r * (s.x + s.y + s.z) + 4 * pi / 3 * r * r * r;
    return std::min(aroundSurface, aroundBox) / blockVoxels;
}

// Rejects a build that cannot succeed, before any allocation.
void checkSize(const Mesh& mesh, const Survey& seen, const BuildOptions& options, float reach) {
    const Bounds& box = seen.box;
    const double h = options.voxelSize;
    const auto refuse = [&](const std::string& why) {
        throw std::invalid_argument(fmt::format("voxelSize {:g} is too small for this mesh, {:g} voxels long: {}", h,
                                                double(box.longestSide()) / h, why));
    };
    double bricks = 1;
    for (int axis = 0; axis < 3; ++axis) {
        const double low = double(box.lower[axis]) / h, high = double(box.upper[axis]) / h;
        if (!(std::abs(low) < farthestIndex && std::abs(high) < farthestIndex))
            refuse("index coordinates would leave 32 bits");
        bricks *= (high - low + 2 * double(reach)) / brickSide + 2;
    }
    if (bricks > maxBricks) refuse("its box would have more than 2^28 bricks of 64^3 voxels");
    const double area = seen.area / (h * h);
    if (!(area > 0)) throw std::invalid_argument("the mesh has no triangle with an area");
    const double block = bytesPerBlock * (options.triangles ? 2 : 1);
    const double bytes =
        double(mesh.triangles.size()) * bytesPerTriangle + countBlocks(box, area, h, double(reach)) * block;
    const double memory = physicalMemory();
    if (bytes > memory)
        refuse(fmt::format("with its band it would need about {:.0f} GiB of memory", bytes / double(1 << 30)));
}

// A sample must reach every voxel whose distance it may determine. A voxel of the band is within width + delta of its
// layer's sample. That sample is delta from the surface point at the centre of its neighbourhood.
FillParameters fillParameters(const BuildOptions& options) {
    const DoubleLayerOptions& layers = options.doubleLayer;
    const float cube = float(layers.neighbourhood) + 0.5f;
    if (!layers.fillGaps)
        return {layers.delta, cube, std::numeric_limits<float>::infinity(), layers.neighbourhood, options.triangles};
    const float width = std::max(options.exteriorWidth, options.interiorWidth);
    const float reach = std::max(width + 2 * layers.delta, cube) + reachSlack;
    return {layers.delta, reach, reach - layers.delta, 0, options.triangles};
}

class Stopwatch {
  public:
    // Returns the seconds since the last call or since construction.
    double lap() {
        const auto now = std::chrono::steady_clock::now();
        return std::chrono::duration<double>(now - std::exchange(last_, now)).count();
    }

  private:
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

// The signs of a field and how they were found.
struct Signs {
    std::string name, reason;
    std::size_t conflicts = 0;  // voxels on both sides, and contradictory neighbour pairs
    std::size_t undecided = 0;  // voxels whose nearest normals cancel out
};

const char* name(Sign sign) {
    switch (sign) {
        case Sign::automatic:
            return "auto";
        case Sign::normals:
            return "normals";
        case Sign::winding:
            return "winding";
        case Sign::flood:
            return "flood";
    }
    return "";
}

BandWidths bandOf(const BuildOptions& options) {
    return {options.exteriorWidth, options.interiorWidth, options.voxelSize};
}

// Distances up to one voxel are computed even for thinner bands, because sign propagation needs them. A flood needs
// distances up to the radius of its ball.
float reachOf(const BuildOptions& options, Sign sign) {
    const float ball = sign == Sign::flood ? options.gap / 2 + 1 : 1;
    return std::max({options.exteriorWidth, options.interiorWidth, ball}) + reachSlack;
}

// Returns the maximum error of distances [voxels].
float errorBound(const BuildOptions& options) {
    if (options.method == Method::prism) return std::numeric_limits<float>::infinity();  // prisms leave gaps
    if (options.method != Method::doubleLayer) return exactError;
    // A layer sample is delta from the surface. The nearest sample is farther than the voxel's closest point by at most
    // the covering radius. If gaps are not filled, there is no bound.
    const DoubleLayerOptions& layers = options.doubleLayer;
    if (!layers.fillGaps) return std::numeric_limits<float>::infinity();
    return std::max(2 * layers.delta, coveringRadius * std::sqrt(layers.epsilon));
}

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

const char* name(Method method) {
    switch (method) {
        case Method::exact:
            return "exact";
        case Method::doubleLayer:
            return "double-layer";
        case Method::pseudonormal:
            return "pseudonormal";
        case Method::prism:
            return "prism";
    }
    return "";
}

void describe(openvdb::FloatGrid& grid, const Mesh& mesh, const BuildOptions& options, const Signs& signs) {
    grid.setTransform(openvdb::math::Transform::createLinearTransform(options.voxelSize));
    grid.setName("distance");
    grid.setGridClass(openvdb::GRID_LEVEL_SET);
    grid.setCreator("bilayer");
    grid.insertMeta(metadata::version, openvdb::StringMetadata(BILAYER_VERSION));
    grid.insertMeta(metadata::method, openvdb::StringMetadata(name(options.method)));
    grid.insertMeta(metadata::sign, openvdb::StringMetadata(signs.name));
    grid.insertMeta(metadata::signReason, openvdb::StringMetadata(signs.reason));
    grid.insertMeta(metadata::signConflicts, openvdb::Int64Metadata(std::int64_t(signs.conflicts)));
    grid.insertMeta(metadata::signUndecided, openvdb::Int64Metadata(std::int64_t(signs.undecided)));
    grid.insertMeta(metadata::errorBound, openvdb::FloatMetadata(errorBound(options) * options.voxelSize));
    grid.insertMeta(metadata::meshHash, openvdb::Int64Metadata(std::int64_t(hash(mesh))));
    grid.insertMeta(metadata::interiorWidth, openvdb::FloatMetadata(options.interiorWidth * options.voxelSize));
    const glm::dvec3& origin = mesh.origin;
    if (origin != glm::dvec3(0))
        grid.insertMeta(metadata::origin, openvdb::Vec3DMetadata({origin.x, origin.y, origin.z}));
}

// State of one build: its input and its results so far.
class Build {
  public:
    Build(const Mesh& mesh, const BuildOptions& options, const BlockFiller* filler, BuildTimes& times)
        : mesh_(mesh), options_(options), filler_(filler), times_(times), progress_(options.progress) {
        times_ = {};
    }

    LevelSet run() {
        fillAll();
        return levelSet();
    }

    void fillAll() {
        check();
        if (hasOwnSigns(options_.method))
            fillOwnSigns();
        else if (options_.sign == Sign::automatic)
            fillChosen();
        else
            fillAsAsked();
    }

    LevelSet runFrom(const LevelSet& old, const Mesh& oldMesh, std::span<const std::uint32_t> moved) {
        check();
        validate(oldMesh);
        checkOld(old, oldMesh);
        checkMoved(oldMesh, mesh_, moved);
        if (double(moved.size()) > maxMoved * double(mesh_.triangles.size()) || !canCopy(old) ||
            !fillMoved(old, oldMesh, moved))
            return run();
        return levelSet();
    }

  private:
    void check() {
        progress_.poll();
        validate(mesh_);
        progress_.poll();
        survey_ = survey(mesh_);
        const bool layers = options_.method == Method::doubleLayer;
        checkSize(mesh_, survey_, options_, layers ? fillParameters(options_).reach : reachOf(options_, options_.sign));
        progress_.poll();
    }

    LevelSet levelSet() {
        Stopwatch part;
        if (distance_->empty() || distance_->activeVoxelCount() == 0)
            throw std::invalid_argument("no voxel lies within the band: the widths are too small for this voxel size");
        progress_.poll();
        describe(*distance_, mesh_, options_, signs_);
        auto grids = std::make_shared<Grids>();
        grids->distance = distance_;
        if (triangle_) {
            // Voxels that were active for the wider of the two widths may lie outside the band on their final side.
            triangle_->tree().topologyIntersection(distance_->tree());
            triangle_->setTransform(distance_->transformPtr());
            grids->triangle = triangle_;
        }
        LevelSet result(std::move(grids));
        progress_.finish();
        times_.assemble += part.lap();
        times_.total = total_.lap();
        times_.filledBlocks = filledBlocks_;
        return result;
    }

    // Throws if the old field does not match the options.
    void checkOld(const LevelSet& old, const Mesh& oldMesh) const {
        const auto refuse = [](const std::string& why) { throw std::invalid_argument("the old field " + why); };
        const BandWidths widths = bandOf(options_);
        if (old.voxelSize() != options_.voxelSize) refuse(fmt::format("has voxels of {:g}", old.voxelSize()));
        if (old.exteriorWidth() != widths.exterior * widths.voxelSize ||
            old.interiorWidth() != widths.interior * widths.voxelSize)
            refuse(fmt::format("has a band {:g} wide outside, {:g} inside", old.exteriorWidth(), old.interiorWidth()));
        if (old.method() != name(options_.method)) refuse(fmt::format("is of the method '{}'", old.method()));
        if (options_.triangles && !old.grids().triangle) refuse("lacks the nearest triangles");
        if (old.meshHash() != hash(oldMesh)) refuse("is of another mesh");
    }

    // Returns whether a full build would reproduce the old field's blocks where no triangle moved.
    bool canCopy(const LevelSet& old) {
        if (options_.method != Method::exact || options_.unite) return false;
        if (plain(Sign::normals) == Assembler::Plain::keep) return false;
        if (options_.sign == Sign::automatic && !balanced(mesh_, &progress_)) return false;
        if (options_.sign != Sign::automatic && options_.sign != Sign::normals) return false;
        const openvdb::FloatGrid& grid = *old.grids().distance;
        const auto text = [&](const char* key) {
            const auto meta = grid.getMetadata<openvdb::StringMetadata>(key);
            return meta ? meta->value() : std::string();
        };
        const auto isNone = [&](const char* key) {
            const auto meta = grid.getMetadata<openvdb::Int64Metadata>(key);
            return meta && meta->value() == 0;
        };
        const std::string reason = text(metadata::signReason);
        // A different error bound shows that the distances were swept or rounded since the build.
        return text(metadata::version) == BILAYER_VERSION &&
               old.errorBound() == errorBound(options_) * options_.voxelSize &&
               text(metadata::sign) == name(Sign::normals) && (reason == asAskedFor || reason == closedAndOriented) &&
               isNone(metadata::signConflicts) && isNone(metadata::signUndecided);
    }

    // Fills the blocks that moved triangles reach, and copies the others. Returns false if the signs then contradict
    // each other.
    bool fillMoved(const LevelSet& old, const Mesh& oldMesh, std::span<const std::uint32_t> moved) {
        Stopwatch part;
        const double voxelsPerUnit = 1.0 / double(options_.voxelSize);
        const float reach = reachOf(options_, Sign::normals);
        // The order of triangles in a brick decides between nearest triangles at equal distance, so whole bricks are
        // filled.
        int side = blockSide;
        if (options_.triangles) {
            side = brickSideFor(survey_.box, voxelsPerUnit, reach);
            if (side != brickSideFor(bounds(oldMesh), voxelsPerUnit, reach)) return false;
        }
        const DirtyRegion touched(oldMesh, mesh_, moved, voxelsPerUnit, reach, side);
        times_.tiles += part.lap();
        const std::string reason = options_.sign == Sign::automatic ? closedAndOriented : asAskedFor;
        fillFrom(mesh_, mesh_, Sign::normals, reason, options_.method, [&](MeshJob& job, Assembler& assembler) {
            job.wanted = [&](const glm::ivec3& first, int cube) { return touched.any(first, cube); };
            assembler.copy(old.grids(), [&](const openvdb::Coord& block) {
                return !touched.any({block.x(), block.y(), block.z()}, blockSide);
            });
        });
        return signs_.conflicts == 0 && signs_.name == name(Sign::normals);
    }

    void fillOwnSigns() {
        Stopwatch part;
        const bool prism = options_.method == Method::prism;
        if (prism)
            signs_ = {"prisms", "the side of the nearest triangle whose prism holds the voxel"};
        else
            signs_ = {"layers", "the nearer of two layers tells the side"};
        FillParameters parameters = fillParameters(options_);
        if (prism) parameters.reach = reachOf(options_, Sign::normals);
        Assembler assembler(bandOf(options_), options_.triangles, Assembler::Plain::keep, progress_);
        const MeshJob job{mesh_,
                          options_.voxelSize,
                          parameters.reach,
                          options_.triangles,
                          true,
                          [&](const FilledBlocks& blocks) { take(assembler, blocks); },
                          progress_};
        if (filler_)
            filler_->fill({job, options_, survey_.box, parameters});
        else
            fillDoubleLayer(job, survey_.box, options_.doubleLayer, parameters);
        times_.fill += part.lap();
        finish(assembler);
        times_.assemble += part.lap();
    }

    // Selects a sign method, and another one if the first gives contradictions. With normals, the pseudonormal method
    // uses the signs of the exact method. The two methods round equal distances differently, so their conflict counts
    // would differ.
    void fillChosen() {
        Stopwatch part;
        SignChoice choice = chooseSign(mesh_, &progress_);
        if (choice.sign == Sign::normals && !choice.repaired && isKnownToIntersectItself())
            choice = chooseSignAfterConflict(mesh_, &progress_);
        times_.tiles += part.lap();
        for (;;) {
            // Kept alive during the next selection, which may use it.
            const std::optional<Mesh> repaired = std::move(choice.repaired);
            const Mesh& mesh = repaired ? *repaired : mesh_;
            const bool borrows = choice.sign == Sign::normals && options_.method == Method::pseudonormal;
            const Sign sign = fill(mesh, choice.sign, choice.reason, borrows ? Method::exact : options_.method);
            if (sign != Sign::normals || !contradictory(mesh)) {
                if (borrows && sign == Sign::normals) {
                    const Signs found = signs_;
                    fillWithSides(distance_, mesh, choice.reason);
                    signs_ = found;
                }
                return;
            }
            choice = chooseSignAfterConflict(mesh, &progress_);
            if (!choice.repaired && repaired) choice.repaired = *repaired;
        }
    }

    bool isKnownToIntersectItself() const { return options_.inspected && options_.inspected->selfIntersections > 0; }

    // Returns whether normals fail to give signs: they contradict each other, or cancel out on coincident faces with
    // opposite orientations. If such faces have different diagonals, they share no triangle, but winding numbers find
    // no volume between them.
    bool contradictory(const Mesh& mesh) {
        if (signs_.conflicts > 0) return true;
        if (signs_.undecided == 0 || foldsBack(mesh, &progress_)) return false;
        return hasFacesBackToBack(mesh, &progress_) || chooseSignOfSolid(mesh, &progress_).sign == Sign::flood;
    }

    // Fills by the requested method, with the signs of another field of the mesh.
    void fillWithSides(const openvdb::FloatGrid::ConstPtr& sides, const Mesh& mesh, const std::string& reason) {
        fillFrom(mesh, mesh, Sign::normals, reason, options_.method, [&](MeshJob& job, Assembler& assembler) {
            job.sign = false;
            job.sink = [this, &sides, &assembler](const FilledBlocks& blocks) {
                const std::vector<float> distances = withSides(*sides, blocks);
                take(assembler, {blocks.origins, distances, blocks.triangles});
            };
        });
    }

    // If the mesh is inside out, the normals of a repaired mesh are used.
    void fillAsAsked() {
        fill(mesh_, options_.sign, asAskedFor, options_.method);
        if (options_.sign != Sign::normals || signs_.conflicts == 0) return;
        const Orientation orientation = orient(mesh_, &progress_);
        if (orientation.turnedTriangles > 0)
            fill(orientation.mesh, Sign::normals,
                 fmt::format("as asked for, with {} triangles turned around", orientation.turnedTriangles),
                 options_.method);
    }

    // A band wider than one voxel encloses the surface: two neighbours on opposite sides are both in the band.
    Assembler::Plain plain(Sign sign) const {
        const bool wide = std::min(options_.exteriorWidth, options_.interiorWidth) > 1 + reachSlack;
        return sign == Sign::normals && wide ? Assembler::Plain::drop : Assembler::Plain::keep;
    }

    // Returns the sign method that was used.
    Sign fill(const Mesh& mesh, Sign sign, const std::string& reason, Method method) {
        if (options_.unite && sign != Sign::flood && fillUnion(mesh)) return Sign::winding;
        fillFrom(mesh, mesh, sign, reason, method);
        return sign;
    }

    // Fills the union of the mesh after orient(), as outwardMesh() documents. Returns false and fills nothing if no
    // wall lies inside the union.
    bool fillUnion(const Mesh& mesh) {
        Stopwatch part;
        UnionSurface united = unite(mesh, &progress_);
        if (!united.changed()) return false;
        const Orientation solids = orient(mesh, &progress_);
        if (solids.turnedTriangles > 0) united = unite(solids.mesh, &progress_);
        times_.tiles += part.lap();
        fillFrom(united.mesh, solids.mesh, Sign::winding, unionReason(united), options_.method);
        return true;
    }

    // Fills distances to `mesh`, with winding numbers of `solids`. `adapt` may change the job and add known leaves.
    void fillFrom(const Mesh& mesh, const Mesh& solids, Sign sign, const std::string& reason, Method method,
                  const std::function<void(MeshJob&, Assembler&)>& adapt = {}) {
        Stopwatch part;
        const bool byNormals = sign == Sign::normals;
        const float reach = reachOf(options_, sign);
        const BandWidths widths = bandOf(options_);
        Assembler assembler(byNormals ? widths : BandWidths{reach, reach, options_.voxelSize}, options_.triangles,
                            plain(sign), progress_);
        std::atomic<std::size_t> undecided = 0, conflicts = 0;
        MeshJob job{mesh,       options_.voxelSize,
                    reach,      options_.triangles,
                    byNormals,  [&](const FilledBlocks& blocks) { take(assembler, blocks); },
                    progress_,  {},
                    &undecided, &conflicts};
        if (adapt) adapt(job, assembler);
        // Flipping triangles does not change the bounding box.
        if (filler_)
            filler_->fill({job, options_, survey_.box, {}});
        else if (method == Method::exact)
            fillExact(job, survey_.box);
        else
            fillPseudonormal(job);
        times_.fill += part.lap();
        finish(assembler);
        progress_.poll();
        if (sign == Sign::winding) signByWinding(*distance_, solids, widths, balanced(solids, &progress_), &progress_);
        if (sign == Sign::flood) signByFlood(*distance_, mesh, options_.gap, widths, &progress_);
        if (byNormals) conflicts += assembler.conflicts(*distance_);
        signs_ = {name(sign), reason, conflicts, undecided};
        const bool isKnownToBeClean = options_.inspected && options_.inspected->selfIntersections == 0;
        if (byNormals && options_.sign == Sign::automatic && conflicts == 0 && !isKnownToBeClean) repair(mesh);
        times_.assemble += part.lap();
    }

    // The normals of a balanced mesh that self-intersects can be wrong without a conflict, where two walls are near all
    // voxels between them. Signs of voxels within one voxel of the surface are corrected. Farther wrong regions may
    // extend beyond the band.
    void repair(const Mesh& mesh) {
        const float limit = plain(Sign::normals) == Assembler::Plain::drop ? options_.voxelSize : 0;
        const SignRepair repair = repairSigns(*distance_, mesh, limit, &progress_);
        signs_.conflicts += repair.refused;
        if (repair.repaired == 0) return;
        signs_.name = name(Sign::winding);
        signs_.reason =
            fmt::format("{}, but the surface intersects itself; {} voxels have the side of their winding number",
                        signs_.reason, repair.repaired);
    }

    // Thread-safe.
    void take(Assembler& assembler, const FilledBlocks& blocks) {
        filledBlocks_ += blocks.origins.size();
        assembler.take(blocks);
    }

    void finish(Assembler& assembler) {
        distance_ = assembler.distances();
        distance_->setTransform(openvdb::math::Transform::createLinearTransform(options_.voxelSize));
        triangle_ = assembler.triangles();
    }

    const Mesh& mesh_;
    const BuildOptions& options_;
    const BlockFiller* filler_;
    BuildTimes& times_;
    Stopwatch total_;
    Progress progress_;
    Survey survey_;
    Signs signs_;
    std::atomic<std::size_t> filledBlocks_ = 0;
    openvdb::FloatGrid::Ptr distance_;
    openvdb::Int32Grid::Ptr triangle_;
};

void refusePrism(const BuildOptions& options) {
    if (options.method == Method::prism)
        throw std::invalid_argument("the method prism needs an OpenCL device: give build() its filler");
}

void refuseForDevices(const BuildOptions& options, const BlockFiller& filler) {
    if (options.method == Method::pseudonormal)
        throw std::invalid_argument(
            fmt::format("the {} back end has no method {}", filler.backend, name(options.method)));
}

template <class Work>
auto withThreads(int threads, const Work& work) {
    if (threads == 0) return work();
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
    return tbb::task_arena(threads).execute(work);
}

}  // namespace

LevelSet build(const Mesh& mesh, const BuildOptions& given, const BlockFiller* filler, BuildTimes* times) {
    const BuildOptions options = inVoxels(given);
    check(options);
    if (filler) refuseForDevices(options, *filler);
    if (!filler) refusePrism(options);
    openvdb::initialize();
    BuildTimes ignored;
    return withThreads(options.threads, [&] { return Build(mesh, options, filler, times ? *times : ignored).run(); });
}

LevelSet rebuild(const LevelSet& old, const Mesh& oldMesh, const Mesh& newMesh, std::span<const std::uint32_t> moved,
                 const BuildOptions& given, BuildTimes* times) {
    const BuildOptions options = inVoxels(given);
    check(options);
    refusePrism(options);
    BuildTimes ignored;
    return withThreads(options.threads, [&] {
        return Build(newMesh, options, nullptr, times ? *times : ignored).runFrom(old, oldMesh, moved);
    });
}

LevelSet build(const Mesh& mesh, const BuildOptions& options, const BlockFiller& filler, BuildTimes* times) {
    return build(mesh, options, &filler, times);
}

void detail::fillOnly(const Mesh& mesh, const BuildOptions& given, const BlockFiller& filler) {
    const BuildOptions options = inVoxels(given);
    check(options);
    refuseForDevices(options, filler);
    openvdb::initialize();
    BuildTimes ignored;
    withThreads(options.threads, [&] { Build(mesh, options, &filler, ignored).fillAll(); });
}

float voxelSizeFor(const Mesh& mesh, float resolution) {
    if (!(resolution > 0) || !std::isfinite(resolution))
        throw std::invalid_argument(fmt::format("the resolution must be positive, not {:g}", resolution));
    validate(mesh);
    const float side = bounds(mesh).longestSide();
    if (!(side > 0) || !std::isfinite(side))
        throw std::invalid_argument("the mesh has no extent, or one beyond floats");
    return side / resolution;
}

}  // namespace bilayer
