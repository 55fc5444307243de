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

// Returns another sign method if normals fail to give signs: they contradict each other, or cancel out on coincident
// faces with opposite orientations.
// - At the rim of a double-sided open surface, such faces share an edge. The surface encloses nothing, and its normals
//   stay. If it is closed but for small holes, it is a solid whose every face exists twice, and orient() flips one
//   half.
// - If the two copies have different diagonals, they share no triangle, but winding numbers find no volume between
//   them.
std::optional<SignChoice> otherChoice(const FieldSigns& signs, const Mesh& mesh, Progress& progress) {
    if (signs.conflicts > 0) return chooseSignAfterConflict(mesh, &progress);
    if (signs.undecided == 0) return std::nullopt;
    const bool folds = foldsBack(mesh, &progress);
    const bool isDoubled =
        hasFacesBackToBack(mesh, &progress) || (!folds && chooseSignOfSolid(mesh, &progress).sign == Sign::flood);
    if (!isDoubled) return std::nullopt;
    SignChoice other = chooseSignAfterConflict(mesh, &progress);
    const bool isSolid = other.repaired && other.sign != Sign::flood;
    return folds && !isSolid ? std::nullopt : std::optional(std::move(other));
}

}  // namespace

// With normals, the pseudonormal method uses the signs of the exact method. The two methods round equal distances
// differently, so their conflict counts would differ.
void fillWithAutomaticSign(FieldFiller& filler) {
    Stopwatch watch;
    const Method method = filler.options().method;
    Progress& progress = filler.progress();
    SignChoice choice = chooseSign(filler.mesh(), &progress);
    if (choice.sign == Sign::normals && !choice.repaired && isKnownToIntersectItself(filler.options()))
        choice = chooseSignAfterConflict(filler.mesh(), &progress);
    filler.times().prepare += watch.lap();
    for (;;) {
        // Kept alive during the next selection, which may use it.
        const std::optional<Mesh> repaired = std::move(choice.repaired);
        const Mesh& mesh = repaired ? *repaired : filler.mesh();
        const bool borrows = choice.sign == Sign::normals && method == Method::pseudonormal;
        const Sign sign = filler.fill(mesh, choice.sign, choice.reason, borrows ? Method::exact : method);
        watch.lap();
        auto other = sign == Sign::normals ? otherChoice(filler.signs(), mesh, progress) : std::nullopt;
        filler.times().prepare += watch.lap();
        if (!other) {
            if (borrows && sign == Sign::normals) filler.fillWithSidesOfLast(mesh, choice.reason);
            return;
        }
        choice = std::move(*other);
        const bool staysWhole = choice.sign == Sign::winding && !choice.repaired && !borrows;
        if (staysWhole && filler.signAgainByWinding(mesh, choice.reason)) return;
        if (!choice.repaired && repaired) choice.repaired = *repaired;
    }
}

void fillWithRequestedSign(FieldFiller& filler) {
    const BuildOptions& options = filler.options();
    filler.fill(filler.mesh(), options.sign, asRequested, options.method);
    if (options.sign != Sign::normals || filler.signs().conflicts == 0) return;
    const Orientation orientation = orient(filler.mesh(), &filler.progress());
    if (orientation.flippedTriangles > 0)
        filler.fill(orientation.mesh, Sign::normals,
                    fmt::format("as asked for, with {} triangles flipped", orientation.flippedTriangles),
                    options.method);
}

}  // namespace bilayer::detail
