// Blocks stream through the device in batches of whole bricks. Two batches take turns: while the device fills one, the
// host bins the next and hands on the one before.
#include "cl/filler.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "cl/brick_filler.h"
#include "cl/prism.h"
#include "cl/program.h"
#include "sdf/bricks.h"
#include "sdf/progress.h"
#include "sdf/tiles.h"

namespace bilayer {

extern const char* const double_layer_cl;  // the text of double_layer.cl

namespace {

constexpr std::uint64_t mebibyte = 1 << 20;
constexpr std::size_t windowBricks = 32;   // binned at once: a few thousand blocks, enough to keep a large GPU busy
constexpr std::size_t itemsPerBlock = 64;  // of rowPerItem; as in the kernel
constexpr std::size_t batchesInFlight = 2;

// What the kernel takes as `Parameters`.
struct KernelParameters {
    cl_float delta, reach, certain;
    cl_int cube;
};

// How much a batch holds, and what that takes on the device.
struct Load {
    std::uint64_t blocks = 0;
    std::uint64_t entries = 0;  // of the lists of tiles

    Load operator+(const Load& other) const { return {blocks + other.blocks, entries + other.entries}; }
    bool covers(const Load& other) const { return blocks >= other.blocks && entries >= other.entries; }
    std::uint64_t resultBytes() const { return blocks * blockVoxels * sizeof(float); }
    std::uint64_t listBytes() const { return entries * sizeof(cl_uint); }
    std::uint64_t bytes(bool triangles) const {
        return resultBytes() * (triangles ? 2 : 1) + listBytes() + blocks * sizeof(glm::ivec3) +
               (blocks + 1) * sizeof(cl_uint);
    }
};

Load loadOf(const BrickBlocks& blocks) {
    return {blocks.origins.size(), blocks.tiles.size()};
}

struct Batch {
    std::size_t firstBrick = 0;
    std::vector<std::size_t> begins;  // the first block of each brick, and the end of the last
    std::vector<glm::ivec3> origins;
    std::vector<cl_uint> offsets, tiles;
    Load capacity;  // of the buffers
    cl::Buffer originBuffer, offsetBuffer, tileBuffer, distanceBuffer, triangleBuffer;
    const float* distances = nullptr;         // mapped once `filled` has happened
    const std::int32_t* triangles = nullptr;  // likewise
    cl::Event filled;

    std::size_t bricks() const { return begins.empty() ? 0 : begins.size() - 1; }
};

std::string mebibytes(std::uint64_t bytes) {
    return std::to_string((bytes + mebibyte - 1) / mebibyte) + " MiB";
}

struct TileJob {
    const Tiles& tiles;
    const Bricks& bricks;
    FillParameters parameters;
    const MeshJob& mesh;
};

class Fill {
  public:
    Fill(Device::Impl& device, const OpenclOptions& options, const TileJob& job);
    ~Fill();
    void run();

  private:
    void upload();
    void bin(std::size_t first, std::size_t last);
    bool fits(const Load& load) const;
    std::size_t lastFitting(std::size_t first) const;
    void gather(Batch& batch, std::size_t first, std::size_t last) const;
    void reserve(Batch& batch, const Load& load) const;
    void start(Batch& batch);
    void finish(Batch& batch);

    Device::Impl& device_;
    const TileJob job_;
    const bool triangles_, rowPerItem_;
    const std::uint64_t budget_;   // for everything [bytes]
    std::uint64_t tileBytes_ = 0;  // what the tiles take of it
    cl::Kernel kernel_;
    cl::Buffer tiles_, owners_;
    std::vector<BrickBlocks> window_;  // the bricks from firstBinned_ on
    std::size_t firstBinned_ = 0;
    std::array<Batch, batchesInFlight> batches_;
};

bool wantsRowPerItem(const Device::Impl& device, KernelMapping mapping) {
    return mapping == KernelMapping::automatic ? device.info.gpu : mapping == KernelMapping::groupPerBlock;
}

std::string buildOptions(const Device::Impl& device, bool rowPerItem, bool triangles) {
    std::string options = "-cl-std=CL1.2";
    if (device.info.exactSquareRoots) options += " -cl-fp32-correctly-rounded-divide-sqrt";
    if (rowPerItem) options += " -D ROW_PER_ITEM";
    if (triangles) options += " -D TRIANGLES=1";
    return options;
}

Fill::Fill(Device::Impl& device, const OpenclOptions& options, const TileJob& job)
    : device_(device),
      job_(job),
      triangles_(job.parameters.triangles),
      rowPerItem_(wantsRowPerItem(device, options.mapping)),
      budget_(options.memoryMiB > 0 ? options.memoryMiB * mebibyte : device.info.memoryBytes / 4 * 3) {
    kernel_ =
        cl::Kernel(buildProgram(device, double_layer_cl, buildOptions(device, rowPerItem_, triangles_)), "fillBlocks");
    upload();
}

// Commands in flight use the memory of the batches: they must have ended, whatever else went wrong.
Fill::~Fill() {
    try {
        device_.queue.finish();
    } catch (const cl::Error&) {
    }
}

void Fill::upload() {
    const auto& tiles = job_.tiles;
    const std::uint64_t bytes = tiles.tiles.size() * sizeof(Tile), ownerBytes = tiles.triangles.size() * sizeof(cl_int);
    tileBytes_ = bytes + (triangles_ ? ownerBytes : 0);
    if (tileBytes_ > budget_ || bytes > device_.info.maxAllocationBytes)
        throw DeviceError("the samples of this mesh need " + mebibytes(tileBytes_) + " on " + device_.info.name +
                          ", of " + mebibytes(budget_) + " in all and " + mebibytes(device_.info.maxAllocationBytes) +
                          " in one buffer");
    const auto uploaded = [&](const auto& data, std::uint64_t size) {
        const cl_mem_flags how = device_.info.unifiedMemory ? CL_MEM_USE_HOST_PTR : CL_MEM_COPY_HOST_PTR;
        return cl::Buffer(
            device_.context, CL_MEM_READ_ONLY | how, size,
            const_cast<void*>(static_cast<const void*>(data.data())));  // OpenCL's signature; it is only read
    };
    tiles_ = uploaded(tiles.tiles, bytes);
    if (triangles_) owners_ = uploaded(tiles.triangles, ownerBytes);
}

void Fill::run() {
    std::size_t turn = 0;
    for (std::size_t first = 0; first < job_.bricks.count(); first += windowBricks) {
        const std::size_t last = std::min(first + windowBricks, job_.bricks.count());
        bin(first, last);
        for (std::size_t from = first, to; from < last; from = to) {
            to = lastFitting(from);
            Batch& batch = batches_[turn++ % batchesInFlight];
            finish(batch);
            gather(batch, from, to);
            start(batch);
        }
    }
    for (std::size_t i = 0; i < batchesInFlight; ++i) finish(batches_[turn++ % batchesInFlight]);
}

void Fill::bin(std::size_t first, std::size_t last) {
    firstBinned_ = first;
    window_.resize(last - first);
    tbb::parallel_for(first, last, [&](std::size_t brick) {
        binBlocks(job_.tiles, job_.bricks, brick, job_.parameters.reach, window_[brick - first]);
    });
}

// Whether a batch may be as large as this: its share of the memory, the largest buffer, and 32 bits for the kernel's
// offsets.
bool Fill::fits(const Load& load) const {
    return load.bytes(triangles_) <= (budget_ - tileBytes_) / batchesInFlight &&
           load.resultBytes() <= device_.info.maxAllocationBytes &&
           load.listBytes() <= device_.info.maxAllocationBytes && load.entries <= std::numeric_limits<cl_uint>::max();
}

// The end of the run of binned bricks from `first` on that go into one batch.
std::size_t Fill::lastFitting(std::size_t first) const {
    Load load = loadOf(window_[first - firstBinned_]);
    if (!fits(load))
        throw DeviceError("the samples of this mesh and one brick of 64x64x64 voxels need " +
                          mebibytes(tileBytes_ + batchesInFlight * load.bytes(triangles_)) + " on " +
                          device_.info.name + ", which may use " + mebibytes(budget_));
    std::size_t last = first + 1;
    for (; last < firstBinned_ + window_.size(); ++last) {
        load = load + loadOf(window_[last - firstBinned_]);
        if (!fits(load)) break;
    }
    return last;
}

// Joins the bricks' blocks and lists of tiles.
void Fill::gather(Batch& batch, std::size_t first, std::size_t last) const {
    batch.firstBrick = first;
    batch.begins.assign(1, 0);
    batch.origins.clear();
    batch.offsets.assign(1, 0);
    batch.tiles.clear();
    for (std::size_t brick = first; brick < last; ++brick) {
        const BrickBlocks& blocks = window_[brick - firstBinned_];
        const auto shift = cl_uint(batch.tiles.size());
        batch.origins.insert(batch.origins.end(), blocks.origins.begin(), blocks.origins.end());
        batch.tiles.insert(batch.tiles.end(), blocks.tiles.begin(), blocks.tiles.end());
        std::transform(blocks.offsets.begin() + 1, blocks.offsets.end(), std::back_inserter(batch.offsets),
                       [&](std::uint32_t offset) { return shift + offset; });
        batch.begins.push_back(batch.origins.size());
    }
}

// Makes the buffers large enough. They grow, but never beyond the batch's share of the memory.
void Fill::reserve(Batch& batch, const Load& load) const {
    if (batch.capacity.covers(load)) return;
    const Load grown{std::max(load.blocks, batch.capacity.blocks), std::max(load.entries, batch.capacity.entries)};
    batch.capacity = fits(grown) ? grown : load;
    batch.originBuffer = batch.offsetBuffer = batch.tileBuffer = batch.distanceBuffer = batch.triangleBuffer =
        cl::Buffer();
    const auto buffer = [&](cl_mem_flags flags, std::uint64_t bytes) {
        return cl::Buffer(device_.context, flags, bytes);
    };
    batch.originBuffer = buffer(CL_MEM_READ_ONLY, batch.capacity.blocks * sizeof(glm::ivec3));
    batch.offsetBuffer = buffer(CL_MEM_READ_ONLY, (batch.capacity.blocks + 1) * sizeof(cl_uint));
    batch.tileBuffer = buffer(CL_MEM_READ_ONLY, batch.capacity.listBytes());
    batch.distanceBuffer = buffer(CL_MEM_WRITE_ONLY, batch.capacity.resultBytes());
    if (triangles_) batch.triangleBuffer = buffer(CL_MEM_WRITE_ONLY, batch.capacity.resultBytes());
}

// Sends a batch on its way: lists up, kernel, distances down.
void Fill::start(Batch& batch) {
    const std::size_t blocks = batch.origins.size();
    if (blocks == 0) return;
    reserve(batch, {blocks, batch.tiles.size()});
    const auto write = [&](const cl::Buffer& buffer, const auto& data) {
        device_.queue.enqueueWriteBuffer(buffer, CL_FALSE, 0, data.size() * sizeof data[0], data.data());
    };
    write(batch.originBuffer, batch.origins);
    write(batch.offsetBuffer, batch.offsets);
    write(batch.tileBuffer, batch.tiles);

    const FillParameters& p = job_.parameters;
    cl_uint argument = 0;
    for (const cl::Buffer* buffer : {&tiles_, &owners_, &batch.originBuffer, &batch.offsetBuffer, &batch.tileBuffer})
        kernel_.setArg(argument++, *buffer);
    kernel_.setArg(argument++, KernelParameters{p.delta, p.reach, p.certain, p.cube});
    kernel_.setArg(argument++, batch.distanceBuffer);
    kernel_.setArg(argument++, batch.triangleBuffer);
    const std::size_t items = rowPerItem_ ? itemsPerBlock : 1;
    device_.queue.enqueueNDRangeKernel(kernel_, cl::NullRange, cl::NDRange(blocks * items), cl::NDRange(items));

    // mapping copies nothing where the memory is shared
    const auto mapped = [&](const cl::Buffer& buffer) {
        return device_.queue.enqueueMapBuffer(buffer, CL_FALSE, CL_MAP_READ, 0, Load{blocks}.resultBytes(), nullptr,
                                              &batch.filled);
    };
    if (triangles_) batch.triangles = static_cast<const std::int32_t*>(mapped(batch.triangleBuffer));
    batch.distances = static_cast<const float*>(mapped(batch.distanceBuffer));
    device_.queue.flush();
}

// Waits for a batch, if it is under way, and hands its blocks on.
void Fill::finish(Batch& batch) {
    const bool filled = !batch.origins.empty();
    if (filled) batch.filled.wait();
    tbb::parallel_for(std::size_t(0), batch.bricks(), [&](std::size_t brick) {
        const std::size_t begin = batch.begins[brick], count = batch.begins[brick + 1] - begin;
        const auto values = [&](const auto* all) { return std::span(all + begin * blockVoxels, count * blockVoxels); };
        job_.mesh.progress.advance();
        job_.mesh.sink({std::span(batch.origins).subspan(begin, count), values(batch.distances),
                        triangles_ ? values(batch.triangles) : std::span<const std::int32_t>()});
    });
    if (filled) {
        device_.queue.enqueueUnmapMemObject(batch.distanceBuffer, const_cast<float*>(batch.distances));
        if (triangles_)
            device_.queue.enqueueUnmapMemObject(batch.triangleBuffer, const_cast<std::int32_t*>(batch.triangles));
    }
    batch.begins.clear();
    batch.origins.clear();
}

}  // namespace

BlockFiller openclFiller(const Device& device, const OpenclOptions& options) {
    return {"opencl", device.info().name, [device, options](const FillJob& job) {
                try {
                    if (job.options.method == Method::exact) return fillByBricks(device.impl(), options, job);
                    if (job.options.method == Method::prism) return fillPrism(device.impl(), options, job);
                    const Tiles tiles = makeTiles(job.mesh.mesh, job.options);
                    const Bricks bricks = binBricks(tiles, job.layers.reach);
                    job.mesh.progress.begin(bricks.count());
                    Fill(device.impl(), options, {tiles, bricks, job.layers, job.mesh}).run();
                } catch (const cl::Error& error) {
                    throw deviceError(error, device.info().name);
                }
            }};
}

}  // namespace bilayer
