// SPDX-License-Identifier: Apache-2.0
// Divides the surface of a mesh where parts of it cross or touch, and labels the pieces by the two sides they have.
//
// Where no other surface passes, neighbours lie on the same side of everything. One place therefore decides for a patch
// of triangles connected in this way. Triangles that others cross or touch are cut along the lines of contact, and each
// piece is labelled separately.
// Tested by tests/sdf/unite.cpp.
#pragma once

#include <cstddef>
#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/triangle_tree.h"
#include "sdf/mesh/surface_sides.h"
#include "sdf/mesh/topology.h"
#include "sdf/mesh/triangle_contacts.h"
#include "sdf/mesh/triangle_cut.h"

namespace bilayer::detail {

class Progress;

/// A mesh with a label for each triangle.
struct LabelledMesh {
    Mesh mesh;
    std::vector<int> labels;
};

class SurfacePieces {
  public:
    /// Returns the label of a place on the surface from the winding numbers on its two sides. Called by several
    /// threads. Label 0 removes the place.
    using LabelOf = std::function<int(const SideNumbers& sides)>;

    /// Finds the contacts. Keeps a reference to the mesh, which must be valid.
    /// @param slack     surfaces closer than this count as touching, relative to the max coordinate; above the rounding
    ///                  of doubles. Triangles are cut where others come this close, and labelled by the winding numbers
    ///                  at this distance. Labels are thus constant within pieces.
    /// @param progress  polled, unless null
    SurfacePieces(const Mesh& mesh, double slack, Progress* progress);

    /// Returns whether no contact exists, and all triangles are connected.
    bool isSinglePatch() const { return !touched_ && patches_.size() == 1; }

    /// Labels all pieces. The result does not depend on the count of threads. Patches without area get label 1.
    void label(const LabelOf& labelOf);

    /// Returns the triangles and pieces with labels other than 0. A triangle of one label stays whole. Cut points are
    /// rounded to floats.
    LabelledMesh labelled() const;

    bool isWhole(std::size_t triangle) const { return cuts_[triangle].size() < 2; }
    /// Returns the label of a whole triangle.
    int labelOf(std::size_t triangle) const;
    /// Returns whether some piece of a triangle has a label other than 0.
    bool remains(std::size_t triangle) const;

  private:
    bool isClosed() const;
    void findPatches();
    DoubleTriangle face(std::size_t triangle) const { return {mesh_, mesh_.triangles[triangle]}; }
    static void append(const LabelledPiece& piece, LabelledMesh& to);

    const Mesh& mesh_;
    Progress* progress_;
    const Topology topology_;
    const TriangleTree tree_;
    const double slack_;
    bool touched_ = false;
    std::vector<std::vector<Segment>> contacts_;    // for each triangle
    std::vector<unsigned> patches_;                 // the largest triangle of each patch
    std::vector<unsigned> patchOf_;                 // for each triangle without contacts: one of `patches_`
    std::vector<int> patchLabels_;                  // for each triangle of `patches_`
    std::vector<std::vector<LabelledPiece>> cuts_;  // for each triangle with contacts
};

}  // namespace bilayer::detail
