// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/sign_retry.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include <bilayer/sdf/inspect.h>
#include "sdf/base/stopwatch.h"
#include "sdf/grid/field_filler.h"
#include "sdf/mesh/orient.h"
#include "sdf/sign/sign_choice.h"

namespace bilayer::detail {
namespace {

bool isKnownToIntersectItself(const BuildOptions& options) {
    return options.inspected && options.inspected->selfIntersections > 0;
}

// Returns whether normals fail to give signs: they contradict each other, or cancel out on coincident faces with
// opposite orientations. If such faces have different diagonals, they share no triangle, but winding numbers find no
// volume between them.
bool contradictory(const FieldSigns& signs, const Mesh& mesh, Progress& progress) {
    if (signs.conflicts > 0) return true;
    if (signs.undecided == 0 || foldsBack(mesh, &progress)) return false;
    return hasFacesBackToBack(mesh, &progress) || chooseSignOfSolid(mesh, &progress).sign == Sign::flood;
}

}  // namespace

// With normals, the pseudonormal method uses the signs of the exact method. The two methods round equal distances
// differently, so their conflict counts would differ.
void fillWithAutomaticSign(FieldFiller& filler) {
    Stopwatch part;
    const Method method = filler.options().method;
    Progress& progress = filler.progress();
    SignChoice choice = chooseSign(filler.mesh(), &progress);
    if (choice.sign == Sign::normals && !choice.repaired && isKnownToIntersectItself(filler.options()))
        choice = chooseSignAfterConflict(filler.mesh(), &progress);
    filler.times().tiles += part.lap();
    for (;;) {
        // Kept alive during the next selection, which may use it.
        const std::optional<Mesh> repaired = std::move(choice.repaired);
        const Mesh& mesh = repaired ? *repaired : filler.mesh();
        const bool borrows = choice.sign == Sign::normals && method == Method::pseudonormal;
        const Sign sign = filler.fill(mesh, choice.sign, choice.reason, borrows ? Method::exact : method);
        if (sign != Sign::normals || !contradictory(filler.signs(), mesh, progress)) {
            if (borrows && sign == Sign::normals) filler.fillWithSidesOfLast(mesh, choice.reason);
            return;
        }
        choice = chooseSignAfterConflict(mesh, &progress);
        if (!choice.repaired && repaired) choice.repaired = *repaired;
    }
}

void fillWithRequestedSign(FieldFiller& filler) {
    const BuildOptions& options = filler.options();
    filler.fill(filler.mesh(), options.sign, asAskedFor, options.method);
    if (options.sign != Sign::normals || filler.signs().conflicts == 0) return;
    const Orientation orientation = orient(filler.mesh(), &filler.progress());
    if (orientation.flippedTriangles > 0)
        filler.fill(orientation.mesh, Sign::normals,
                    fmt::format("as asked for, with {} triangles flipped", orientation.flippedTriangles),
                    options.method);
}

}  // namespace bilayer::detail
