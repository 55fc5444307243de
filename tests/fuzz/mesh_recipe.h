// SPDX-License-Identifier: Apache-2.0
// Meshes made of the bytes of a fuzzer: small, structured, with all kinds of defects.
#pragma once

#include <bilayer/sdf/mesh.h>
#include "tests/fuzz/byte_source.h"

namespace bilayer::test {

/// A mesh of at most 500 triangles within a box of side 2 around the origin, then moved and scaled. It may be closed or
/// open, self-intersecting, inside out, without area or empty.
Mesh meshOf(ByteSource& bytes);

/// Changes some points and triangles of a mesh: moves, flips, removes, duplicates, splits or collapses them.
void damageMesh(Mesh& mesh, ByteSource& bytes);

}  // namespace bilayer::test
