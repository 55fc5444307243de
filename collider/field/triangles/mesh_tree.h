// SPDX-License-Identifier: Apache-2.0
// A mesh with a bounding volume hierarchy over its triangles, for exact queries. The closest-triangle search is in
// mesh_nearest.cpp.
// Tested by tests/collider/mesh_rays.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <utility>

#include <bilayer/collider/query.h>
#include <bilayer/sdf/mesh.h>
#include "collider/field/layout/block_entries.h"
#include "collider/field/triangles/feature_normals.h"
#include "collider/field/triangles/oriented_boxes.h"
#include "sdf/bvh/wide_tree.h"

namespace bilayer::detail {

/// The feature of a mesh that is closest to a point.
struct NearestFeature {
    std::uint32_t triangle = noTriangle;
    Feature feature = Feature::face;
    std::uint8_t index = 0;  ///< of the edge or vertex
    glm::dvec3 offset{0};    ///< from the point to the closest point of the feature [m]
    /// The angle-weighted mean of the unit normals around the feature (FeatureNormals). If it is short, it defines no
    /// side.
    glm::dvec3 normal{0};
    bool isOnSurface = false;  ///< the distance to the feature is below the resolution of the tree or of floats
};

/// Immutable; all queries are safe from any thread and allocate nothing.
class MeshTree {
  public:
    /// Takes about 140 bytes per triangle and 6 per vertex in addition to the mesh, which it shares. Throws as
    /// validate() and makeWideTree() do.
    /// @param voxelSize  of the associated field: lengths in the hierarchy are in voxels [m]
    MeshTree(std::shared_ptr<const Mesh> mesh, float voxelSize);
    MeshTree(Mesh mesh, float voxelSize) : MeshTree(std::make_shared<const Mesh>(std::move(mesh)), voxelSize) {}

    /// The bounding box of the mesh, expanded by at least a voxel [m].
    std::pair<glm::dvec3, glm::dvec3> box() const noexcept;

    /// False for a point outside that box, which the mesh cannot enclose.
    bool mayEnclose(const glm::dvec3& point) const noexcept;

    /// The point from which to search for the closest feature. It is the point itself, or one between it and the mesh
    /// if it is thousands of mesh sizes away. The closest feature is the same to a millionth of the distance, and
    /// rounding there leaves enough digits for places on the mesh.
    glm::dvec3 approached(const glm::dvec3& point) const noexcept;

    /// The triangle closest to a point: to 1e-5 voxels up to ten voxels away, to a millionth of the distance beyond.
    /// `noTriangle` if none is closer than the bound, or if the point is not finite.
    /// @param point  [m]
    /// @param bound  [voxels], may be infinite
    std::uint32_t nearest(const glm::dvec3& point, float bound) const noexcept;

    /// The same, but returns the place in the tree: a triangle, or a piece of a long one. `noPiece` if there is none.
    static constexpr std::uint32_t noPiece = ~0u;
    std::uint32_t nearestPiece(const glm::dvec3& point, float bound) const noexcept;

    /// The same, starting at an entry. The bound must not exceed the entry's reach.
    std::uint32_t nearestPiece(const glm::dvec3& point, float bound, const EntryPlace& place) const noexcept;

    /// The same for many points, faster. All spans have the same length. `noPiece` for points without an entry.
    void nearestPieces(std::span<const glm::vec3> points, float bound, std::span<const EntryPlace> places,
                       std::span<std::uint32_t> pieces) const noexcept;

    /// The feature of a triangle that is closest to a point [m], in double precision. For a point on the surface it is
    /// the one of lowest dimension: a vertex before an edge, an edge before a face.
    NearestFeature featureOf(std::uint32_t triangle, const glm::dvec3& point) const noexcept;

    /// The same for a piece that nearestPiece() has found for the point. Fast if the point projects into the triangle.
    NearestFeature featureOfPiece(std::uint32_t piece, const glm::dvec3& point) const noexcept;

    const Mesh& mesh() const { return *mesh_; }
    const WideTree& tree() const { return tree_; }
    /// The oriented boxes of a node's children.
    const OrientedBoxes& group(std::uint32_t node) const { return groups_[node - tree_.leafCount]; }
    float voxelSize() const { return voxelSize_; }  ///< [m]
    std::size_t memoryBytes() const;

  private:
    double roomAt(const glm::dvec3& point) const noexcept;
    void toEdge(NearestFeature& found, const std::array<glm::dvec3, 3>& corners) const noexcept;
    void toSmallest(NearestFeature& found, const std::array<glm::dvec3, 3>& corners, double room) const noexcept;
    glm::dvec3 toTree(const glm::dvec3& point) const { return point * perMetre_ - glm::dvec3(tree_.base); }
    std::uint32_t triangleOf(std::uint32_t piece) const {
        return tree_.leaves[piece / treeWidth].triangles[piece % treeWidth];
    }

    std::shared_ptr<const Mesh> mesh_;
    float voxelSize_;
    double perMetre_;  // voxels per metre
    WideTree tree_;
    LargeArray<OrientedBoxes> groups_;
    FeatureNormals normals_;
};

}  // namespace bilayer::detail
