// SPDX-License-Identifier: Apache-2.0
// The side of a point by the winding number, and how far that side is valid.
// Tested by tests/sdf/winding.cpp through signByWinding().
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

#include "sdf/base/openvdb.h"
#include "sdf/bvh/winding_number.h"
#include "sdf/sign/winding_slope.h"

namespace bilayer::detail {

class Progress;

/// The side of a point.
struct WindingSide {
    bool inside;
    double margin;  ///< lower bound of the winding number's distance to one half
};

/// Queries of the winding number at voxels.
struct WindingQuery {
    const WindingNumber& winding;
    const WindingSlope* slope;  ///< null: the number changes only across the surface
    double voxelSize;
    Progress* progress;  ///< polled by each query, unless null

    /// Returns the side of a point [m]. The margin is infinite if the winding number changes only across the surface:
    /// the side then holds for all points that a path reaches without crossing it.
    WindingSide at(const glm::dvec3& point) const;

    /// Returns the side of the space around a point, which is away from the surface [m].
    WindingSide around(const glm::dvec3& point) const;

    /// Returns the position of a voxel [m].
    glm::dvec3 position(const openvdb::Coord& voxel) const {
        return glm::dvec3(voxel.x(), voxel.y(), voxel.z()) * voxelSize;
    }

    /// Returns the centre of a cube of voxels [m].
    glm::dvec3 centre(const openvdb::Coord& origin, std::int32_t side) const {
        return (glm::dvec3(origin.x(), origin.y(), origin.z()) + 0.5 * (side - 1)) * voxelSize;
    }

    /// Returns the maximum change of the winding number per voxel in a cube around a point [1/voxel].
    /// @param side  of the cube [voxels]
    double slopeIn(const glm::dvec3& centre, std::int32_t side) const;

    /// Returns the maximum change of the winding number from the centre of a cube to its corners.
    /// @param side   of the cube [voxels]
    /// @param slope  maximum change in the cube [1/voxel]
    static double changeInCube(std::int32_t side, double slope);
};

}  // namespace bilayer::detail
