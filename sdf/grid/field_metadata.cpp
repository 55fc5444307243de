// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/field_metadata.h"
#include "sdf/base/method_names.h"
#include "sdf/base/openvdb.h"

#include <fmt/format.h>

#include <cstdint>
#include <stdexcept>

#include <bilayer/sdf/grids.h>
#include "sdf/leaf/build_options.h"
#include "sdf/sign/sign_choice.h"

namespace bilayer::detail {

void describe(openvdb::FloatGrid& grid, const glm::dvec3& origin, std::uint64_t meshHash, const BuildOptions& options,
              const FieldSigns& signs) {
    grid.setTransform(openvdb::math::Transform::createLinearTransform(options.voxelSize));
    grid.setName("distance");
    grid.setGridClass(openvdb::GRID_LEVEL_SET);
    grid.setCreator("bilayer");
    grid.insertMeta(metadata::version, openvdb::StringMetadata(BILAYER_VERSION));
    grid.insertMeta(metadata::method, openvdb::StringMetadata(nameOf(options.method)));
    grid.insertMeta(metadata::sign, openvdb::StringMetadata(signs.name));
    grid.insertMeta(metadata::signReason, openvdb::StringMetadata(signs.reason));
    grid.insertMeta(metadata::signConflicts, openvdb::Int64Metadata(std::int64_t(signs.conflicts)));
    grid.insertMeta(metadata::signUndecided, openvdb::Int64Metadata(std::int64_t(signs.undecided)));
    grid.insertMeta(metadata::errorBound, openvdb::FloatMetadata(errorBound(options) * options.voxelSize));
    grid.insertMeta(metadata::meshHash, openvdb::Int64Metadata(std::int64_t(meshHash)));
    grid.insertMeta(metadata::interiorWidth, openvdb::FloatMetadata(options.interiorWidthVoxels * options.voxelSize));
    if (origin != glm::dvec3(0))
        grid.insertMeta(metadata::origin, openvdb::Vec3DMetadata({origin.x, origin.y, origin.z}));
}

void checkFieldOf(const LevelSet& field, const Mesh& mesh, const BuildOptions& options) {
    const auto refuse = [](const std::string& why) { throw std::invalid_argument("the level set " + why); };
    const BandWidths widths = bandOf(options);
    if (field.voxelSize() != options.voxelSize)
        refuse(fmt::format("has voxels of {:g} m, and the options have {:g} m", field.voxelSize(), options.voxelSize));
    if (field.exteriorWidth() != widths.exterior * widths.voxelSize ||
        field.interiorWidth() != widths.interior * widths.voxelSize)
        refuse(fmt::format("has a band {:g} m wide outside and {:g} m inside, and the options have {:g} m and {:g} m",
                           field.exteriorWidth(), field.interiorWidth(), widths.exterior * widths.voxelSize,
                           widths.interior * widths.voxelSize));
    if (field.method() != nameOf(options.method))
        refuse(fmt::format("is of the method '{}', and the options have '{}'", field.method(), nameOf(options.method)));
    if (options.triangles && !field.grids().triangle) refuse("lacks the nearest triangles");
    if (field.meshHash() != hash(mesh))
        refuse(fmt::format("is of another mesh: its hash is {:016x}, that of this one {:016x}", field.meshHash(),
                           hash(mesh)));
    if (field.origin() != mesh.origin) refuse("has another origin than the mesh");
}

bool hasCleanNormalSigns(const LevelSet& field, const BuildOptions& options) {
    const openvdb::FloatGrid& grid = *field.grids().distance;
    const auto text = [&](const char* key) {
        const auto meta = grid.getMetadata<openvdb::StringMetadata>(key);
        return meta ? meta->value() : std::string();
    };
    const auto isNone = [&](const char* key) {
        const auto meta = grid.getMetadata<openvdb::Int64Metadata>(key);
        return meta && meta->value() == 0;
    };
    const std::string reason = text(metadata::signReason);
    // A different error bound shows that the distances were swept or rounded since the build.
    return text(metadata::version) == BILAYER_VERSION &&
           field.errorBound() == errorBound(options) * options.voxelSize &&
           text(metadata::sign) == nameOf(Sign::normals) && (reason == asRequested || reason == closedAndOriented) &&
           isNone(metadata::signConflicts) && isNone(metadata::signUndecided);
}

}  // namespace bilayer::detail
