// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/vdb/vdb_archive.h"

#include <oneapi/tbb/parallel_for.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/Compression.h>
#include <openvdb/io/DelayedLoadMetadata.h>
#include <openvdb/io/GridDescriptor.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include "sdf/base/openvdb.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t taskLeaves = 256;  // leaves that one task compresses

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

    /// Call only once: memory is freed as it is written.
    void writeBuffers(std::ostream& out) const override {
        for (std::string& part : parts_) {
            out.write(part.data(), std::streamsize(part.size()));
            part = {};
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
        parts_.resize((leaves.size() + taskLeaves - 1) / taskLeaves);
        tbb::parallel_for(std::size_t(0), parts_.size(), [&](std::size_t i) {
            auto how = std::make_shared<openvdb::io::StreamMetadata>();
            how->setCompression(compression);
            how->setBackgroundPtr(&this->tree().background());
            std::ostringstream stream;
            openvdb::io::setStreamMetadataPtr(stream, how);
            for (std::size_t k = i * taskLeaves; k < std::min((i + 1) * taskLeaves, leaves.size()); ++k) {
                const std::size_t begin = stream.view().size();
                leaves[k]->writeBuffers(stream, this->saveFloatAsHalf());
                const std::string_view bytes = stream.view().substr(begin);
                sizes.setMask(k,
                              openvdb::io::DelayedLoadMetadata::MaskType(bytes[sizeof(typename Leaf::NodeMaskType)]));
                sizes.setCompressedSize(k, std::int64_t(bytes.size() - valuesBegin<Leaf>(bytes)));
            }
            openvdb::io::clearStreamMetadataPtr(stream);
            parts_[i] = std::move(stream).str();
        });
        return sizes;
    }

    mutable std::vector<std::string> parts_;
};

/// Grids prepared for an archive.
class PreparedGrids {
  public:
    explicit PreparedGrids(const openvdb::GridCPtrVec& grids) {
        for (const auto& grid : grids)
            if (!add<openvdb::FloatGrid>(grid) && !add<openvdb::Int32Grid>(grid))
                add(openvdb::ConstPtrCast<openvdb::GridBase>(grid)->copyGrid());
    }

    /// Call only once: memory is freed as it is written.
    void write(std::ostream& out) const { FieldArchive().writeTo(out, grids_); }

  private:
    template <class Grid>
    bool add(const openvdb::GridBase::ConstPtr& grid) {
        const auto typed = openvdb::gridPtrCast<Grid>(openvdb::ConstPtrCast<openvdb::GridBase>(grid));
        if (!typed) return false;
        add(std::make_shared<CompressedGrid<Grid>>(*typed));
        return true;
    }

    void add(const openvdb::GridBase::Ptr& grid) {
        const std::string compression = openvdb::io::compressionToString(FieldArchive().compressionOf(*grid));
        grid->addStatsMetadata();
        grid->insertMeta(openvdb::GridBase::META_FILE_COMPRESSION, openvdb::StringMetadata(compression));
        grids_.push_back(grid);
    }

    openvdb::GridCPtrVec grids_;
};

}  // namespace

void writeArchive(std::ostream& out, const openvdb::GridCPtrVec& grids) {
    PreparedGrids(grids).write(out);
}

}  // namespace bilayer::detail
