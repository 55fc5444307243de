// What a field knows of places that are not near its surface.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace bilayer {

/// What a Field tells at once of places that are not near its surface: a view of its own data, coarse but small. Space
/// is divided into parts of 4^3 voxels; coordinates are in parts from the field's origin.
class Clearance {
  public:
    static constexpr int partSide = 4;  ///< [voxels]

    struct Part {
        float centre;  ///< its centre's distance from the surface, at least, negative inside [parts]
        float least;   ///< no sample in this part is below [m]
    };

    /// @param parts  the last axis fastest
    /// @param size   number of parts along each axis
    Clearance(const Part* parts, const glm::ivec3& size) : parts_(parts), size_(size), extent_(size) {}

    /// The distance from the surface, at least; not positive where nothing is known [parts].
    float around(const glm::vec3& point) const noexcept {
        const glm::ivec3 part = partOf(point);
        return std::abs(at(part).centre) - glm::distance(point, glm::vec3(part) + 0.5f);
    }

    /// Whether a sphere surely lies outside of the surface. False for a centre that is not finite.
    bool isOutside(const glm::vec3& centre, float radius) const noexcept {
        const glm::vec3 toBox = centre - clamped(centre);
        if (glm::dot(toBox, toBox) > radius * radius) return true;
        const glm::ivec3 part = partOf(centre);
        const glm::vec3 way = centre - (glm::vec3(part) + 0.5f);
        const float left = at(part).centre - radius;
        return left > 0 && glm::dot(way, way) < left * left;
    }

    /// Whether a sample there is surely above `reach` [m], or out of the band.
    bool isAbove(const glm::vec3& point, float reach) const noexcept { return at(partOf(point)).least > reach; }

  private:
    // NaN goes to 0
    glm::vec3 clamped(const glm::vec3& p) const noexcept {
        return {std::min(std::max(0.f, p.x), extent_.x), std::min(std::max(0.f, p.y), extent_.y),
                std::min(std::max(0.f, p.z), extent_.z)};
    }
    glm::ivec3 partOf(const glm::vec3& point) const noexcept { return glm::min(glm::ivec3(clamped(point)), size_ - 1); }
    const Part& at(const glm::ivec3& part) const noexcept {
        return parts_[(std::size_t(part.x) * size_.y + part.y) * size_.z + part.z];
    }

    const Part* parts_;
    glm::ivec3 size_;
    glm::vec3 extent_;
};

}  // namespace bilayer
