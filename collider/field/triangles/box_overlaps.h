// SPDX-License-Identifier: Apache-2.0
// Overlaps of boxes with the triangles of a mesh. SIMD tests in single precision reject triangles conservatively;
// double precision and the mesh's own vertices decide (triangle_tests.h). May run on any number of threads at once, and
// allocates nothing.
// Tested by tests/collider/field_overlaps.cpp through Field::overlapsBox().
#pragma once

#include "collider/field/triangles/mesh_tree.h"
#include "collider/field/triangles/triangle_tests.h"

namespace bilayer::detail {

/// Whether a box overlaps a triangle [m].
bool meetsTriangle(const MeshTree& mesh, const RotatedBox& box) noexcept;

}  // namespace bilayer::detail
