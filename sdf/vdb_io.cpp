#include <bilayer/sdf/vdb_io.h>

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_reduce.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/Compression.h>
#include <openvdb/io/DelayedLoadMetadata.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/Stream.h>
#include <openvdb/tree/LeafManager.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <bilayer/sdf/grids.h>
#include "sdf/base/large_array.h"
#include "sdf/base/openvdb.h"
#include "sdf/io/atomic_file.h"
#include "sdf/io/input_file.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/vdb_lengths.h"

namespace bilayer {

using namespace detail;

namespace {

/// Maximum relative rounding error of 16-bit floats, which have 11 significant bits.
constexpr float halfRounding = 1.f / 2048;

template <class Grid>
typename Grid::ConstPtr first(const openvdb::GridPtrVec& grids, auto accept) {
    for (const auto& base : grids)
        if (auto grid = openvdb::gridPtrCast<Grid>(base); grid && accept(*grid)) return grid;
    return nullptr;
}

/// Limit of voxel coordinates: sums of a few coordinates still fit in an int.
constexpr std::int32_t farthestVoxel = 1 << 30;

/// Checks all distances of a file. Throws std::invalid_argument in these cases:
/// - a distance is not finite, which rounding, searches and solvers would propagate;
/// - a tile is active, which solvers would fill with voxels;
/// - the stored interior width does not match the distances.
class DistanceCheck {
  public:
    explicit DistanceCheck(const LevelSet& levelSet)
        : grid_(*levelSet.grids().distance),
          interior_(grid_[metadata::interiorWidth] ? (1 - halfRounding) * levelSet.interiorWidth() : 0) {}

    void run() const {
        checkTiles();
        checkPlaces();
        const openvdb::tree::LeafManager<const openvdb::FloatTree> leaves(grid_.tree());
        tbb::parallel_for(leaves.leafRange(), [&](const auto& range) {
            for (auto leaf = range.begin(); leaf; ++leaf)
                for (auto voxel = leaf->cbeginValueAll(); voxel; ++voxel) check(*voxel, voxel.isValueOn());
        });
    }

  private:
    [[noreturn]] void refuse(const char* why) const {
        throw std::invalid_argument(fmt::format("grid '{}' {}", grid_.getName(), why));
    }

    void check(float distance, bool active) const {
        if (!std::isfinite(distance)) refuse("holds a distance that is no finite number");
        if (!active && distance < 0 && distance > -interior_)
            refuse("holds a distance beside its band that 'bilayer:interior_width' counts to it");
    }

    void checkTiles() const {
        auto tile = grid_.tree().cbeginValueAll();
        tile.setMaxDepth(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
        for (; tile; ++tile) {
            if (tile.isValueOn()) refuse("has an active tile: a band is active voxel by voxel");
            check(*tile, false);
        }
    }

    void checkPlaces() const {
        const openvdb::CoordBBox box = grid_.evalActiveVoxelBoundingBox();
        for (int axis = 0; axis < 3; ++axis)
            if (box.min()[axis] < -farthestVoxel || box.max()[axis] > farthestVoxel)
                refuse("has voxels farther than 2^30 voxels from its origin");
    }

    const openvdb::FloatGrid& grid_;
    float interior_;  // minimum distance of inactive inside voxels from the surface [m]
};

/// The checksum line at the end of our files, after the data that OpenVDB reads. Damage is thus detected before OpenVDB
/// decodes the file, because its Blosc decoder does not validate its input.
constexpr std::string_view sealName = "bilayer crc32 ";
constexpr std::size_t sealSize = sealName.size() + 9;  // eight digits and a line feed
// A truncated file ends with a prefix of the checksum line. A prefix of at least this length is no coincidence; a file
// that ends with a shorter one still has all of its grids.
constexpr std::size_t minOfSeal = 4;

/// Computed on all threads: checksums of parts combine.
std::string sealOf(std::string_view bytes) {
    struct Sum {
        uLong value = crc32(0, nullptr, 0);
        std::size_t size = 0;
    };
    constexpr std::size_t grain = 1 << 18;
    const auto add = [&](const tbb::blocked_range<std::size_t>& range, Sum sum) {
        sum.value = crc32_z(sum.value, reinterpret_cast<const Bytef*>(bytes.data()) + range.begin(), range.size());
        sum.size += range.size();
        return sum;
    };
    const auto join = [](const Sum& a, const Sum& b) {
        return Sum{crc32_combine(a.value, b.value, z_off_t(b.size)), a.size + b.size};
    };
    const Sum sum = tbb::parallel_reduce(tbb::blocked_range<std::size_t>(0, bytes.size(), grain), Sum{}, add, join);
    return fmt::format("{}{:08x}\n", sealName, sum.value);
}

std::ifstream opened(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    stream.exceptions(std::ios::failbit | std::ios::badbit);
    return stream;
}

/// Accepts files without a checksum line, which come from other programs. Throws std::runtime_error if the line is
/// truncated, does not match the data, or is not at the end.
void requireSeal(std::string_view bytes) {
    // Longer than the checksum line, because other bytes may follow it.
    const std::string_view end = bytes.substr(bytes.size() - std::min(bytes.size(), 4 * sealSize));
    for (std::size_t kept = sealName.size() - 1; kept >= minOfSeal; --kept)
        if (end.ends_with(sealName.substr(0, kept))) throw std::runtime_error("its end is missing");
    const std::size_t at = end.rfind(sealName);
    if (at == std::string_view::npos) return;
    if (sealOf(bytes.substr(0, bytes.size() - end.size() + at)) != end.substr(at))
        throw std::runtime_error("it is not as it was written");
}

/// Writes grids with complete metadata. Does not handle grids that share a name or a tree. OpenVDB's own archives would
/// compress all leaves a second time, to find the sizes for delayed loading.
class FieldArchive : public openvdb::io::Archive {
  public:
    /// Returns the compression flags for the values of a grid.
    std::uint32_t compressionOf(const openvdb::GridBase& grid) const {
        std::ostringstream tagged;
        setGridCompression(tagged, grid);
        return openvdb::io::getDataCompression(tagged);
    }

    void writeTo(std::ostream& out, const openvdb::GridCPtrVec& grids) const {
        writeHeader(out, /*seekable=*/false);
        openvdb::MetaMap().writeMeta(out);
        const auto count = std::int32_t(grids.size());
        out.write(reinterpret_cast<const char*>(&count), sizeof count);
        for (const auto& grid : grids) writeTo(out, *grid);
    }

  private:
    void writeTo(std::ostream& out, const openvdb::GridBase& grid) const {
        auto how = std::make_shared<openvdb::io::StreamMetadata>();
        how->setHalfFloat(grid.saveFloatAsHalf());
        openvdb::io::setStreamMetadataPtr(out, how);
        const openvdb::io::GridDescriptor descriptor(grid.getName(), grid.type(), grid.saveFloatAsHalf());
        descriptor.writeHeader(out);
        descriptor.writeStreamPos(out);
        setGridCompression(out, grid);
        grid.writeMeta(out);
        grid.writeTransform(out);
        grid.writeTopology(out);
        grid.writeBuffers(out);
        openvdb::io::clearStreamMetadataPtr(out);
    }
};

/// Returns where the values of a leaf begin, after its mask and its inactive values.
template <class Leaf>
std::size_t valuesBegin(std::string_view leaf) {
    using namespace openvdb::io;
    constexpr std::size_t mask = sizeof(typename Leaf::NodeMaskType);
    const auto kind = static_cast<unsigned char>(leaf[mask]);
    std::size_t begin = mask + 1;
    if (kind == NO_MASK_AND_ONE_INACTIVE_VAL || kind == MASK_AND_ONE_INACTIVE_VAL)
        begin += sizeof(typename Leaf::ValueType);
    if (kind == MASK_AND_TWO_INACTIVE_VALS) begin += 2 * sizeof(typename Leaf::ValueType);
    if (kind == MASK_AND_NO_INACTIVE_VALS || kind == MASK_AND_ONE_INACTIVE_VAL || kind == MASK_AND_TWO_INACTIVE_VALS)
        begin += mask;
    return begin;
}

/// A grid whose leaves are compressed on all threads before it is written. It stores their sizes for delayed loading,
/// as OpenVDB does. The bytes are the same as OpenVDB's.
template <class Grid>
class CompressedGrid : public Grid {
  public:
    using Leaf = typename Grid::TreeType::LeafNodeType;

    explicit CompressedGrid(Grid& grid) : Grid(grid, openvdb::ShallowCopy()) {
        using namespace openvdb;
        const Sizes sizes = compress(FieldArchive().compressionOf(*this));
        if (!sizes.empty()) this->insertMeta(GridBase::META_FILE_DELAYED_LOAD, sizes);
    }

    std::size_t bytes() const {
        std::size_t sum = 0;
        for (const std::string& run : runs_) sum += run.size();
        return sum;
    }

    /// Call only once: memory is freed as it is written.
    void writeBuffers(std::ostream& out) const override {
        for (std::string& run : runs_) {
            out.write(run.data(), std::streamsize(run.size()));
            run = {};
        }
    }

  private:
    using Sizes = openvdb::io::DelayedLoadMetadata;

    Sizes compress(std::uint32_t compression) {
        std::vector<const Leaf*> leaves;
        this->tree().getNodes(leaves);
        Sizes sizes;
        sizes.resizeMask(leaves.size());
        sizes.resizeCompressedSize(leaves.size());
        constexpr std::size_t run = 256;
        runs_.resize((leaves.size() + run - 1) / run);
        tbb::parallel_for(std::size_t(0), runs_.size(), [&](std::size_t i) {
            auto how = std::make_shared<openvdb::io::StreamMetadata>();
            how->setCompression(compression);
            how->setBackgroundPtr(&this->tree().background());
            std::ostringstream part;
            openvdb::io::setStreamMetadataPtr(part, how);
            for (std::size_t k = i * run; k < std::min((i + 1) * run, leaves.size()); ++k) {
                const std::size_t begin = part.view().size();
                leaves[k]->writeBuffers(part, this->saveFloatAsHalf());
                const std::string_view bytes = part.view().substr(begin);
                sizes.setMask(k,
                              openvdb::io::DelayedLoadMetadata::MaskType(bytes[sizeof(typename Leaf::NodeMaskType)]));
                sizes.setCompressedSize(k, std::int64_t(bytes.size() - valuesBegin<Leaf>(bytes)));
            }
            openvdb::io::clearStreamMetadataPtr(part);
            runs_[i] = std::move(part).str();
        });
        return sizes;
    }

    mutable std::vector<std::string> runs_;
};

void shift(openvdb::GridBase& grid, const glm::dvec3& by) {
    if (by == glm::dvec3(0)) return;
    const openvdb::math::Transform::Ptr shifted = grid.transform().copy();
    shifted->postTranslate({by.x, by.y, by.z});
    grid.setTransform(shifted);
}

/// Returns the origin of the mesh from which a field in a file was built.
glm::dvec3 originOf(const openvdb::GridPtrVec& grids) {
    for (const auto& grid : grids)
        if (const auto entry = grid->getMetadata<openvdb::Vec3DMetadata>(metadata::origin)) {
            const openvdb::Vec3d& origin = entry->value();
            return {origin.x(), origin.y(), origin.z()};
        }
    return glm::dvec3(0);
}

}  // namespace

openvdb::GridBase::Ptr inWorld(const openvdb::GridBase::ConstPtr& grid, const LevelSet& levelSet) {
    const openvdb::GridBase::Ptr copy = openvdb::ConstPtrCast<openvdb::GridBase>(grid)->copyGrid();
    shift(*copy, levelSet.origin());
    return copy;
}

namespace {

/// Grids prepared for an archive.
class PreparedGrids {
  public:
    explicit PreparedGrids(const openvdb::GridCPtrVec& grids) {
        for (const auto& grid : grids)
            if (!add<openvdb::FloatGrid>(grid) && !add<openvdb::Int32Grid>(grid))
                add(openvdb::ConstPtrCast<openvdb::GridBase>(grid)->copyGrid());
    }

    /// Returns the bytes of the archive.
    std::string bytes() const {
        std::string room;
        room.reserve(bytes_);
        adviseHugePages(room.data(), bytes_);
        std::ostringstream memory(std::move(room));
        memory.exceptions(std::ios::failbit | std::ios::badbit);
        FieldArchive().writeTo(memory, grids_);
        return std::move(memory).str();
    }

  private:
    template <class Grid>
    bool add(const openvdb::GridBase::ConstPtr& grid) {
        const auto typed = openvdb::gridPtrCast<Grid>(openvdb::ConstPtrCast<openvdb::GridBase>(grid));
        if (!typed) return false;
        const auto compressed = std::make_shared<CompressedGrid<Grid>>(*typed);
        bytes_ += compressed->bytes() + compressed->bytes() / topologyPart;
        add(compressed);
        return true;
    }

    void add(const openvdb::GridBase::Ptr& grid) {
        const std::string compression = openvdb::io::compressionToString(FieldArchive().compressionOf(*grid));
        grid->addStatsMetadata();
        grid->insertMeta(openvdb::GridBase::META_FILE_COMPRESSION, openvdb::StringMetadata(compression));
        grids_.push_back(grid);
    }

    static constexpr std::size_t topologyPart = 4;  // approximate fraction of masks and tiles, relative to the leaves
    openvdb::GridCPtrVec grids_;
    std::size_t bytes_ = 1 << 20;  // estimated file size
};

}  // namespace

void writeGrids(const std::filesystem::path& path, const openvdb::GridCPtrVec& grids) {
    AtomicFile file(path);
    try {
        const std::string bytes = PreparedGrids(grids).bytes();
        std::ofstream stream(file.temporary(), std::ios::binary);
        stream.exceptions(std::ios::failbit | std::ios::badbit);
        stream << bytes << sealOf(bytes);
        stream.close();
    } catch (const std::exception&) {
        throw std::runtime_error(fmt::format("{}: cannot be written (is the disk full?)", path.string()));
    }
    file.commit();
}

float storedErrorBound(const LevelSet& levelSet, const VdbOptions& options) {
    if (!options.halfFloat) return levelSet.errorBound();
    return levelSet.errorBound() + halfRounding * std::max(levelSet.exteriorWidth(), levelSet.interiorWidth());
}

void writeVdb(const std::filesystem::path& path, const LevelSet& levelSet, const VdbOptions& options) {
    openvdb::initialize();
    // A copy, because the storage precision is a property of the grid.
    const openvdb::GridBase::Ptr distance = inWorld(levelSet.grids().distance, levelSet);
    distance->setSaveFloatAsHalf(options.halfFloat);
    if (options.halfFloat && distance->getMetadata<openvdb::FloatMetadata>(metadata::errorBound))
        distance->insertMeta(metadata::errorBound, openvdb::FloatMetadata(storedErrorBound(levelSet, options)));
    openvdb::GridCPtrVec grids{distance};
    if (levelSet.grids().triangle) grids.push_back(inWorld(levelSet.grids().triangle, levelSet));
    if (levelSet.grids().points) grids.push_back(inWorld(levelSet.grids().points, levelSet));
    writeGrids(path, grids);
}

LevelSet readVdb(const std::filesystem::path& path) {
    openvdb::initialize();
    requireInputFile(path);
    openvdb::GridPtrVec grids;
    try {
        requireSeal(MappedFile(path).bytes());
        std::ifstream stream = opened(path);
        requireLengths(stream, std::filesystem::file_size(path));
        stream.seekg(0);
        // With delayed loading, the values and any damage to them would stay in the file.
        grids = *openvdb::io::Stream(stream, /*delayLoad=*/false).getGrids();
    } catch (const std::exception& error) {
        throw std::runtime_error(fmt::format("{}: is no .vdb file or is damaged ({})", path.string(), error.what()));
    }
    const glm::dvec3 origin = originOf(grids);
    for (const auto& grid : grids) shift(*grid, -origin);
    auto result = std::make_shared<Grids>();
    result->distance = first<openvdb::FloatGrid>(
        grids, [](const auto& grid) { return grid.getGridClass() == openvdb::GRID_LEVEL_SET; });
    if (!result->distance) throw std::runtime_error(fmt::format("{}: holds no level set", path.string()));
    result->triangle = first<openvdb::Int32Grid>(grids, [](const auto& grid) { return grid.getName() == "triangle"; });
    for (const auto& grid : grids)
        if (grid->getName() == contactPoints) result->points = grid;
    try {
        const LevelSet levelSet(std::move(result));
        DistanceCheck(levelSet).run();
        return levelSet;
    } catch (const std::invalid_argument& error) {
        throw std::runtime_error(fmt::format("{}: {}", path.string(), error.what()));
    }
}

}  // namespace bilayer
