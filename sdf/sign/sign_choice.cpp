// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/sign_choice.h"

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>

#include <cstdint>
#include <functional>
#include <glm/geometric.hpp>
#include <span>
#include <stdexcept>
#include <utility>

#include "sdf/mesh/orient.h"
#include "sdf/mesh/side_classification.h"
#include "sdf/mesh/topology.h"
#include "sdf/mesh/unite.h"

namespace bilayer::detail {
namespace {

/// Maximum fraction of the area that may bound no volume, for winding numbers to be meaningful. Of the 35 public meshes
/// that stay open or broken after orienting, 24 have less than 0.1. The others (triangle soups, open surfaces,
/// furniture with single-sided walls) have 0.2 or more.
constexpr double maxUnboundedShare = 0.15;

constexpr const char* unionOfSolids = "union of overlapping solids";

std::string describeEdgeDefects(const Mesh& mesh, Progress* progress) {
    std::size_t boundary = 0, odd = 0, misoriented = 0;
    Topology(mesh, progress).forEachEdge([&](std::span<const EdgeUse> uses) {
        int net = 0;
        for (const EdgeUse& use : uses) net += use.direction();
        boundary += uses.size() == 1;
        odd += uses.size() > 2 && net != 0;
        misoriented += uses.size() == 2 && net != 0;
    });
    std::string text;
    const auto add = [&](std::size_t count, const char* what) {
        if (count) text += fmt::format("{}{} {}{}", text.empty() ? "" : ", ", count, what, count == 1 ? "" : "s");
    };
    add(boundary, "boundary edge");
    add(odd, "unbalanced non-manifold edge");
    add(misoriented, "misoriented edge");
    return text;
}

std::string percent(double part) {
    return fmt::format("{:.0f} %", 100 * part);
}

std::string describeFlips(const Orientation& orientation) {
    return orientation.flippedTriangles ? fmt::format("; {} triangles were flipped", orientation.flippedTriangles) : "";
}

// Selects normals for a mesh that flipping triangles has closed, else winding numbers if they separate the sides.
SignChoice chooseFor(Orientation orientation, std::string trouble, Progress* progress) {
    SignChoice choice;
    trouble += describeFlips(orientation);
    const bool closed = balanced(orientation.mesh, progress);
    const bool oneSided = 2 * orientation.oneSidedTriangles > orientation.mesh.triangles.size();
    const Bounding share = bounding(orientation.mesh, progress, closed);
    const bool separates = !oneSided && share.nothing + share.reversed <= maxUnboundedShare;
    if (orientation.flippedTriangles) choice.repaired = std::move(orientation.mesh);
    choice.sign = !separates ? Sign::flood : closed && choice.repaired ? Sign::normals : Sign::winding;
    if (choice.sign == Sign::normals)
        choice.reason =
            fmt::format("closed, and oriented after {} triangles were flipped", orientation.flippedTriangles);
    else if (oneSided)
        choice.reason = trouble + "; most of the surface has one side only";
    else
        choice.reason = fmt::format("{}; winding numbers separate inside from outside on {}{} of the surface", trouble,
                                    separates ? "" : "only ", percent(share.solid + share.buried));
    return choice;
}

}  // namespace

std::string unionReason(const UnionSurface& united) {
    return fmt::format("{}: {} triangles are buried, {} in part", unionOfSolids, united.buriedTriangles,
                       united.cutTriangles);
}

std::string repairedReason(const std::string& reasonOfNormals, std::size_t voxels) {
    return fmt::format(
        "{}, but the surface touches or intersects itself; {} voxels have the side of their winding number",
        reasonOfNormals, voxels);
}

bool balanced(const Mesh& mesh, Progress* progress) {
    const std::vector<std::uint64_t> vertices = hashVertices(mesh, progress);
    // Sums modulo 2^64 do not depend on the order.
    const std::uint64_t sum = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, mesh.triangles.size(), 4096), std::uint64_t(0),
        [&](const auto& range, std::uint64_t part) {
            poll(progress);
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                const glm::uvec3& t = mesh.triangles[i];
                const std::uint64_t a = vertices[t.x], b = vertices[t.y], c = vertices[t.z];
                part += hashEdge(a, b) + hashEdge(b, c) + hashEdge(c, a);
            }
            return part;
        },
        std::plus<>());
    return sum == 0;
}

bool hasFacesBackToBack(const Mesh& mesh, Progress* progress) {
    const Topology topology(mesh, progress);
    for (const unsigned i : Polled(mesh.triangles.size(), progress))
        if (topology.proper(i) && topology.facesOpposite(i, topology.original[i])) return true;
    return false;
}

bool foldsBack(const Mesh& mesh, Progress* progress) {
    constexpr double straightBack = -1 + 1e-6;  // cosine between two normals
    const auto areaOf = [&](const glm::uvec3& t) {
        const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
        return glm::cross(b - a, c - a);
    };
    bool found = false;
    Topology(mesh, progress).forEachEdge([&](std::span<const EdgeUse> uses) {
        if (uses.size() != 2 || uses[0].forward == uses[1].forward) return;
        const glm::dvec3 a = areaOf(mesh.triangles[uses[0].triangle]), b = areaOf(mesh.triangles[uses[1].triangle]);
        found |= glm::dot(a, b) < straightBack * glm::length(a) * glm::length(b);
    });
    return found;
}

SignChoice chooseSign(const Mesh& mesh, Progress* progress) {
    validate(mesh);
    if (balanced(mesh, progress)) return {Sign::normals, closedAndOriented, {}};
    return chooseFor(orient(mesh, progress), describeEdgeDefects(mesh, progress), progress);
}

SignChoice chooseSignOfSolid(const Mesh& mesh, Progress* progress) {
    const SignChoice choice = chooseSign(mesh, progress);
    if (choice.sign != Sign::normals || choice.repaired || bounding(mesh, progress, true).nothing <= maxUnboundedShare)
        return choice;
    return chooseFor(orient(mesh, progress), "closed and oriented, but of two-sided open surfaces", progress);
}

SignChoice chooseSignAfterConflict(const Mesh& mesh, Progress* progress) {
    const char* trouble =
        hasFacesBackToBack(mesh, progress) ? "faces lie back to back" : "the surface touches or intersects itself";
    return chooseFor(orient(mesh, progress), fmt::format("closed and oriented, but {}", trouble), progress);
}

Mesh orientedMesh(const LevelSet& levelSet, Mesh mesh) {
    validate(mesh);
    if (levelSet.meshHash() != 0 && levelSet.meshHash() != hash(mesh))
        throw std::invalid_argument(
            fmt::format("the level set is of another mesh: its hash is {:016x}, that of this one {:016x}",
                        levelSet.meshHash(), hash(mesh)));
    if (levelSet.origin() != mesh.origin)
        throw std::invalid_argument("the level set has another origin than the mesh: one of them was moved");
    const std::string& reason = levelSet.signReason();
    const bool asItStands = reason == closedAndOriented || reason == asRequested;
    if (levelSet.sign() == "normals" && asItStands) return mesh;
    return orient(mesh).mesh;
}

Mesh outerSurface(const LevelSet& levelSet, Mesh oriented) {
    return levelSet.signReason().starts_with(unionOfSolids) ? unite(oriented).mesh : oriented;
}

Mesh outwardMesh(const LevelSet& levelSet, Mesh mesh) {
    return outerSurface(levelSet, orientedMesh(levelSet, std::move(mesh)));
}

}  // namespace bilayer::detail
