#include "sdf/vdb_io.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_reduce.h>
#include <openvdb/io/File.h>
#include <openvdb/io/Stream.h>
#include <openvdb/tree/LeafManager.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "sdf/atomic_file.h"
#include "sdf/grids.h"
#include "sdf/input_file.h"

namespace bilayer {
namespace {

/// 16-bit floats have 11 binary digits: rounding is off by this part of a number at most.
constexpr float halfRounding = 1.f / 2048;

template <class Grid>
typename Grid::ConstPtr first(const openvdb::GridPtrVec& grids, auto accept) {
    for (const auto& base : grids)
        if (auto grid = openvdb::gridPtrCast<Grid>(base); grid && accept(*grid)) return grid;
    return nullptr;
}

// Throws std::invalid_argument where a voxel holds no number, which rounding, searches and solvers would pass on.
void requireNumbers(const openvdb::FloatGrid& grid) {
    const openvdb::tree::LeafManager<const openvdb::FloatTree> leaves(grid.tree());
    const bool finite = tbb::parallel_reduce(
        leaves.leafRange(), true,
        [](const auto& range, bool so) {
            for (auto leaf = range.begin(); leaf && so; ++leaf)
                so = std::all_of(leaf->buffer().data(), leaf->buffer().data() + openvdb::FloatTree::LeafNodeType::SIZE,
                                 [](float value) { return std::isfinite(value); });
            return so;
        },
        std::logical_and<>());
    if (!finite)
        throw std::invalid_argument(fmt::format("grid '{}' holds a distance that is no finite number", grid.getName()));
}

/// What our files end with, behind all that OpenVDB reads: damage is found before it gets to see it, since its decoder
/// of Blosc blocks trusts them.
constexpr std::string_view sealName = "bilayer crc32 ";
constexpr std::size_t sealSize = sealName.size() + 9;  // eight digits and a line feed
// So many of its letters are no chance. Of a file that ends with fewer nothing else is missing.
constexpr std::size_t leastOfSeal = 4;

std::string sealOf(std::istream& stream, std::uintmax_t size) {
    std::vector<char> piece(std::size_t(1) << 20);
    uLong sum = crc32(0, nullptr, 0);
    while (size > 0) {
        const auto count = std::size_t(std::min<std::uintmax_t>(size, piece.size()));
        stream.read(piece.data(), std::streamsize(count));
        sum = crc32(sum, reinterpret_cast<const Bytef*>(piece.data()), uInt(count));
        size -= count;
    }
    return fmt::format("{}{:08x}\n", sealName, sum);
}

std::ifstream opened(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    stream.exceptions(std::ios::failbit | std::ios::badbit);
    return stream;
}

void seal(const std::filesystem::path& path) {
    std::ifstream written = opened(path);
    const std::string end = sealOf(written, std::filesystem::file_size(path));
    std::ofstream stream(path, std::ios::binary | std::ios::app);
    stream.exceptions(std::ios::failbit | std::ios::badbit);
    stream << end;
    stream.close();
}

/// Files of others have no seal. Throws std::runtime_error where there is one, or the beginning of one, that does not
/// hold or is not the end.
void requireSeal(const std::filesystem::path& path) {
    const std::uintmax_t size = std::filesystem::file_size(path);
    std::ifstream stream = opened(path);
    // more than the seal: bytes may have come behind it
    std::string end(std::size_t(std::min<std::uintmax_t>(size, 4 * sealSize)), ' ');
    stream.seekg(std::streamoff(size - end.size()));
    stream.read(end.data(), std::streamsize(end.size()));
    for (std::size_t kept = sealName.size() - 1; kept >= leastOfSeal; --kept)
        if (end.ends_with(sealName.substr(0, kept))) throw std::runtime_error("its end is missing");
    const std::size_t at = end.rfind(sealName);
    if (at == std::string::npos) return;
    stream.seekg(0);
    if (sealOf(stream, size - end.size() + at) != end.substr(at))
        throw std::runtime_error("it is not as it was written");
}

}  // namespace

void writeGrids(const std::filesystem::path& path, const openvdb::GridCPtrVec& grids) {
    AtomicFile file(path);
    try {
        std::ofstream stream(file.temporary(), std::ios::binary);
        stream.exceptions(std::ios::failbit | std::ios::badbit);
        openvdb::io::Stream(stream).write(grids);
        stream.close();
        seal(file.temporary());
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
    // a shallow copy, since how distances are stored is a property of the grid
    const auto distance = openvdb::ConstPtrCast<openvdb::FloatGrid>(levelSet.grids().distance)->copy();
    distance->setSaveFloatAsHalf(options.halfFloat);
    if (options.halfFloat && distance->getMetadata<openvdb::FloatMetadata>(metadata::errorBound))
        distance->insertMeta(metadata::errorBound, openvdb::FloatMetadata(storedErrorBound(levelSet, options)));
    openvdb::GridCPtrVec grids{distance};
    if (levelSet.grids().triangle) grids.push_back(levelSet.grids().triangle);
    if (levelSet.grids().points) grids.push_back(levelSet.grids().points);
    writeGrids(path, grids);
}

LevelSet readVdb(const std::filesystem::path& path) {
    openvdb::initialize();
    requireInputFile(path);
    openvdb::GridPtrVec grids;
    try {
        requireSeal(path);
        std::ifstream stream = opened(path);
        // delayed loading would leave the values, and any damage to them, in the file
        grids = *openvdb::io::Stream(stream, /*delayLoad=*/false).getGrids();
    } catch (const std::exception& error) {
        throw std::runtime_error(fmt::format("{}: is no .vdb file or is damaged ({})", path.string(), error.what()));
    }
    auto result = std::make_shared<Grids>();
    result->distance = first<openvdb::FloatGrid>(
        grids, [](const auto& grid) { return grid.getGridClass() == openvdb::GRID_LEVEL_SET; });
    if (!result->distance) throw std::runtime_error(fmt::format("{}: holds no level set", path.string()));
    result->triangle = first<openvdb::Int32Grid>(grids, [](const auto& grid) { return grid.getName() == "triangle"; });
    for (const auto& grid : grids)
        if (grid->getName() == contactPoints) result->points = grid;
    try {
        requireNumbers(*result->distance);
        return LevelSet(std::move(result));
    } catch (const std::invalid_argument& error) {
        throw std::runtime_error(fmt::format("{}: {}", path.string(), error.what()));
    }
}

}  // namespace bilayer
