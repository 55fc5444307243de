// SPDX-License-Identifier: Apache-2.0
// A build as a whole: options, threads, and the filling of a field by the methods that the options ask for.
// Tested by tests/sdf/build.cpp and tests/sdf/rebuild.cpp through build().
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>
#include "sdf/grid/field_part.h"

namespace bilayer::detail {

struct DeviceFiller;

/// Builds a field, as build() documents.
/// @param device  fills the blocks; null: the CPU
LevelSet buildField(const Mesh& mesh, const BuildOptions& options, const DeviceFiller* device);

/// Updates a field, as rebuild() documents.
LevelSet rebuildField(const LevelSet& old, const Mesh& oldMesh, const Mesh& newMesh,
                      std::span<const std::uint32_t> moved, const BuildOptions& options);

/// Builds a part of a field from the triangles near it.
/// @param options  by Method::doubleLayer or Method::exact, where the triangles near a block determine its distances.
///                 `part.signs` says how `exact` finds signs
/// Throws as build() does, and std::invalid_argument where only the whole mesh can decide a sign.
FilledPart buildPart(const Mesh& mesh, const BuildOptions& options, const FieldPart& part);

/// Fills the blocks of a mesh's field as build() does, but builds no level set: the device keeps its results. Fills
/// again by another sign method if the device counts conflicts. Returns what the device took. Throws as build() does.
DeviceTimes fillOnly(const Mesh& mesh, const BuildOptions& options, const DeviceFiller& device);

}  // namespace bilayer::detail
