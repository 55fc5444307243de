// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/tile_signs.h"

#include <fmt/format.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "sdf/base/method_names.h"
#include "sdf/leaf/build_options.h"

namespace bilayer::detail {
namespace {

[[noreturn]] void refuseOpen(const std::string& why) {
    throw std::invalid_argument(fmt::format(
        "tiles have winding numbers of closed and oriented meshes only, since those of others are sums over all "
        "triangles: {}; build this field in one piece",
        why));
}

PartSigns byWinding(const std::string& reason) {
    return {.method = Sign::winding, .reason = reason};
}

PartSigns byNormals(const std::string& reason) {
    return {.method = Sign::normals, .reason = reason, .check = NormalsCheck::count};
}

bool isAutomatic(const BuildOptions& options) {
    return !hasOwnSigns(options.method) && options.sign == Sign::automatic;
}

// The signs that were asked for.
PartSigns requested(const BuildOptions& options, const TriangleSource& source) {
    if (hasOwnSigns(options.method)) return {};
    if (options.sign == Sign::flood) return {.method = Sign::flood};
    if (options.sign != Sign::winding) return {};
    if (!source.isBalanced()) refuseOpen("this one has edges that are not used equally often in both directions");
    return byWinding(asRequested);
}

// The choice of build() after normals have contradicted each other so often.
SignChoice choiceInRound(const Mesh& mesh, int round) {
    SignChoice choice = chooseSign(mesh);
    for (int i = 0; i < round; ++i) {
        SignChoice other = chooseSignAfterConflict(choice.repaired ? *choice.repaired : mesh);
        if (!other.repaired) other.repaired = std::move(choice.repaired);
        choice = std::move(other);
    }
    return choice;
}

PartSigns signsOf(const SignChoice& choice, const Mesh& mesh) {
    if (choice.sign == Sign::normals) return byNormals(choice.reason);
    if (choice.sign == Sign::winding && balanced(mesh)) return byWinding(choice.reason);
    if (choice.sign == Sign::winding) refuseOpen("the sign auto is winding here, because of " + choice.reason);
    return {.method = Sign::flood, .reason = choice.reason};
}

}  // namespace

SignedSource decideSigns(Mesh mesh, const BuildOptions& options, int round,
                         const std::function<void()>& beforeOrienting) {
    if (!isAutomatic(options)) {
        auto source = trianglesOf(std::move(mesh));
        const PartSigns signs = requested(options, *source);
        return {std::move(source), signs};
    }
    if (round == 0 && balanced(mesh)) return {trianglesOf(std::move(mesh)), byNormals(closedAndOriented)};
    beforeOrienting();
    const std::uint64_t known = hash(mesh);
    SignChoice choice = choiceInRound(mesh, round);
    if (choice.repaired) mesh = std::move(*choice.repaired);
    const PartSigns signs = signsOf(choice, mesh);
    return {trianglesOf(std::move(mesh), known), signs};
}

SignedSource decideSigns(std::unique_ptr<TriangleSource> source, const BuildOptions& options, int round) {
    if (!isAutomatic(options)) {
        const PartSigns signs = requested(options, *source);
        return {std::move(source), signs};
    }
    const char* advice =
        "the sign auto would orient the whole mesh, which is not read whole: allow more memory, or take "
        "another sign";
    if (round > 0) throw std::invalid_argument(fmt::format("the normals contradict each other, and {}", advice));
    if (!source->isBalanced())
        throw std::invalid_argument(fmt::format("edges are not used equally often in both directions, and {}", advice));
    return {std::move(source), byNormals(closedAndOriented)};
}

BuildOptions optionsWith(BuildOptions options, const PartSigns& signs) {
    if (signs.method == Sign::flood) options.sign = Sign::flood;
    return options;
}

SignVerdict judge(const SignCounts& sum) {
    if (sum.conflicts > 0) return SignVerdict::conflict;
    const SignRepair &some = sum.compared.everyFifth, &all = sum.compared.all;
    // as repairSigns() does
    const SignRepair& first = sum.compared.leaves > fewLeaves ? some : all;
    if (first.repaired + first.refused == 0) return SignVerdict::right;
    return all.refused > 0 ? SignVerdict::conflict : SignVerdict::wrong;
}

SignCounts sumOf(std::span<const SignCounts> counts) {
    SignCounts sum;
    for (const SignCounts& one : counts) {
        sum.conflicts += one.conflicts;
        sum.compared.leaves += one.compared.leaves;
        sum.compared.everyFifth += one.compared.everyFifth;
        sum.compared.all += one.compared.all;
    }
    return sum;
}

PartSigns corrected(const PartSigns& counted, const SignCounts& sum) {
    PartSigns signs = counted;
    signs.check = NormalsCheck::correct;
    signs.reason = repairedReason(counted.reason, sum.compared.all.repaired);
    signs.name = nameOf(Sign::winding);
    return signs;
}

}  // namespace bilayer::detail
