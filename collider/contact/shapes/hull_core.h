// SPDX-License-Identifier: Apache-2.0
// The convex hull of points as the core of a body.
// Tested by tests/bullet/convex.cpp through Convex.
#pragma once

#include <cstddef>
#include <glm/geometric.hpp>
#include <utility>

#include "collider/contact/shapes/convex_core.h"

namespace bilayer::detail {

/// The surface of a convex hull.
struct HullSurface {
    std::vector<glm::vec3> points;                  ///< the vertices of the hull [m]
    std::vector<std::vector<std::uint32_t>> faces;  ///< polygons, counter-clockwise from outside
    std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
};

class HullCore : public ConvexCore {
  public:
    /// @param growth  of the body around the core [m]
    HullCore(const HullSurface& surface, float growth);
    NearestPoint nearest(const glm::vec3& point, float reach) const override;
    bool isFlat(const NearestPoint& nearest) const override { return !isRound(nearest); }
    bool isRound(const NearestPoint& nearest) const override;

  private:
    struct Face {
        glm::vec3 normal;
        float offset;
        std::size_t begin, end;  ///< of `triangles_`

        float height(const glm::vec3& point) const { return glm::dot(normal, point) - offset; }
    };
    /// The face with the largest height above it; null for a hull without faces.
    struct Above {
        const Face* face;
        float height;
    };
    class Search;

    void addFaces(const HullSurface& surface);
    void addEdges(const HullSurface& surface);
    void listFacesAround();
    Above highest(const glm::vec3& point) const;

    std::vector<Face> faces_;
    std::vector<glm::uvec3> triangles_;
    /// The faces around vertex i are facesAround_[j] with firstAround_[i] <= j < firstAround_[i + 1].
    std::vector<std::uint32_t> firstAround_, facesAround_;
    float tolerance_;
    bool isPlanar_;  ///< all points are in a plane: the hull has no inside
};

}  // namespace bilayer::detail
