// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/vdb_io.h>

#include <algorithm>
#include <memory>
#include <ostream>
#include <string>
#include <utility>

#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"
#include "sdf/grid/distance_check.h"
#include "sdf/grid/vdb_grids.h"
#include "sdf/io/atomic_file.h"
#include "sdf/io/input_file.h"
#include "sdf/io/vdb/vdb_archive.h"
#include "sdf/io/vdb/vdb_checksum.h"

namespace bilayer {

using namespace detail;

openvdb::GridBase::Ptr inWorld(const openvdb::GridBase::ConstPtr& grid, const LevelSet& levelSet) {
    return withOrigin(grid, levelSet.origin());
}

void writeGrids(const std::filesystem::path& path, const openvdb::GridCPtrVec& grids) {
    writeWhole(path, [&](std::ostream& stream) {
        ChecksumBuffer buffer(*stream.rdbuf());
        std::ostream archive(&buffer);
        archive.exceptions(std::ios::failbit | std::ios::badbit);
        writeArchive(archive, grids);
        stream << buffer.line();
    });
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
    std::shared_ptr<Grids> grids = readGrids(path);
    return namingFile(path, [&] {
        LevelSet levelSet(std::move(grids));
        requireValidDistances(*levelSet.grids().distance, levelSet.interiorWidth());
        return levelSet;
    });
}

}  // namespace bilayer
