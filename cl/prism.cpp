// Blocks stream through the device in batches of whole bricks. Two batches take turns: while the device fills one, the
// host makes the prisms of the next and hands on the one before.
#include "cl/prism.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "cl/prism_bins.h"
#include "cl/program.h"
#include "sdf/progress.h"
#include "sdf/triangle_bins.h"

namespace bilayer {

extern const char* const prism_cl;  // the text of prism.cl

namespace {

constexpr std::uint64_t mebibyte = 1 << 20;
constexpr std::size_t windowBricks = 128;  // prepared at once: a few thousand blocks, enough to keep a large GPU busy
constexpr std::size_t itemsPerBlock = 64;  // of a row an item; as in the kernel
constexpr std::size_t batchesInFlight = 2;

// How much a batch holds, and what that takes on the device.
struct Load {
    std::uint64_t blocks = 0, prisms = 0, entries = 0;

    Load operator+(const Load& other) const {
        return {blocks + other.blocks, prisms + other.prisms, entries + other.entries};
    }
    Load atLeast(const Load& other) const {
        return {std::max(blocks, other.blocks), std::max(prisms, other.prisms), std::max(entries, other.entries)};
    }
    bool operator==(const Load&) const = default;
    std::uint64_t resultBytes() const { return blocks * blockVoxels * sizeof(float); }
    std::uint64_t prismBytes() const { return prisms * sizeof(Prism); }
    std::uint64_t entryBytes() const { return entries * sizeof(cl_uint); }
    std::uint64_t placeBytes() const { return blocks * sizeof(glm::ivec3); }
    std::uint64_t offsetBytes() const { return (blocks + 1) * sizeof(cl_uint); }
    std::uint64_t bytes(bool triangles) const {
        return resultBytes() * (triangles ? 2 : 1) + prismBytes() + entryBytes() + placeBytes() + offsetBytes();
    }
    std::uint64_t largestBuffer() const { return std::max({resultBytes(), prismBytes(), entryBytes()}); }
};

Load loadOf(const PrismBlocks& blocks) {
    return {blocks.places.size(), blocks.prisms.size(), blocks.reaching.size()};
}

struct Batch {
    std::vector<std::size_t> begins;  // the first block of each brick, and the end of the last
    std::vector<glm::ivec3> origins;  // of blocks
    std::vector<Prism> prisms;
    std::vector<glm::ivec3> places;
    std::vector<cl_uint> offsets, reaching;
    Load capacity;  // of the buffers
    cl::Buffer prismBuffer, placeBuffer, offsetBuffer, reachingBuffer, distanceBuffer, triangleBuffer;
    const float* distances = nullptr;         // mapped once `filled` has happened
    const std::int32_t* triangles = nullptr;  // likewise
    cl::Event filled;

    std::size_t bricks() const { return begins.empty() ? 0 : begins.size() - 1; }
    Load load() const { return {places.size(), prisms.size(), reaching.size()}; }
    void clear() {
        begins.assign(1, 0);
        origins.clear();
        prisms.clear();
        places.clear();
        offsets.assign(1, 0);
        reaching.clear();
    }
};

std::string mebibytes(std::uint64_t bytes) {
    return std::to_string((bytes + mebibyte - 1) / mebibyte) + " MiB";
}

std::string buildOptions(const Device::Impl& device, bool rowPerItem, bool triangles) {
    std::string options = "-cl-std=CL1.2";
    if (device.info.exactSquareRoots) options += " -cl-fp32-correctly-rounded-divide-sqrt";
    if (rowPerItem) options += " -D ROW_PER_ITEM";
    if (triangles) options += " -D TRIANGLES=1";
    return options;
}

class Fill {
  public:
    Fill(Device::Impl& device, const OpenclOptions& options, const PrismJob& job, const MeshJob& mesh,
         const TriangleBins& bins);
    ~Fill();
    void run();

  private:
    void prepare(std::size_t first, std::size_t last);
    bool fits(const Load& load) const;
    std::size_t lastFitting(std::size_t first) const;
    void gather(Batch& batch, std::size_t first, std::size_t last) const;
    void reserve(Batch& batch) const;
    void start(Batch& batch);
    void finish(Batch& batch);

    Device::Impl& device_;
    const PrismJob job_;
    const MeshJob& mesh_;
    const TriangleBins& bins_;
    const bool rowPerItem_;
    const std::uint64_t budget_;  // for everything [bytes]
    cl::Kernel kernel_;
    std::vector<PrismBlocks> window_;  // the bricks from firstPrepared_ on
    std::size_t firstPrepared_ = 0;
    std::array<Batch, batchesInFlight> batches_;
};

Fill::Fill(Device::Impl& device, const OpenclOptions& options, const PrismJob& job, const MeshJob& mesh,
           const TriangleBins& bins)
    : device_(device),
      job_(job),
      mesh_(mesh),
      bins_(bins),
      rowPerItem_(options.mapping == KernelMapping::automatic ? device.info.gpu
                                                              : options.mapping == KernelMapping::rowPerItem),
      budget_(options.memoryMiB > 0 ? options.memoryMiB * mebibyte : device.info.memoryBytes / 4 * 3),
      kernel_(buildProgram(device, prism_cl, buildOptions(device, rowPerItem_, mesh.triangles)), "fillBlocks") {}

// Commands in flight use the memory of the batches: they must have ended, whatever else went wrong.
Fill::~Fill() {
    try {
        device_.queue.finish();
    } catch (const cl::Error&) {
    }
}

void Fill::run() {
    std::size_t turn = 0;
    for (std::size_t first = 0; first < bins_.count(); first += windowBricks) {
        const std::size_t last = std::min(first + windowBricks, bins_.count());
        prepare(first, last);
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

void Fill::prepare(std::size_t first, std::size_t last) {
    firstPrepared_ = first;
    window_.resize(std::max(window_.size(), last - first));
    tbb::parallel_for(first, last, [&](std::size_t brick) {
        mesh_.progress.poll();
        binPrisms(job_, bins_, brick, window_[brick - first]);
    });
}

// Whether a batch may be as large as this: its share of the memory, the largest buffer, and 32 bits for the kernel's
// indices.
bool Fill::fits(const Load& load) const {
    return load.bytes(mesh_.triangles) <= budget_ / batchesInFlight &&
           load.largestBuffer() <= device_.info.maxAllocationBytes &&
           std::max(load.entries, load.prisms) <= std::numeric_limits<cl_uint>::max();
}

// The end of the run of prepared bricks from `first` on that go into one batch.
std::size_t Fill::lastFitting(std::size_t first) const {
    const std::size_t end = std::min(firstPrepared_ + windowBricks, bins_.count());
    Load load = loadOf(window_[first - firstPrepared_]);
    if (!fits(load))
        throw DeviceError("the prisms of one brick of " + std::to_string(bins_.side) + " voxels a side need " +
                          mebibytes(batchesInFlight * load.bytes(mesh_.triangles)) + " on " + device_.info.name +
                          ", which may use " + mebibytes(budget_) + " in all and " +
                          mebibytes(device_.info.maxAllocationBytes) + " in one buffer");
    std::size_t last = first + 1;
    for (; last < end; ++last) {
        load = load + loadOf(window_[last - firstPrepared_]);
        if (!fits(load)) break;
    }
    return last;
}

// Joins the bricks' prisms and blocks.
void Fill::gather(Batch& batch, std::size_t first, std::size_t last) const {
    batch.clear();
    for (std::size_t brick = first; brick < last; ++brick) {
        const PrismBlocks& blocks = window_[brick - firstPrepared_];
        const auto firstPrism = cl_uint(batch.prisms.size()), firstEntry = cl_uint(batch.reaching.size());
        batch.prisms.insert(batch.prisms.end(), blocks.prisms.begin(), blocks.prisms.end());
        batch.places.insert(batch.places.end(), blocks.places.begin(), blocks.places.end());
        std::transform(blocks.places.begin(), blocks.places.end(), std::back_inserter(batch.origins),
                       [&](const glm::ivec3& place) { return bins_.origins[brick] + place; });
        std::transform(blocks.offsets.begin() + 1, blocks.offsets.end(), std::back_inserter(batch.offsets),
                       [&](cl_uint offset) { return firstEntry + offset; });
        std::transform(blocks.reaching.begin(), blocks.reaching.end(), std::back_inserter(batch.reaching),
                       [&](cl_uint prism) { return firstPrism + prism; });
        batch.begins.push_back(batch.origins.size());
    }
}

// Makes the buffers large enough. They grow, but never beyond the batch's share of the memory.
void Fill::reserve(Batch& batch) const {
    const Load load = batch.load(), grown = load.atLeast(batch.capacity);
    if (grown == batch.capacity) return;
    batch.capacity = fits(grown) ? grown : load;
    batch.prismBuffer = batch.placeBuffer = batch.offsetBuffer = batch.reachingBuffer = batch.distanceBuffer =
        batch.triangleBuffer = cl::Buffer();
    const auto buffer = [&](cl_mem_flags flags, std::uint64_t bytes) {
        return cl::Buffer(device_.context, flags, bytes);
    };
    batch.prismBuffer = buffer(CL_MEM_READ_ONLY, batch.capacity.prismBytes());
    batch.placeBuffer = buffer(CL_MEM_READ_ONLY, batch.capacity.placeBytes());
    batch.offsetBuffer = buffer(CL_MEM_READ_ONLY, batch.capacity.offsetBytes());
    batch.reachingBuffer = buffer(CL_MEM_READ_ONLY, batch.capacity.entryBytes());
    batch.distanceBuffer = buffer(CL_MEM_WRITE_ONLY, batch.capacity.resultBytes());
    if (mesh_.triangles) batch.triangleBuffer = buffer(CL_MEM_WRITE_ONLY, batch.capacity.resultBytes());
}

// Sends a batch on its way: prisms and lists up, kernel, distances down.
void Fill::start(Batch& batch) {
    const std::size_t blocks = batch.places.size();
    if (blocks == 0) return;
    reserve(batch);
    const auto write = [&](const cl::Buffer& buffer, const auto& data) {
        device_.queue.enqueueWriteBuffer(buffer, CL_FALSE, 0, data.size() * sizeof data[0], data.data());
    };
    write(batch.prismBuffer, batch.prisms);
    write(batch.placeBuffer, batch.places);
    write(batch.offsetBuffer, batch.offsets);
    write(batch.reachingBuffer, batch.reaching);

    cl_uint argument = 0;
    for (const cl::Buffer* buffer :
         {&batch.prismBuffer, &batch.placeBuffer, &batch.offsetBuffer, &batch.reachingBuffer})
        kernel_.setArg(argument++, *buffer);
    kernel_.setArg(argument++, cl_float(job_.reach));
    kernel_.setArg(argument++, batch.distanceBuffer);
    kernel_.setArg(argument++, batch.triangleBuffer);
    const std::size_t items = rowPerItem_ ? itemsPerBlock : 1;
    device_.queue.enqueueNDRangeKernel(kernel_, cl::NullRange, cl::NDRange(blocks * items), cl::NDRange(items));

    // mapping copies nothing where the memory is shared
    const auto mapped = [&](const cl::Buffer& buffer) {
        return device_.queue.enqueueMapBuffer(buffer, CL_FALSE, CL_MAP_READ, 0, batch.load().resultBytes(), nullptr,
                                              &batch.filled);
    };
    if (mesh_.triangles) batch.triangles = static_cast<const std::int32_t*>(mapped(batch.triangleBuffer));
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
        mesh_.progress.advance();
        if (count > 0)
            mesh_.sink({std::span(batch.origins).subspan(begin, count), values(batch.distances),
                        mesh_.triangles ? values(batch.triangles) : std::span<const std::int32_t>()});
    });
    if (filled) {
        device_.queue.enqueueUnmapMemObject(batch.distanceBuffer, const_cast<float*>(batch.distances));
        if (mesh_.triangles)
            device_.queue.enqueueUnmapMemObject(batch.triangleBuffer, const_cast<std::int32_t*>(batch.triangles));
    }
    batch.clear();
}

}  // namespace

void fillPrism(Device::Impl& device, const OpenclOptions& options, const FillJob& job) {
    const MeshJob& mesh = job.mesh;
    const double voxelsPerUnit = 1.0 / double(mesh.voxelSize);
    const VerticesAcross across(mesh.mesh, mesh.progress);
    const TriangleBins bins = binTriangles(mesh.mesh, job.box, voxelsPerUnit, mesh.reach, &mesh.progress);
    mesh.progress.begin(bins.count());
    Fill(device, options, {mesh.mesh, across, voxelsPerUnit, mesh.reach}, mesh, bins).run();
}

}  // namespace bilayer
