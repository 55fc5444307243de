// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/unite.h"

#include <cstdlib>
#include <utility>

#include "sdf/mesh/surface_pieces.h"

namespace bilayer::detail {
namespace {

/// Surfaces closer than this count as touching, relative to the max coordinate. Rounding to floats moves two flush
/// surfaces apart by at most sqrt(3) units in the last place, 2.1e-7. The walls between them are removed.
constexpr double flushDistance = 2.5e-7;
/// The same where surfaces lie exactly where their floats say: above the rounding of doubles.
constexpr double coincident = 2e-12;

}  // namespace

UnionSurface unite(const Mesh& mesh, Progress* progress) {
    validate(mesh);
    SurfacePieces pieces(mesh, flushDistance, progress);
    if (pieces.isSinglePatch()) return {mesh, 0, 0};
    pieces.label([](const SideNumbers& sides) { return sides.front > 0 && sides.behind > 0 ? 0 : 1; });
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
    pieces.label([](const SideNumbers& sides) {
        return (sides.front > 0) == (sides.behind > 0) ? 0 : std::abs(sides.behind - sides.front);
    });
    return pieces.labelled();
}

}  // namespace bilayer::detail
