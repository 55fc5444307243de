// A mesh with a bounding hierarchy over its triangles, for questions that only triangles can decide.
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
#include "collider/field/block_entries.h"
#include "collider/field/feature_normals.h"
#include "collider/field/oriented_boxes.h"
#include "sdf/bvh/wide_tree.h"

namespace bilayer::detail {

/// What of a mesh is closest to a point.
struct NearestFeature {
    std::uint32_t triangle = noTriangle;
    Feature feature = Feature::face;
    std::uint8_t index = 0;  ///< of the edge or the corner
    glm::dvec3 way{0};       ///< from the point to the feature's closest point [m]
    /// The mean of unit normals around the feature, weighted by angles (FeatureNormals): where it is short it tells no
    /// side.
    glm::dvec3 normal{0};
    bool isOnSurface = false;  ///< the point is no farther from the feature than the tree or floats can tell
};

/// Immutable; all queries are safe from any thread and allocate nothing.
class MeshTree {
  public:
    /// Takes about 140 bytes a triangle and 6 a vertex beside the mesh, which it shares.
    /// @param voxelSize  of the field that goes with it: lengths in the hierarchy are in voxels [m]
    /// Throws as validate() and makeWideTree() do.
    MeshTree(std::shared_ptr<const Mesh> mesh, float voxelSize);
    MeshTree(Mesh mesh, float voxelSize) : MeshTree(std::make_shared<const Mesh>(std::move(mesh)), voxelSize) {}

    /// A box around the mesh, a voxel away from it at least [m].
    std::pair<glm::dvec3, glm::dvec3> box() const noexcept;

    /// False for a point that is outside of that box: what the mesh encloses is not.
    bool mayEnclose(const glm::dvec3& point) const noexcept;

    /// Where a point is looked for what is nearest to it: the point itself, or where it is thousands of sizes of the
    /// mesh away, one between it and the mesh. What is nearest to the one is as near to the other, to a millionth of
    /// the distance, and places on the mesh can be told from it.
    glm::dvec3 approached(const glm::dvec3& point) const noexcept;

    /// The triangle that is nearest to a point: to within 1e-5 voxels up to ten voxels away, to a millionth of the
    /// distance farther away. `noTriangle` if none is as near as the bound, or the point is not finite.
    /// @param point  [m]
    /// @param bound  [voxels], may be infinite
    std::uint32_t nearest(const glm::dvec3& point, float bound) const noexcept;

    /// The same, but tells the place in the tree: of a triangle, or of a part of a long one. `noPart` if there is none.
    static constexpr std::uint32_t noPart = ~0u;
    std::uint32_t nearestPart(const glm::dvec3& point, float bound) const noexcept;

    /// The same, beginning at an entry; the bound is no more than the entry's reach.
    std::uint32_t nearestPart(const glm::dvec3& point, float bound, const EntryPlace& place) const noexcept;

    /// The same for many points, in less time: the spans are equally long. `noPart` where there is no entry.
    void nearestParts(std::span<const glm::vec3> points, float bound, std::span<const EntryPlace> places,
                      std::span<std::uint32_t> parts) const noexcept;

    /// The feature of a triangle that is closest to a point [m], in double precision. Of a point on the surface itself
    /// it is the smallest one: a corner before an edge, an edge before a face.
    NearestFeature featureOf(std::uint32_t triangle, const glm::dvec3& point) const noexcept;

    /// The same for a triangle that nearestPart() has found for the point; quick where the point lies over it.
    NearestFeature featureOfPart(std::uint32_t part, const glm::dvec3& point) const noexcept;

    const Mesh& mesh() const { return *mesh_; }
    const WideTree& tree() const { return tree_; }
    float voxelSize() const { return voxelSize_; }  ///< [m]
    std::size_t memoryBytes() const;

  private:
    double roomAt(const glm::dvec3& point) const noexcept;
    void toEdge(NearestFeature& found, const std::array<glm::dvec3, 3>& corners) const noexcept;
    void toSmallest(NearestFeature& found, const std::array<glm::dvec3, 3>& corners, double room) const noexcept;
    glm::dvec3 toTree(const glm::dvec3& point) const { return point * perMetre_ - glm::dvec3(tree_.base); }
    std::uint32_t triangleOf(std::uint32_t part) const {
        return tree_.leaves[part / treeWidth].triangles[part % treeWidth];
    }

    std::shared_ptr<const Mesh> mesh_;
    float voxelSize_;
    double perMetre_;  // voxels
    WideTree tree_;
    LargeArray<TurnedGroup> groups_;
    FeatureNormals normals_;
};

}  // namespace bilayer::detail
