// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/vdb/vdb_points.h"

#include <fmt/format.h>
#include <openvdb/points/AttributeArray.h>

#include <stdexcept>
#include <string>

namespace bilayer::detail {
namespace {

/// Walks over the attributes of a tree's points.
class PointAttributes {
  public:
    PointAttributes(VdbStream& in, const std::vector<VdbLeafMask>& leaves) : in_(in), leaves_(leaves) {}

    void skip() {
        constexpr unsigned others = 4;  // passes that do not belong to one attribute
        const auto passes = in_.read<std::uint16_t>();
        if (leaves_.empty()) return;
        if (passes < others || passes % 2 != 0) throw std::runtime_error("points in a wrong number of passes");
        in_.skip(leaves_.size() * sizeof(std::uint16_t), "sizes of leaves");
        readArrays();
        if (attributes() != (passes - others) / 2u) throw std::runtime_error("points in a wrong number of passes");
        for (unsigned i = 0; i < attributes(); ++i) readPages(i);
        for (const VdbLeafMask& mask : leaves_) skipOffsets(mask);
        for (unsigned i = 0; i < attributes(); ++i) skipData(i);
    }

  private:
    /// An attribute in a leaf.
    struct Array {
        std::uint64_t length;  ///< stored length, or length of the page's decompressed bytes
        std::uint64_t bytes;
        bool uniform, paged;
    };
    struct Page {
        std::uint64_t stored, bytes;
        bool compressed;
    };

    unsigned attributes() const { return unsigned(valueSizes_.size()); }

    void readArrays() {
        bool shared = false;
        for (std::size_t i = 0; i < leaves_.size(); ++i) {
            if (!shared) {
                const auto flags = in_.read<std::uint8_t>();
                readDescriptor();
                shared = flags & 1;
                if (flags & 2) in_.skip(in_.read<std::uint64_t>(), "points");
            }
            for (const std::uint64_t size : valueSizes_) arrays_.push_back(readArray(size));
        }
        if (arrays_.size() != leaves_.size() * attributes()) throw std::runtime_error("points of different attributes");
    }

    void readDescriptor() {
        const auto count = in_.read<std::uint64_t>();
        in_.require(count, "attributes");
        valueSizes_.clear();
        for (std::uint64_t i = 0; i < count; ++i) {
            const std::string value = in_.readName(), codec = in_.readName();
            const openvdb::NamePair type(value, codec);
            if (!openvdb::points::AttributeArray::isRegistered(type))
                throw std::runtime_error("an attribute of unknown type");
            valueSizes_.push_back(openvdb::points::AttributeArray::create(type, 1)->storageTypeSize());
        }
        for (std::uint64_t i = 0; i < count; ++i) {
            in_.skipName();
            if (in_.read<std::uint64_t>() >= count) throw std::runtime_error("an attribute that does not exist");
        }
        const auto groups = in_.read<std::uint64_t>();
        for (std::uint64_t i = 0; i < groups; ++i) {
            in_.skipName();
            in_.read<std::uint64_t>();
        }
        in_.skipMetadata();
    }

    Array readArray(std::uint64_t valueSize) {
        enum : std::uint8_t { strided = 1, uniform = 2, paged = 8 };
        constexpr std::uint64_t headBytes = sizeof(std::int16_t) + sizeof(std::uint32_t);
        const auto length = in_.read<std::uint64_t>();
        in_.read<std::uint8_t>();
        const auto flags = in_.read<std::uint8_t>();
        const std::uint64_t count = in_.read<std::uint32_t>(), stride = flags & strided ? in_.read<std::uint32_t>() : 1;
        if (length <= headBytes) throw std::runtime_error("an attribute without values");
        in_.require(count * stride / maxLz4Expansion, "an attribute");
        const Array array{length - headBytes, flags & uniform ? valueSize : count * stride * valueSize,
                          (flags & uniform) != 0, (flags & paged) != 0};
        if (array.paged && array.length != array.bytes)
            throw std::runtime_error(
                fmt::format("an attribute of {} bytes, where {} are expected", array.length, array.bytes));
        return array;
    }

    // Visits the arrays of one attribute, leaf by leaf.
    template <class Visit>
    void forArrays(unsigned attribute, Visit visit) const {
        for (std::size_t i = attribute; i < arrays_.size(); i += attributes()) visit(arrays_[i]);
    }

    void readPages(unsigned attribute) {
        std::uint64_t room = 0;
        pages_.emplace_back();
        forArrays(attribute, [&](const Array& array) {
            if (!array.paged) return;
            if (room == 0) {
                const auto stored = in_.read<std::int32_t>();
                const std::uint64_t bytes =
                    stored > 0 ? in_.read<std::uint32_t>() : std::uint64_t(-std::int64_t(stored));
                pages_.back().push_back({stored > 0 ? std::uint64_t(stored) : bytes, bytes, stored > 0});
                room = bytes;
            }
            if (array.bytes > room) throw std::runtime_error("attributes beyond their page");
            room -= array.bytes;
        });
    }

    void skipOffsets(const VdbLeafMask& mask) {
        constexpr std::uint64_t bytes = vdbLeafVoxels * sizeof(std::uint32_t), uncompressed = 0xffff;
        requireLeafMask(in_, mask);
        const auto stored = in_.read<std::uint16_t>();
        stored == uncompressed ? in_.skip(bytes, "voxels of points") : in_.skipBlosc(stored, bytes);
    }

    void skipData(unsigned attribute) {
        std::uint64_t room = 0;
        auto page = pages_[attribute].begin();
        forArrays(attribute, [&](const Array& array) {
            if (!array.paged) return skipArray(array);
            if (room == 0) {
                page->compressed ? in_.skipBlosc(page->stored, page->bytes) : in_.skip(page->stored, "a page");
                room = page++->bytes;
            }
            room -= array.bytes;
        });
    }

    void skipArray(const Array& array) {
        const bool compressed = !array.uniform && in_.read<std::uint8_t>() == 1;
        if (compressed) return in_.skipBlosc(array.length, array.bytes);
        if (array.length != array.bytes) throw std::runtime_error("an attribute of a wrong length");
        in_.skip(array.length, "an attribute");
    }

    VdbStream& in_;
    const std::vector<VdbLeafMask>& leaves_;
    std::vector<std::uint64_t> valueSizes_;  // [bytes]
    std::vector<Array> arrays_;              // all attributes of one leaf, then those of the next
    std::vector<std::vector<Page>> pages_;   // for each attribute
};

}  // namespace

void skipVdbPoints(VdbStream& in, const std::vector<VdbLeafMask>& leaves) {
    PointAttributes(in, leaves).skip();
}

}  // namespace bilayer::detail
