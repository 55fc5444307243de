// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/unite.h"

#include <cstdlib>
#include <utility>

#include "sdf/bvh/winding_number.h"
#include "sdf/mesh/surface_pieces.h"

namespace bilayer::detail {
namespace {

/// Surfaces closer than this count as touching, relative to the max coordinate: one unit in the last place of a float.
/// Walls between solids that lie flush but for rounding are then removed.
constexpr double touching = 2.5e-7;
/// The same where surfaces lie exactly where their floats say. Pieces of two surfaces may disagree on whether they
/// touch if the surfaces are nearly this close. Below, winding numbers on the two sides of slivers would be rounding
/// noise.
constexpr double coincident = 2e-12;

}  // namespace

UnionSurface unite(const Mesh& mesh, Progress* progress) {
    validate(mesh);
    SurfacePieces pieces(mesh, touching, progress);
    if (pieces.isSinglePatch()) return {mesh, 0, 0};
    const WindingNumber winding(mesh, progress);
    pieces.label([&](const glm::dvec3& front, const glm::dvec3& behind) {
        const bool buried = winding.isInside(front) && winding.isInside(behind);
        return buried ? 0 : 1;
    });
    UnionSurface united{pieces.labelled().mesh, 0, 0};
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
        if (!pieces.remains(i))
            ++united.buriedTriangles;
        else if (!pieces.isWhole(i))
            ++united.cutTriangles;
    return united;
}

LabelledMesh unionBoundary(const Mesh& closed, Progress* progress) {
    validate(closed);
    SurfacePieces pieces(closed, coincident, progress);
    const WindingNumber winding(closed, progress);
    pieces.label([&](const glm::dvec3& front, const glm::dvec3& behind) {
        const int before = winding.nearestInteger(front), after = winding.nearestInteger(behind);
        return (before > 0) == (after > 0) ? 0 : std::abs(after - before);
    });
    return pieces.labelled();
}

}  // namespace bilayer::detail
