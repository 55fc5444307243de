// The format is that of OpenVDB's io::Archive, versions 222 to 224.
#include "sdf/io/vdb_lengths.h"

#include <fmt/format.h>
#include <openvdb/points/AttributeArray.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sdf/base/openvdb.h"

namespace bilayer::detail {
namespace {

/// LZ4 writes at least one byte for this count of bytes, which limits the decompressed size.
constexpr std::uint64_t maxExpansion = 256;
/// Blosc pads shorter data up to this size [bytes].
constexpr std::uint64_t bloscPadding = 128;
/// Voxels along the nodes of a tree, from the coarsest to the leaves, as powers of two.
constexpr int coarse = 5, fine = 4, leaf = 3;

constexpr std::uint64_t cube(int log2) {
    return std::uint64_t(1) << 3 * log2;
}

/// Reads what lengths depend on, and skips the rest.
class Stream {
  public:
    Stream(std::istream& in, std::uint64_t size) : in_(in), left_(size) {}

    std::uint64_t left() const { return left_; }

    void require(std::uint64_t length, const char* what) const {
        if (length > left_)
            throw std::runtime_error(fmt::format("{} of {} bytes, where {} are left", what, length, left_));
    }

    template <class Value>
    Value read() {
        Value value;
        read(&value, sizeof value);
        return value;
    }

    void read(void* to, std::uint64_t size) {
        require(size, "a number");
        in_.read(static_cast<char*>(to), std::streamsize(size));
        left_ -= size;
    }

    void skip(std::uint64_t length, const char* what) {
        require(length, what);
        in_.ignore(std::streamsize(length));
        left_ -= length;
    }

    std::string readName() {
        const auto length = read<std::uint32_t>();
        require(length, "a name");
        std::string name(length, ' ');
        read(name.data(), length);
        return name;
    }

    /// Skips bytes compressed by Blosc: `expected` decompressed bytes, or any count.
    void skipBlosc(std::uint64_t length, std::uint64_t expected) {
        struct Head {
            std::uint8_t versions[2], flags, valueSize;
            std::uint32_t bytes, blockBytes, compressed;
        };
        static_assert(sizeof(Head) == 16);
        require(length, "compressed values");
        if (length < sizeof(Head)) throw std::runtime_error("compressed values that are too short");
        const auto head = read<Head>();
        if (head.compressed != length)
            throw std::runtime_error(fmt::format("{} bytes of values that were {}", length, head.compressed));
        const bool padded = expected <= bloscPadding && head.bytes == bloscPadding;
        if ((head.bytes != expected && !padded) || head.bytes > maxExpansion * length)
            throw std::runtime_error(fmt::format("{} bytes of values, where {} are to be", head.bytes, expected));
        skip(length - sizeof(Head), "compressed values");
    }

  private:
    std::istream& in_;
    std::uint64_t left_;
};

void skipName(Stream& in) {
    in.skip(in.read<std::uint32_t>(), "a name");
}

// Skips the delayed-load metadata, which describes how to read the leaves. OpenVDB drops it, but allocates memory for
// it first.
void skipDelayedLoad(Stream& in, std::uint64_t size) {
    in.require(size, "metadata");
    const std::uint64_t end = in.left() - size;
    const auto count = in.read<std::uint32_t>();
    const auto skipList = [&](std::uint64_t itemBytes) {
        const auto compressed = in.read<std::uint32_t>();
        if (compressed == ~std::uint32_t(0)) return;
        const std::uint64_t bytes = count * itemBytes;
        compressed ? in.skipBlosc(compressed, bytes) : in.skip(bytes, "a list of leaves");
    };
    skipList(sizeof(std::int8_t));
    skipList(sizeof(std::int64_t));
    if (in.left() < end) throw std::runtime_error("a list of leaves that is too long");
    in.skip(in.left() - end, "metadata");
}

void skipMetadata(Stream& in) {
    const auto count = in.read<std::uint32_t>();
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::string name = in.readName(), type = in.readName();
        const std::uint64_t size = in.read<std::uint32_t>();
        if (type == "__delayedload") {
            skipDelayedLoad(in, size);
            continue;
        }
        // values of known types are read at their own size, whatever size is stored
        const bool fixed = type != "string" && openvdb::Metadata::isRegisteredType(type);
        const std::uint64_t expected = fixed ? openvdb::Metadata::createMetadata(type)->size() : size;
        if (size != expected)
            throw std::runtime_error(fmt::format("'{}' of {} bytes, where {} are to be", name, size, expected));
        in.skip(size, "metadata");
    }
}

// The type's name determines the count of numbers.
void skipTransform(Stream& in) {
    const std::string type = in.readName();
    constexpr std::uint64_t vector = 3 * sizeof(double), matrix = 16 * sizeof(double);
    if (type == "NonlinearFrustumMap") {
        in.skip(2 * vector + 2 * sizeof(double), "a transform");
        return skipTransform(in);
    }
    const std::pair<std::string_view, std::uint64_t> sizes[] = {{"AffineMap", matrix},
                                                                {"UnitaryMap", matrix},
                                                                {"TranslationMap", vector},
                                                                {"ScaleMap", 5 * vector},
                                                                {"UniformScaleMap", 5 * vector},
                                                                {"ScaleTranslateMap", 6 * vector},
                                                                {"UniformScaleTranslateMap", 6 * vector}};
    for (const auto& [name, size] : sizes)
        if (name == type) return in.skip(size, "a transform");
    throw std::runtime_error("a transform of unknown type");
}

/// How the values of a grid's tree are stored.
struct Values {
    std::uint64_t size;  ///< [bytes]
    bool zip, blosc, activeOnly;
    bool half;               ///< values of leaves and of tiles below the root are stored as halves
    std::uint64_t halfSize;  ///< [bytes]
};

/// The active voxels of a leaf.
using LeafMask = std::array<std::uint64_t, cube(leaf) / 64>;

std::uint64_t bitsOf(std::span<const std::uint64_t> words) {
    std::uint64_t bits = 0;
    for (const std::uint64_t word : words) bits += std::uint64_t(std::popcount(word));
    return bits;
}

// Masks are stored twice, and OpenVDB uses either.
void readLeafMask(Stream& in, const LeafMask& expected) {
    if (in.read<LeafMask>() != expected) throw std::runtime_error("a leaf with two masks");
}

/// Walks over one tree.
class Tree {
  public:
    Tree(Stream& in, const Values& values) : in_(in), values_(values) {}

    void skipTopology() {
        if (in_.read<std::int32_t>() != 1) throw std::runtime_error("a tree with more than one buffer");
        in_.skip(values_.size, "a background");
        const auto tiles = in_.read<std::uint32_t>(), children = in_.read<std::uint32_t>();
        in_.skip(tiles * (3 * sizeof(std::int32_t) + values_.size + 1), "tiles");
        Place last;
        for (std::uint32_t i = 0; i < children; ++i) {
            const auto place = in_.read<Place>();
            // leaves are read again in this order; of two nodes at one position, one is lost
            if (i > 0 && !(last < place)) throw std::runtime_error("nodes of a tree that are not in order");
            last = place;
            skipNode(coarse);
        }
    }

    void skipBuffers() {
        for (const LeafMask& expected : leaves_) {
            readLeafMask(in_, expected);
            skipValues(cube(leaf), bitsOf(expected));
        }
    }

    const std::vector<LeafMask>& leaves() const { return leaves_; }

  private:
    void skipNode(int log2) {
        const std::uint64_t children = readMask(log2), active = readMask(log2);
        skipValues(cube(log2), active);
        for (std::uint64_t i = 0; i < children; ++i) {
            if (log2 == coarse)
                skipNode(fine);
            else
                leaves_.push_back(in_.read<LeafMask>());
        }
    }

    // Returns the count of set bits.
    std::uint64_t readMask(int log2) {
        std::array<std::uint64_t, cube(coarse) / 64> words;
        const std::uint64_t count = cube(log2) / 64;
        in_.read(words.data(), count * sizeof(std::uint64_t));
        return bitsOf(std::span(words).first(count));
    }

    void skipValues(std::uint64_t count, std::uint64_t active) {
        // storage of inactive values: all of them, or the values that they have in common
        enum : std::int8_t { oneValue = 2, mask = 3, maskAndOneValue = 4, maskAndTwoValues = 5, allValues = 6 };
        const auto kind = in_.read<std::int8_t>();
        if (kind == oneValue || kind == maskAndOneValue || kind == maskAndTwoValues)
            in_.skip(values_.size * (kind == maskAndTwoValues ? 2 : 1), "an inactive value");
        if (kind == mask || kind == maskAndOneValue || kind == maskAndTwoValues) in_.skip(count / 8, "a mask");
        const std::uint64_t stored = values_.activeOnly && kind != allValues ? active : count;
        if (values_.half && stored == 0) return;
        skipBytes(stored * (values_.half ? values_.halfSize : values_.size));
    }

    void skipBytes(std::uint64_t expected) {
        if (!values_.zip && !values_.blosc) return in_.skip(expected, "values");
        const auto length = in_.read<std::int64_t>();
        if (length <= 0 && length != -std::int64_t(expected))
            throw std::runtime_error(fmt::format("{} bytes of values, where {} are to be", -length, expected));
        if (length > 0 && values_.blosc) return in_.skipBlosc(std::uint64_t(length), expected);
        in_.skip(std::uint64_t(std::abs(length)), "values");
    }

    using Place = std::array<std::int32_t, 3>;

    Stream& in_;
    Values values_;
    std::vector<LeafMask> leaves_;
};

/// Walks over the attributes of a tree's points, which are stored in passes over all leaves.
class Points {
  public:
    Points(Stream& in, const std::vector<LeafMask>& leaves) : in_(in), leaves_(leaves) {}

    void skip() {
        constexpr unsigned others = 4;  // passes that do not belong to one attribute
        const auto passes = in_.read<std::uint16_t>();
        if (passes < others || passes % 2 != 0) throw std::runtime_error("points in a wrong number of passes");
        in_.skip(leaves_.size() * sizeof(std::uint16_t), "sizes of leaves");
        readArrays();
        if (attributes() != (passes - others) / 2u) throw std::runtime_error("points in a wrong number of passes");
        for (unsigned i = 0; i < attributes(); ++i) readPages(i);
        for (const LeafMask& mask : leaves_) skipOffsets(mask);
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
            skipName(in_);
            if (in_.read<std::uint64_t>() >= count) throw std::runtime_error("an attribute that is not there");
        }
        const auto groups = in_.read<std::uint64_t>();
        for (std::uint64_t i = 0; i < groups; ++i) {
            skipName(in_);
            in_.read<std::uint64_t>();
        }
        skipMetadata(in_);
    }

    Array readArray(std::uint64_t valueSize) {
        enum : std::uint8_t { strided = 1, uniform = 2, paged = 8 };
        constexpr std::uint64_t headBytes = sizeof(std::int16_t) + sizeof(std::uint32_t);
        const auto length = in_.read<std::uint64_t>();
        in_.read<std::uint8_t>();
        const auto flags = in_.read<std::uint8_t>();
        const std::uint64_t count = in_.read<std::uint32_t>(), stride = flags & strided ? in_.read<std::uint32_t>() : 1;
        if (length <= headBytes) throw std::runtime_error("an attribute without values");
        in_.require(count * stride / maxExpansion, "an attribute");
        const Array array{length - headBytes, flags & uniform ? valueSize : count * stride * valueSize,
                          (flags & uniform) != 0, (flags & paged) != 0};
        if (array.paged && array.length != array.bytes)
            throw std::runtime_error(
                fmt::format("an attribute of {} bytes, where {} are to be", array.length, array.bytes));
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

    void skipOffsets(const LeafMask& mask) {
        constexpr std::uint64_t bytes = cube(leaf) * sizeof(std::uint32_t), uncompressed = 0xffff;
        readLeafMask(in_, mask);
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

    Stream& in_;
    const std::vector<LeafMask>& leaves_;
    std::vector<std::uint64_t> valueSizes_;  // [bytes]
    std::vector<Array> arrays_;              // all attributes of one leaf, then those of the next
    std::vector<std::vector<Page>> pages_;   // for each attribute
};

/// Returns the size of a tree's values and of their half-float form; 0 for other kinds of trees [bytes].
std::pair<std::uint64_t, std::uint64_t> valueSizes(std::string_view tree) {
    constexpr std::string_view prefix = "Tree_", nodes = "_5_4_3";
    if (!tree.starts_with(prefix) || !tree.ends_with(nodes)) return {0, 0};
    tree.remove_prefix(prefix.size());
    tree.remove_suffix(nodes.size());
    struct Kind {
        std::string_view name;
        std::uint64_t size, half;
    };
    constexpr Kind kinds[] = {{"float", 4, 2},  {"double", 8, 2}, {"int32", 4, 4},      {"int64", 8, 8},
                              {"vec3s", 12, 6}, {"vec3d", 24, 6}, {"ptdataidx32", 4, 4}};
    for (const Kind& kind : kinds)
        if (kind.name == tree) return {kind.size, kind.half};
    return {0, 0};
}

// Returns false if the storage format is unknown.
bool skipGrid(Stream& in) {
    constexpr std::string_view halfFloat = "_HalfFloat";
    constexpr std::uint64_t offsets = 3 * sizeof(std::int64_t);
    skipName(in);
    std::string type = in.readName();
    const bool half = type.ends_with(halfFloat);
    if (half) type.resize(type.size() - halfFloat.size());
    const bool instance = !in.readName().empty();  // shares the tree of another grid
    in.skip(offsets, "offsets");
    const auto compression = in.read<std::uint32_t>();
    skipMetadata(in);
    skipTransform(in);
    if (instance) return true;
    const auto [size, halfSize] = valueSizes(type);
    if (size == 0) return false;
    Tree tree(in,
              {size, (compression & openvdb::io::COMPRESS_ZIP) != 0, (compression & openvdb::io::COMPRESS_BLOSC) != 0,
               (compression & openvdb::io::COMPRESS_ACTIVE_MASK) != 0, half, halfSize});
    tree.skipTopology();
    if (type.find("ptdataidx32") != std::string::npos)
        Points(in, tree.leaves()).skip();
    else
        tree.skipBuffers();
    return true;
}

}  // namespace

void requireLengths(std::istream& stream, std::uint64_t size) {
    constexpr std::uint64_t identifier = 36;  // letters
    Stream in(stream, size);
    if (in.read<std::int64_t>() != openvdb::OPENVDB_MAGIC) throw std::runtime_error("it does not begin as one");
    const auto version = in.read<std::uint32_t>();
    constexpr std::uint32_t first = openvdb::OPENVDB_FILE_VERSION_NODE_MASK_COMPRESSION,
                            last = openvdb::OPENVDB_FILE_VERSION;
    if (version < first || version > last)
        throw std::runtime_error(fmt::format("it is of format {}; {} to {} are read", version, first, last));
    in.skip(2 * sizeof(std::uint32_t) + 1 + identifier, "a head");
    skipMetadata(in);
    const auto grids = in.read<std::uint32_t>();
    for (std::uint32_t i = 0; i < grids && skipGrid(in); ++i) continue;
}

}  // namespace bilayer::detail
