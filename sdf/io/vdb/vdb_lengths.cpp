// SPDX-License-Identifier: Apache-2.0
// The format is that of OpenVDB's io::Archive, versions 222 to 224.
#include "sdf/io/vdb/vdb_lengths.h"

#include <fmt/format.h>
#include <openvdb/io/Compression.h>
#include <openvdb/version.h>

#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sdf/base/openvdb.h"
#include "sdf/io/vdb/vdb_points.h"
#include "sdf/io/vdb/vdb_stream.h"
#include "sdf/io/vdb/vdb_tree.h"

namespace bilayer::detail {
namespace {

// The type's name determines the count of numbers.
void skipTransform(VdbStream& in) {
    std::string type = in.readName();
    constexpr std::uint64_t vector = 3 * sizeof(double), matrix = 16 * sizeof(double);
    if (type == "NonlinearFrustumMap") {
        in.skip(2 * vector + 2 * sizeof(double), "a transform");
        // of a second map, which is linear: OpenVDB would read frustums within frustums by recursion
        type = in.readName();
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

/// Returns the size of a tree's values and of their half-float form; 0 for other kinds of trees [bytes].
std::pair<std::uint64_t, std::uint64_t> valueSizes(std::string_view tree) {
    constexpr std::string_view prefix = "Tree_", nodes = "_5_4_3";
    if (!tree.starts_with(prefix) || !tree.ends_with(nodes)) return {0, 0};
    tree.remove_prefix(prefix.size());
    tree.remove_suffix(nodes.size());
    struct TreeType {
        std::string_view name;
        std::uint64_t size, half;
    };
    constexpr TreeType types[] = {{"float", 4, 2},  {"double", 8, 2}, {"int32", 4, 4},      {"int64", 8, 8},
                                  {"vec3s", 12, 6}, {"vec3d", 24, 6}, {"ptdataidx32", 4, 4}};
    for (const TreeType& type : types)
        if (type.name == tree) return {type.size, type.half};
    return {0, 0};
}

// Returns false if the storage format is unknown.
bool skipGrid(VdbStream& in) {
    constexpr std::string_view halfFloat = "_HalfFloat";
    constexpr std::uint64_t offsets = 3 * sizeof(std::int64_t);
    in.skipName();
    std::string type = in.readName();
    const bool half = type.ends_with(halfFloat);
    if (half) type.resize(type.size() - halfFloat.size());
    const bool instance = !in.readName().empty();  // shares the tree of another grid
    in.skip(offsets, "offsets");
    const auto compression = in.read<std::uint32_t>();
    in.skipMetadata();
    skipTransform(in);
    if (instance) return true;
    const auto [size, halfSize] = valueSizes(type);
    if (size == 0) return false;
    const VdbValueFormat format{size,
                                (compression & openvdb::io::COMPRESS_ZIP) != 0,
                                (compression & openvdb::io::COMPRESS_BLOSC) != 0,
                                (compression & openvdb::io::COMPRESS_ACTIVE_MASK) != 0,
                                half,
                                halfSize};
    const std::vector<VdbLeafMask> leaves = skipVdbTopology(in, format);
    if (type.find("ptdataidx32") != std::string::npos)
        skipVdbPoints(in, leaves);
    else
        skipVdbLeaves(in, format, leaves);
    return true;
}

}  // namespace

void requireLengths(std::istream& stream, std::uint64_t size) {
    constexpr std::uint64_t identifier = 36;  // letters
    VdbStream in(stream, size);
    if (in.read<std::int64_t>() != openvdb::OPENVDB_MAGIC)
        throw std::runtime_error("its first bytes are not those of one");
    const auto version = in.read<std::uint32_t>();
    constexpr std::uint32_t first = openvdb::OPENVDB_FILE_VERSION_NODE_MASK_COMPRESSION,
                            last = openvdb::OPENVDB_FILE_VERSION;
    if (version < first || version > last)
        throw std::runtime_error(fmt::format("it is of format {}; {} to {} are read", version, first, last));
    in.skip(2 * sizeof(std::uint32_t) + 1 + identifier, "a header");
    in.skipMetadata();
    const auto grids = in.read<std::uint32_t>();
    for (std::uint32_t i = 0; i < grids && skipGrid(in); ++i) continue;
}

}  // namespace bilayer::detail
