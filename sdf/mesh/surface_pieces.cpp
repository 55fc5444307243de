// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/surface_pieces.h"

#include <algorithm>
#include <glm/common.hpp>
#include <span>
#include <utility>

#include "sdf/base/polled_loop.h"

namespace bilayer::detail {
namespace {

/// The label of patches without area, which have no sides.
constexpr int withoutArea = 1;

double largestCoordinate(const Mesh& mesh) {
    const Bounds box = bounds(mesh);
    const glm::vec3 largest = glm::max(glm::abs(box.lower), glm::abs(box.upper));
    return double(std::max({largest.x, largest.y, largest.z}));
}

}  // namespace

SurfacePieces::SurfacePieces(const Mesh& mesh, double slack, Progress* progress)
    : mesh_(mesh),
      progress_(progress),
      topology_(mesh, progress),
      tree_(mesh, progress),
      slack_(slack * largestCoordinate(mesh)),
      contacts_(mesh.triangles.size()),
      patchLabels_(mesh.triangles.size(), 0),
      cuts_(mesh.triangles.size()) {
    const TriangleContacts contacts(mesh, topology_, tree_, slack_);
    forAllPolled(contacts_.size(), 1, progress, [&](std::size_t i) { contacts_[i] = contacts.within(unsigned(i)); });
    touched_ = std::any_of(contacts_.begin(), contacts_.end(), [](const auto& segments) { return !segments.empty(); });
    findPatches();
}

bool SurfacePieces::isClosed() const {
    bool closed = true;
    topology_.forEachEdge([&](std::span<const EdgeUse> uses) {
        int net = 0;
        for (const EdgeUse& use : uses) net += use.direction();
        closed &= net == 0;
    });
    return closed;
}

// Patches are triangles connected by edges of two triangles, without contacts. A patch is represented by its largest
// triangle.
void SurfacePieces::findPatches() {
    DisjointSets sets(mesh_.triangles.size());
    topology_.forEachEdge([&](std::span<const EdgeUse> uses) {
        if (uses.size() == 2 && contacts_[uses[0].triangle].empty() && contacts_[uses[1].triangle].empty())
            sets.join(uses[0].triangle, uses[1].triangle);
    });
    patchOf_.resize(mesh_.triangles.size());
    for (unsigned i = 0; i < patchOf_.size(); ++i) patchOf_[i] = i;
    for (unsigned i = 0; i < patchOf_.size(); ++i) {
        unsigned& largest = patchOf_[sets.root(i)];
        if (face(i).area > face(largest).area) largest = i;
    }
    for (unsigned i = 0; i < patchOf_.size(); ++i) {
        const unsigned root = sets.root(i);
        if (root == i && contacts_[i].empty()) patches_.push_back(patchOf_[i]);
        if (root != i) patchOf_[i] = patchOf_[root];
    }
}

void SurfacePieces::label(const LabelOf& labelOf) {
    const SurfaceSides sides(mesh_, tree_, isClosed(), progress_);
    const auto labelAt = [&](const glm::dvec3& place, const glm::dvec3& normal) {
        return labelOf(sides.at(place, slack_ * normal));
    };
    forAllPolled(patches_.size(), 1, progress_, [&](std::size_t p) {
        const DoubleTriangle largest = face(patches_[p]);
        patchLabels_[patches_[p]] = largest.area > 0 ? labelAt(largest.centroid(), largest.normal) : withoutArea;
    });
    forAllPolled(contacts_.size(), 1, progress_, [&](std::size_t i) {
        if (contacts_[i].empty()) return;
        const DoubleTriangle triangle = face(i);
        cuts_[i] = cut(triangle.polygon(), triangle.normal, contacts_[i], slack_,
                       [&](const glm::dvec3& inside) { return labelAt(inside, triangle.normal); });
    });
}

int SurfacePieces::labelOf(std::size_t triangle) const {
    if (contacts_[triangle].empty()) return patchLabels_[patchOf_[triangle]];
    return cuts_[triangle].empty() ? 0 : cuts_[triangle][0].label;
}

bool SurfacePieces::remains(std::size_t triangle) const {
    if (isWhole(triangle)) return labelOf(triangle) != 0;
    const auto& pieces = cuts_[triangle];
    return std::any_of(pieces.begin(), pieces.end(), [](const LabelledPiece& piece) { return piece.label != 0; });
}

LabelledMesh SurfacePieces::labelled() const {
    LabelledMesh result{{mesh_.points, {}, mesh_.origin}, {}};
    for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
        if (!isWhole(i)) {
            for (const LabelledPiece& piece : cuts_[i])
                if (piece.label != 0) append(piece, result);
        } else if (const int label = labelOf(i); label != 0) {
            result.mesh.triangles.push_back(mesh_.triangles[i]);
            result.labels.push_back(label);
        }
    }
    return result;
}

void SurfacePieces::append(const LabelledPiece& piece, LabelledMesh& to) {
    Mesh& mesh = to.mesh;
    const unsigned first = unsigned(mesh.points.size());
    for (const glm::dvec3& p : piece.polygon) mesh.points.emplace_back(p);
    for (unsigned i = 2; i < piece.polygon.size(); ++i) {
        mesh.triangles.emplace_back(first, first + i - 1, first + i);
        to.labels.push_back(piece.label);
    }
}

}  // namespace bilayer::detail
