// SPDX-License-Identifier: Apache-2.0
// Storage of a body's mesh as a metadata entry of the distance grid.
// Tested by tests/collider/body.cpp through withBody().
#pragma once

#include <bilayer/sdf/mesh.h>
#include <openvdb/Metadata.h>

#include <memory>

namespace bilayer::detail {

/// The name of the entry.
inline constexpr const char* meshEntry = "bilayer:mesh";

/// The entry of a mesh, without its origin. Throws std::invalid_argument for a mesh larger than 2 GiB.
openvdb::Metadata::Ptr packMesh(const Mesh& mesh);

/// The mesh of an entry. Throws std::invalid_argument unless it is what packMesh() has made of a valid mesh.
std::shared_ptr<Mesh> unpackMesh(const openvdb::Metadata& entry);

}  // namespace bilayer::detail
