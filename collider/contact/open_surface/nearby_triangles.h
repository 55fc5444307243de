// SPDX-License-Identifier: Apache-2.0
// The triangles of an open surface near a field.
// Tested by tests/bullet/sliding.cpp through bullet::Dispatcher.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include <bilayer/collider/pose.h>
#include "collider/contact/open_surface/open_surface.h"
#include "collider/contact/search/probed_field.h"

namespace bilayer::detail {

/// Collects triangles in the axes of the field [m].
class NearbyTriangles {
  public:
    /// @param inField  pose of the mesh in the field
    NearbyTriangles(const ProbedField& field, const Pose& inField) : field_(field), inField_(inField) {}

    /// @param corners  in the axes of the mesh [m]
    /// @param id       as OpenSurface passes it
    void add(const Triangle& corners, std::uint64_t id);

    /// Finds which triangles share edges and vertices, after all have been collected.
    void connect() { adjacency_.emplace(triangles_); }
    const Adjacency& adjacency() const { return *adjacency_; }

    std::uint32_t size() const { return std::uint32_t(triangles_.size()); }
    const Triangle& operator[](std::uint32_t triangle) const { return triangles_[triangle]; }
    /// A hash of the triangle's number.
    std::uint64_t id(std::uint32_t triangle) const { return ids_[triangle]; }

    /// The distance of a point from the triangles.
    float distance(const glm::vec3& place) const;

    /// The first feature number of an edge, a vertex, or a face over a surface point. It is the same from step to step,
    /// and unique up to a collision probability of 2^-31.
    /// @param triangle  its id
    /// @param part      0 to 2: the edge; 3 to 5: the vertex; facePart + i: the face over surface point i
    static std::uint32_t featureOf(std::uint64_t triangle, std::uint32_t part);
    static constexpr std::uint32_t facePart = 6;

  private:
    const ProbedField& field_;
    Pose inField_;
    std::vector<Triangle> triangles_;
    std::vector<std::uint64_t> ids_;
    std::optional<Adjacency> adjacency_;
};

}  // namespace bilayer::detail
