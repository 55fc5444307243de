// The build: tiles, bricks, blocks filled by some device, leaves into the tree, far signs.
#include "sdf/build.h"

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_reduce.h>
#include <oneapi/tbb/task_arena.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <string>

#include "sdf/assemble.h"
#include "sdf/band.h"
#include "sdf/blocks.h"
#include "sdf/double_layer.h"
#include "sdf/exact.h"
#include "sdf/flood.h"
#include "sdf/grids.h"
#include "sdf/orient.h"
#include "sdf/progress.h"
#include "sdf/pseudonormal.h"
#include "sdf/sign.h"
#include "sdf/winding.h"

namespace bilayer {
namespace {

/// Index coordinates stay well inside 32 bits, with room for the band around them.
constexpr double farthestIndex = 1e9;
/// OpenVDB takes a transform for singular below a determinant of 3e-15.
constexpr float smallestVoxel = 2e-5f;
/// Bricks along all axes together that the binning counts; a cube of 40,000 voxels a side.
constexpr double mostBricks = double(1u << 28);
/// Bytes that the build needs for a sample (its share of a tile and of the bins) and for a block, roughly.
constexpr double bytesPerSample = 120, bytesPerBlock = 2300;
/// What exact methods promise [voxels]; it is ten times what was ever seen.
constexpr float exactError = 1e-4f;
/// No point of a triangle is farther from a sample than this times the root of epsilon: samples stand no farther apart.
constexpr float coveringRadius = 3;
/// Room between the reach of a sample and what the band needs, against rounding [voxels].
constexpr float reachSlack = 1e-3f;

void require(bool condition, const char* option, const char* range, double value) {
    if (!condition) throw std::invalid_argument(fmt::format("{} must be {}, not {}", option, range, value));
}

void check(const BuildOptions& options) {
    const auto within = [](double value, double low, double high) { return value >= low && value <= high; };
    const DoubleLayerOptions& layers = options.doubleLayer;
    require(options.voxelSize > 0 && std::isnormal(options.voxelSize), "voxelSize", "a positive length",
            options.voxelSize);
    require(options.voxelSize >= smallestVoxel, "voxelSize", "at least 2e-5 (OpenVDB takes no smaller: scale the mesh)",
            options.voxelSize);
    require(options.exteriorWidth > 0 && options.exteriorWidth <= 1000, "exteriorWidth", "in (0, 1000] voxels",
            options.exteriorWidth);
    require(options.interiorWidth > 0 && options.interiorWidth <= 1000, "interiorWidth", "in (0, 1000] voxels",
            options.interiorWidth);
    require(layers.delta > 0 && layers.delta <= 4, "delta", "in (0, 4] voxels", layers.delta);
    require(within(layers.epsilon, 1e-4, 1e4), "epsilon", "in 1e-4..1e4 square voxels", layers.epsilon);
    require(within(layers.neighbourhood, 1, 64), "neighbourhood", "in 1..64", layers.neighbourhood);
    require(within(layers.maxSubdivision, 1, 1024), "maxSubdivision", "in 1..1024", layers.maxSubdivision);
    require(within(options.threads, 0, 4096), "threads", "in 0..4096", options.threads);
}

double areaOf(const Mesh& mesh) {
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, mesh.triangles.size(), 4096), 0.0,
        [&](const auto& range, double area) {
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                const glm::uvec3 t = mesh.triangles[i];
                const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
                area += 0.5 * glm::length(glm::cross(b - a, c - a));
            }
            return area;
        },
        std::plus<>());
}

// Refuses a voxel size that cannot work before anything is allocated for it.
void checkSize(const Mesh& mesh, const BuildOptions& options, float reach) {
    const Bounds box = bounds(mesh);
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
    if (bricks > mostBricks) refuse("its box would have more than 2^28 bricks of 64^3 voxels");
    const double voxelArea = areaOf(mesh) / (h * h);
    const double samples = voxelArea / double(options.doubleLayer.epsilon) + double(mesh.triangles.size());
    const double blocks = voxelArea / (blockSide * blockSide) * (1 + 2 * double(reach) / blockSide);
    const double bytes = samples * bytesPerSample + blocks * bytesPerBlock;
    const double memory = double(::sysconf(_SC_PHYS_PAGES)) * double(::sysconf(_SC_PAGESIZE));
    if (bytes > memory) refuse(fmt::format("it would need about {:.0f} GiB of memory", bytes / double(1 << 30)));
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
    std::size_t conflicts = 0;  // neighbours that contradict each other
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
    if (options.method != Method::doubleLayer) return exactError;
    // a sample of the inner or outer layer is delta from the surface, and the nearest one at most the covering radius
    // farther than that from the voxel's closest point; without gaps filled nothing bounds it
    const DoubleLayerOptions& layers = options.doubleLayer;
    if (!layers.fillGaps) return std::numeric_limits<float>::infinity();
    return std::max(2 * layers.delta, coveringRadius * std::sqrt(layers.epsilon));
}

const char* name(Method method) {
    switch (method) {
        case Method::exact:
            return "exact";
        case Method::doubleLayer:
            return "double-layer";
        case Method::pseudonormal:
            return "pseudonormal";
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
    grid.insertMeta(metadata::errorBound, openvdb::FloatMetadata(errorBound(options) * options.voxelSize));
    grid.insertMeta(metadata::meshHash, openvdb::Int64Metadata(std::int64_t(hash(mesh))));
    grid.insertMeta(metadata::interiorWidth, openvdb::FloatMetadata(options.interiorWidth * options.voxelSize));
}

// A build under way: what it works from, and what it has found.
class Build {
  public:
    Build(const Mesh& mesh, const BuildOptions& options, const BlockFiller& filler, BuildTimes& times)
        : mesh_(mesh), options_(options), filler_(filler), times_(times), progress_(options.progress) {}

    LevelSet run() {
        Stopwatch total;
        if (options_.method == Method::doubleLayer)
            fillLayers();
        else if (options_.sign == Sign::automatic)
            fillChosen();
        else
            fillAsAsked();
        Stopwatch part;
        if (distance_->empty() || distance_->activeVoxelCount() == 0)
            throw std::invalid_argument("no voxel lies within the band: the widths are too small for this voxel size");
        describe(*distance_, mesh_, options_, signs_);
        auto grids = std::make_shared<Grids>();
        grids->distance = distance_;
        if (triangle_) {
            // where a sign decided which of two widths holds, fewer voxels may be left
            triangle_->tree().topologyIntersection(distance_->tree());
            triangle_->setTransform(distance_->transformPtr());
            grids->triangle = triangle_;
        }
        LevelSet levelSet(std::move(grids));
        progress_.finish();
        times_.assemble += part.lap();
        times_.total = total.lap();
        return levelSet;
    }

  private:
    void fillLayers() {
        Stopwatch part;
        signs_ = {"layers", "the nearer of two layers tells the side", 0};
        const FillParameters parameters = fillParameters(options_);
        const Tiles tiles = makeTiles(mesh_, options_);
        if (tiles.tiles.empty()) throw std::invalid_argument("the mesh has no triangle with an area");
        times_.tiles += part.lap();
        const Bricks bricks = binBricks(tiles, parameters.reach);
        progress_.begin(bricks.count());
        Assembler assembler(bandOf(options_), options_.triangles);
        filler_.fill({tiles, bricks, parameters, [&](std::size_t, const FilledBlocks& blocks) {
                          assembler.take(blocks);
                          progress_.advance();
                      }});
        times_.fill += part.lap();
        finish(assembler);
    }

    // Picks a way, and another one where the first contradicts itself.
    void fillChosen() {
        Stopwatch part;
        SignChoice choice = chooseSign(mesh_);
        times_.tiles += part.lap();
        for (;;) {
            // kept over the next choice, which may be made from it
            const std::optional<Mesh> mended = std::move(choice.mended);
            const Mesh& mesh = mended ? *mended : mesh_;
            fill(mesh, choice.sign, choice.reason);
            if (choice.sign != Sign::normals || signs_.conflicts == 0) return;
            choice = chooseSignAfterConflict(mesh);
            if (!choice.mended && mended) choice.mended = *mended;
        }
    }

    // Normals are taken from a mesh that is mended, should it be inside out.
    void fillAsAsked() {
        fill(mesh_, options_.sign, "as asked for");
        if (options_.sign != Sign::normals || signs_.conflicts == 0) return;
        const Orientation orientation = orient(mesh_);
        if (orientation.turnedTriangles > 0)
            fill(orientation.mesh, Sign::normals,
                 fmt::format("as asked for, with {} triangles turned around", orientation.turnedTriangles));
    }

    void fill(const Mesh& mesh, Sign sign, const std::string& reason) {
        Stopwatch part;
        const bool byNormals = sign == Sign::normals;
        const float reach = reachOf(options_, sign);
        const BandWidths widths = bandOf(options_);
        Assembler assembler(byNormals ? widths : BandWidths{reach, reach, options_.voxelSize}, options_.triangles);
        const MeshJob job{mesh,      options_.voxelSize,
                          reach,     options_.triangles,
                          byNormals, [&](const FilledBlocks& blocks) { assembler.take(blocks); },
                          progress_};
        options_.method == Method::exact ? fillExact(job) : fillPseudonormal(job);
        times_.fill += part.lap();
        finish(assembler);
        if (sign == Sign::winding) signByWinding(*distance_, mesh, widths, balanced(mesh));
        if (sign == Sign::flood) signByFlood(*distance_, mesh, options_.gap, widths);
        signs_ = {name(sign), reason, byNormals ? countConflicts(*distance_) : 0};
        times_.assemble += part.lap();
    }

    void finish(Assembler& assembler) {
        Stopwatch part;
        distance_ = assembler.distances();
        distance_->setTransform(openvdb::math::Transform::createLinearTransform(options_.voxelSize));
        triangle_ = assembler.triangles();
        times_.assemble += part.lap();
    }

    const Mesh& mesh_;
    const BuildOptions& options_;
    const BlockFiller& filler_;
    BuildTimes& times_;
    Progress progress_;
    Signs signs_;
    openvdb::FloatGrid::Ptr distance_;
    openvdb::Int32Grid::Ptr triangle_;
};

}  // namespace

LevelSet build(const Mesh& mesh, const BuildOptions& options, const BlockFiller* filler, BuildTimes* times) {
    check(options);
    if (filler && filler->backend != "tbb" && options.method != Method::doubleLayer)
        throw std::invalid_argument(fmt::format("the {} back end has no method {}: it has double-layer",
                                                filler->backend, name(options.method)));
    validate(mesh);
    checkSize(mesh, options, fillParameters(options).reach);
    openvdb::initialize();
    const BlockFiller tbb = tbbFiller();
    BuildTimes ignored;
    const auto work = [&] { return Build(mesh, options, filler ? *filler : tbb, times ? *times : ignored).run(); };
    if (options.threads == 0) return work();
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(options.threads));
    return tbb::task_arena(options.threads).execute(work);
}

LevelSet build(const Mesh& mesh, const BuildOptions& options, const BlockFiller& filler, BuildTimes* times) {
    return build(mesh, options, &filler, times);
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
