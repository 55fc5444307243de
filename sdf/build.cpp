// The build: tiles, bricks, blocks filled by some device, leaves into the tree, far signs.
#include "sdf/build.h"

#include <fmt/format.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_reduce.h>
#include <oneapi/tbb/task_arena.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <mutex>

#include "sdf/band.h"
#include "sdf/blocks.h"
#include "sdf/double_layer.h"
#include "sdf/exact.h"
#include "sdf/grids.h"

namespace bilayer {
namespace {

using Leaf = openvdb::FloatTree::LeafNodeType;
using TriangleLeaf = openvdb::Int32Tree::LeafNodeType;
static_assert(Leaf::DIM == blockSide);

/// Index coordinates stay well inside 32 bits, with room for the band around them.
constexpr double farthestIndex = 1e9;
/// OpenVDB takes a transform for singular below a determinant of 3e-15.
constexpr float smallestVoxel = 2e-5f;
/// Bricks along all axes together that the binning counts; a cube of 40,000 voxels a side.
constexpr double mostBricks = double(1u << 28);
/// Bytes that the build needs for a sample (its share of a tile and of the bins) and for a block, roughly.
constexpr double bytesPerSample = 120, bytesPerBlock = 2300;
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

// Reports progress from any thread, one at a time, and turns a false answer into Cancelled.
class Progress {
  public:
    Progress(const std::function<bool(float)>& report, std::size_t total) : report_(report), total_(total) {}
    void advance() {
        if (!report_) return;
        const std::lock_guard lock(mutex_);
        if (!report_(float(++done_) / float(total_))) throw Cancelled();
    }

  private:
    const std::function<bool(float)>& report_;
    std::size_t total_, done_ = 0;
    std::mutex mutex_;
};

template <class LeafType>
using PerThread = tbb::enumerable_thread_specific<std::vector<std::unique_ptr<LeafType>>>;

// Collects filled blocks as leaves and joins them into trees; where a leaf goes follows from its origin, so no thread
// changes the result.
class Assembler {
  public:
    explicit Assembler(const BuildOptions& options)
        : widths_{options.exteriorWidth, options.interiorWidth, options.voxelSize}, wantTriangles_(options.triangles) {}

    // Safe from any thread.
    void take(const FilledBlocks& blocks) {
        std::vector<std::unique_ptr<Leaf>>& leaves = leaves_.local();
        for (std::size_t b = 0; b < blocks.origins.size(); ++b) {
            const glm::ivec3 o = blocks.origins[b];
            auto leaf = std::make_unique<Leaf>(openvdb::PartialCreate(), openvdb::Coord(o.x, o.y, o.z));
            leaf->buffer().allocate();
            BlockMask active;
            if (!trimToBand(blocks.distances.data() + b * blockVoxels, widths_, leaf->buffer().data(), active))
                continue;
            Leaf::NodeMaskType mask;
            for (openvdb::Index word = 0; word < blockSide; ++word) mask.getWord<std::uint64_t>(word) = active[word];
            leaf->setValueMask(mask);
            if (wantTriangles_ && !mask.isOff())
                triangleLeaves_.local().push_back(triangleLeaf(blocks.triangles.data() + b * blockVoxels, *leaf));
            leaves.push_back(std::move(leaf));
        }
    }

    openvdb::FloatGrid::Ptr distances() {
        const float exterior = widths_.exterior * widths_.voxelSize, interior = -widths_.interior * widths_.voxelSize;
        auto grid = openvdb::FloatGrid::create(exterior);
        move(leaves_, grid->tree());
        // leaves carry their signs already: only tiles between them are flooded. Leaves that turn out to hold one far
        // value become tiles too.
        openvdb::tools::signedFloodFillWithValues(grid->tree(), exterior, interior, true, 1, 1);
        openvdb::tools::prune(grid->tree());
        grid->setName("distance");
        grid->setGridClass(openvdb::GRID_LEVEL_SET);
        return grid;
    }

    openvdb::Int32Grid::Ptr triangles() {
        if (!wantTriangles_) return nullptr;
        auto grid = openvdb::Int32Grid::create(-1);
        move(triangleLeaves_, grid->tree());
        grid->setName("triangle");
        return grid;
    }

  private:
    static std::unique_ptr<TriangleLeaf> triangleLeaf(const std::int32_t* triangles, const Leaf& like) {
        auto leaf = std::make_unique<TriangleLeaf>(openvdb::PartialCreate(), like.origin());
        leaf->buffer().allocate();
        for (openvdb::Index i = 0; i < blockVoxels; ++i)
            leaf->buffer().data()[i] = like.isValueOn(i) ? triangles[i] : -1;
        leaf->setValueMask(like.getValueMask());
        return leaf;
    }

    template <class LeafType, class Tree>
    static void move(PerThread<LeafType>& leaves, Tree& tree) {
        for (auto& some : leaves)
            for (auto& leaf : some) tree.addLeaf(leaf.release());
    }

    BandWidths widths_;
    bool wantTriangles_;
    PerThread<Leaf> leaves_;
    PerThread<TriangleLeaf> triangleLeaves_;
};

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

void describe(openvdb::FloatGrid& grid, const Mesh& mesh, const BuildOptions& options) {
    grid.setTransform(openvdb::math::Transform::createLinearTransform(options.voxelSize));
    grid.setCreator("bilayer");
    grid.insertMeta(metadata::version, openvdb::StringMetadata(BILAYER_VERSION));
    grid.insertMeta(metadata::method, openvdb::StringMetadata(name(options.method)));
    grid.insertMeta(metadata::meshHash, openvdb::Int64Metadata(std::int64_t(hash(mesh))));
    grid.insertMeta(metadata::interiorWidth, openvdb::FloatMetadata(options.interiorWidth * options.voxelSize));
}

void fillLayers(const Mesh& mesh, const BuildOptions& options, const BlockFiller& filler, Assembler& assembler,
                BuildTimes& times) {
    Stopwatch part;
    const FillParameters parameters = fillParameters(options);
    const Tiles tiles = makeTiles(mesh, options);
    if (tiles.tiles.empty()) throw std::invalid_argument("the mesh has no triangle with an area");
    times.tiles = part.lap();
    const Bricks bricks = binBricks(tiles, parameters.reach);
    Progress progress(options.progress, bricks.count());
    filler.fill({tiles, bricks, parameters, [&](std::size_t, const FilledBlocks& blocks) {
                     assembler.take(blocks);
                     progress.advance();
                 }});
}

// Voxels up to a voxel away are measured even for thinner bands: their signs carry over to all others by links.
float reachOf(const BuildOptions& options) {
    return std::max({options.exteriorWidth, options.interiorWidth, 1.f}) + reachSlack;
}

LevelSet run(const Mesh& mesh, const BuildOptions& options, const BlockFiller& filler, BuildTimes& times) {
    Stopwatch total, part;
    Assembler assembler(options);
    if (options.method == Method::doubleLayer)
        fillLayers(mesh, options, filler, assembler, times);
    else
        fillExact({mesh, options.voxelSize, reachOf(options), options.triangles, true,
                   [&](const FilledBlocks& blocks) { assembler.take(blocks); }});
    times.fill = part.lap();

    auto grids = std::make_shared<Grids>();
    const openvdb::FloatGrid::Ptr distance = assembler.distances();
    if (distance->activeVoxelCount() == 0)
        throw std::invalid_argument("no voxel lies within the band: the widths are too small for this voxel size");
    describe(*distance, mesh, options);
    grids->distance = distance;
    if (const openvdb::Int32Grid::Ptr triangle = assembler.triangles()) {
        triangle->setTransform(distance->transformPtr());
        grids->triangle = triangle;
    }
    LevelSet levelSet(std::move(grids));
    times.assemble = part.lap();
    times.total = total.lap();
    return levelSet;
}

}  // namespace

LevelSet build(const Mesh& mesh, const BuildOptions& options, const BlockFiller* filler, BuildTimes* times) {
    check(options);
    validate(mesh);
    checkSize(mesh, options, fillParameters(options).reach);
    openvdb::initialize();
    const BlockFiller tbb = tbbFiller();
    BuildTimes ignored;
    const auto work = [&] { return run(mesh, options, filler ? *filler : tbb, times ? *times : ignored); };
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
