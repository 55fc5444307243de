// What a Field works from; internal.
#pragma once

#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <optional>

#include "collider/field.h"
#include "collider/mesh_tree.h"
#include "sdf/field_layout.h"

namespace bilayer {

struct Field::Data : FieldLayout {
    explicit Data(const LevelSet& levelSet) : FieldLayout(levelSet) {}
    Data(const LevelSet& levelSet, Mesh mesh);

    // Points are in voxels from the directory's first one, in double: exact enough however far the mesh is from the
    // origin.
    glm::dvec3 toLocal(const glm::vec3& point) const { return (glm::dvec3(point) - origin) * perMetre; }
    glm::vec3 toWorld(const glm::dvec3& local) const { return glm::vec3(local * voxel + origin); }
    glm::dvec3 extent() const { return double(side) * glm::dvec3(blocks); }

    Sample sample(const glm::dvec3& local, float gradientReach) const;
    float distance(const glm::dvec3& local) const { return sample(local, -std::numeric_limits<float>::infinity()).distance; }
    float boundOutside(const glm::dvec3& local) const;
    float boundInEmptyBlock(bool inside, const glm::dvec3& local, const glm::ivec3& block) const;
    Clearance clearance() const { return {clearances.data(), parts()}; }
    // [voxels]
    float clearanceAt(const glm::dvec3& local) const {
        return float(Clearance::partSide) * clearance().around(glm::vec3(local) / float(Clearance::partSide));
    }

    // What the field knows of the side that a point lies on.
    struct Side {
        bool inside, certain;
    };
    Side sideAt(const glm::dvec3& local, const Sample& here) const;
    bool isInside(const NearestFeature& nearest, const glm::dvec3& local, const Sample& here) const;
    std::uint32_t nearestTriangle(const glm::vec3& point, const Sample& here, float maxDistance) const;
    ClosestPoint closest(const glm::vec3& point, float maxDistance) const;

    double crossing(const glm::dvec3& start, const glm::dvec3& direction, double outside, double inside) const;
    std::optional<double> trace(const glm::dvec3& start, const glm::dvec3& direction, double length) const;

    std::unique_ptr<const MeshTree> mesh;  // null: the field has none
    bool signedByNormals = false;          // of this mesh
    float error = 0;                       // of distances in the band [m]; infinite: not known
};

}  // namespace bilayer
