// The build: tiles, bricks, blocks filled by some device, leaves into the tree, far signs.
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

/// Index coordinates stay well inside 32 bits, with room for the band around them.
constexpr double farthestIndex = 1e9;
/// OpenVDB takes a transform for singular below a determinant of 3e-15.
constexpr float smallestVoxel = 2e-5f;
/// What a mesh with smaller voxels is scaled by, once or more often: metres become millimetres.
constexpr double unitStep = 1000;
/// Bricks of this side that a box may have; a cube of 40,000 voxels a side.
constexpr int brickSide = 64;  // [voxels]
constexpr double maxBricks = double(1u << 28);
/// Bytes that the build needs for a triangle (bins or hierarchy) and for a block, roughly.
constexpr double bytesPerTriangle = 60, bytesPerBlock = 2300;
/// Of more moved triangles than this part of all, the field is built in full: little would be left to copy.
constexpr double maxMoved = 0.5;
/// What exact methods promise [voxels]; it is ten times what was ever seen.
constexpr float exactError = 1e-4f;
/// Layers nearer to each other are told apart by rounding [voxels].
constexpr float minDelta = 0.1f;
/// No point of a triangle is farther from a sample than this times the root of epsilon: samples stand no farther apart.
constexpr float coveringRadius = 3;
/// Room between the reach of a sample and what the band needs, against rounding [voxels].
constexpr float reachSlack = 1e-3f;

void require(bool condition, const char* option, const char* range, double value) {
    if (!condition) throw std::invalid_argument(fmt::format("{} must be {}, not {}", option, range, value));
}

void checkWidth(const char* option, float voxels, float voxelSize) {
    require(voxels > 0 && voxels <= 1000, option, "in (0, 1000] voxels", voxels);
    // [m]; the field's background
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
    // false for NaN, and in floats: 1e-4f is no less than itself
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

// The same options with the widths in voxels.
BuildOptions inVoxels(BuildOptions options) {
    if (options.bandUnit == BandUnit::world) {
        require(options.voxelSize > 0, "voxelSize", "a positive length", options.voxelSize);
        options.exteriorWidth /= options.voxelSize;
        options.interiorWidth /= options.voxelSize;
        options.bandUnit = BandUnit::voxels;
    }
    return options;
}

// What one pass over the triangles tells.
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

// Blocks that the band meets, roughly: as many as fill the space near the surface or, where that folds over itself,
// near its box.
double countBlocks(const Bounds& box, double area, double h, double reach) {
    const double pi = glm::pi<double>(), r = reach + 0.5 * blockSide;
    const glm::dvec3 s = glm::dvec3(box.size()) / h;
    const double aroundSurface = 2 * r * area + 8 * pi / 3 * r * r * r;
    const double aroundBox = s.x * s.y * s.z + 2 * r * (s.x * s.y + s.y * s.z + s.z * s.x) +
                             pi * r * r * (s.x + s.y + s.z) + 4 * pi / 3 * r * r * r;
    return std::min(aroundSurface, aroundBox) / blockVoxels;
}

// Refuses what cannot work before anything is allocated for it.
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

// A sample must reach every voxel whose distance it may decide: a voxel of the band is nearer than the width plus delta
// to its layer's sample, and that sample is delta from the point of the surface that the neighbourhood is centred on.
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
    // Seconds since the last call, or since construction.
    double lap() {
        const auto now = std::chrono::steady_clock::now();
        return std::chrono::duration<double>(now - std::exchange(last_, now)).count();
    }

  private:
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

// How a field got its signs.
struct Signs {
    std::string name, reason;
    std::size_t conflicts = 0;  // voxels on both sides, and neighbours that contradict each other
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

// Voxels up to a voxel away are measured even for thinner bands: their signs carry over to all others by links. A flood
// wants to know where a ball of the gap's width fits.
float reachOf(const BuildOptions& options, Sign sign) {
    const float ball = sign == Sign::flood ? options.gap / 2 + 1 : 1;
    return std::max({options.exteriorWidth, options.interiorWidth, ball}) + reachSlack;
}

// What the distances may be off by [voxels].
float errorBound(const BuildOptions& options) {
    if (options.method == Method::prism) return std::numeric_limits<float>::infinity();  // where prisms leave gaps
    if (options.method != Method::doubleLayer) return exactError;
    // a sample of the inner or outer layer is delta from the surface, and the nearest one at most the covering radius
    // farther than that from the voxel's closest point; without gaps filled nothing bounds it
    const DoubleLayerOptions& layers = options.doubleLayer;
    if (!layers.fillGaps) return std::numeric_limits<float>::infinity();
    return std::max(2 * layers.delta, coveringRadius * std::sqrt(layers.epsilon));
}

// Distances of blocks, negative where a field of the same surface is.
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

// A build under way: what it works from, and what it has found.
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
            // where a sign decided which of two widths holds, fewer voxels may be left
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

    // Throws if the old field cannot be one that the options ask for.
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

    // Whether blocks of the old field are what a full build would make of triangles that have not moved.
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
        // another bound than that of a build: distances were swept or rounded since
        return text(metadata::version) == BILAYER_VERSION &&
               old.errorBound() == errorBound(options_) * options_.voxelSize &&
               text(metadata::sign) == name(Sign::normals) && (reason == asAskedFor || reason == closedAndOriented) &&
               isNone(metadata::signConflicts) && isNone(metadata::signUndecided);
    }

    // Fills what the moved triangles reach and copies the rest. False if signs then contradict each other.
    bool fillMoved(const LevelSet& old, const Mesh& oldMesh, std::span<const std::uint32_t> moved) {
        Stopwatch part;
        const double voxelsPerUnit = 1.0 / double(options_.voxelSize);
        const float reach = reachOf(options_, Sign::normals);
        // which of two triangles at the same distance is the nearest goes by their order in a brick: bricks stay whole
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

    // Picks a way, and another one where the first contradicts itself. By normals the pseudonormal method takes the
    // sides that the exact one finds: each rounds in its own way which triangles are equally near, and would count its
    // own conflicts.
    void fillChosen() {
        Stopwatch part;
        SignChoice choice = chooseSign(mesh_, &progress_);
        if (choice.sign == Sign::normals && !choice.repaired && isKnownToIntersectItself())
            choice = chooseSignAfterConflict(mesh_, &progress_);
        times_.tiles += part.lap();
        for (;;) {
            // kept over the next choice, which may be made from it
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

    // Whether normals do not tell the sides: they contradict each other, or cancel out on faces back to back. Those of
    // other diagonals have no triangle in common, but winding numbers find nothing between them.
    bool contradictory(const Mesh& mesh) {
        if (signs_.conflicts > 0) return true;
        if (signs_.undecided == 0 || foldsBack(mesh, &progress_)) return false;
        return hasFacesBackToBack(mesh, &progress_) || chooseSignOfSolid(mesh, &progress_).sign == Sign::flood;
    }

    // Fills by the method asked for, with the sides of another field of the mesh.
    void fillWithSides(const openvdb::FloatGrid::ConstPtr& sides, const Mesh& mesh, const std::string& reason) {
        fillFrom(mesh, mesh, Sign::normals, reason, options_.method, [&](MeshJob& job, Assembler& assembler) {
            job.sign = false;
            job.sink = [this, &sides, &assembler](const FilledBlocks& blocks) {
                const std::vector<float> distances = withSides(*sides, blocks);
                take(assembler, {blocks.origins, distances, blocks.triangles});
            };
        });
    }

    // Normals are taken from a mesh that is repaired, should it be inside out.
    void fillAsAsked() {
        fill(mesh_, options_.sign, asAskedFor, options_.method);
        if (options_.sign != Sign::normals || signs_.conflicts == 0) return;
        const Orientation orientation = orient(mesh_, &progress_);
        if (orientation.turnedTriangles > 0)
            fill(orientation.mesh, Sign::normals,
                 fmt::format("as asked for, with {} triangles turned around", orientation.turnedTriangles),
                 options_.method);
    }

    // Bands wider than a voxel surround the surface: where it passes between two voxels, both are in the band.
    Assembler::Plain plain(Sign sign) const {
        const bool wide = std::min(options_.exteriorWidth, options_.interiorWidth) > 1 + reachSlack;
        return sign == Sign::normals && wide ? Assembler::Plain::drop : Assembler::Plain::keep;
    }

    // Returns by which sign.
    Sign fill(const Mesh& mesh, Sign sign, const std::string& reason, Method method) {
        if (options_.unite && sign != Sign::flood && fillUnion(mesh)) return Sign::winding;
        fillFrom(mesh, mesh, sign, reason, method);
        return sign;
    }

    // False if no wall is inside of the union, so that nothing was filled. What is filled is the union of what orient()
    // makes of the mesh, as outwardMesh() says.
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

    // Distances are to `mesh`, winding numbers are those of `solids`. `adapt` may change the job, and add leaves that
    // are known already.
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
        // triangles turned around, in a repaired mesh, have the same box
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

    // Normals of a balanced mesh that intersects itself may be wrong without a conflict: where the voxels between two
    // walls are all near both. Those nearer than a voxel are repaired. Farther ones may go on beyond the band.
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

    // Safe from any thread.
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
