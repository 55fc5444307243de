// What a collider samples: distance, gradient, rays. Built from a LevelSet, independent of OpenVDB afterwards.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <utility>

#include "sdf/level_set.h"
#include "sdf/mesh.h"

namespace bilayer {

/// The answer to a query at a point.
struct Sample {
    /// In the band: the signed distance [m]. Elsewhere: a bound with the right sign, whose magnitude the true distance
    /// is not below (but for the field's own error), and no distance. A band narrower than sqrt(3) voxels can bound
    /// nothing just beside it: the magnitude is 0 there. +infinity for a point that is not finite.
    float distance = 0;
    /// In the band: the analytic gradient of the same trilinear interpolant (its length is near 1, not exactly 1).
    /// Elsewhere: zero.
    glm::vec3 gradient{0};
    /// All eight voxels around the point are active: sure up to sqrt(3) voxels less than the band's width on either
    /// side.
    bool inBand = false;
};

/// What a Field tells at once of places that are not near its surface: a view of its own data, coarse but small. Space
/// is divided into parts of 4^3 voxels; coordinates are in parts from Field::origin().
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

/// Where a ray meets the surface.
struct RayHit {
    float distance = 0;     ///< along the ray [m]
    glm::vec3 position{0};  ///< [m]
    glm::vec3 normal{0};    ///< outward, of unit length; against the ray if it starts deeper than the band
};

/// A field laid out for queries. Copies share memory. All queries are noexcept, allocate nothing, and may run on any
/// number of threads at once.
class Field {
  public:
    /// Takes about 1.5 times the level set's memory and 68 bytes a block of its box. Throws std::invalid_argument if
    /// the box is so large for its voxels that it holds more than 2^26 blocks of 8^3 voxels.
    explicit Field(const LevelSet& levelSet);

    /// Distance and gradient at a point in the field's own coordinates [m].
    Sample sample(const glm::vec3& point) const noexcept;

    /// The same, but with a gradient only where the distance is no more than `reach` [m], and zero elsewhere: less work
    /// where most points are farther away.
    Sample sampleWithin(const glm::vec3& point, float reach) const noexcept;

    /// The distance alone, with the same meaning as Sample::distance, at half the cost.
    float distance(const glm::vec3& point) const noexcept;

    /// The first point from outside to inside along a ray, by sphere tracing; also when the ray starts inside (distance
    /// 0). The crossing of the interpolant is found to 1e-4 voxels. Chords shorter than a tenth of a voxel may be
    /// missed.
    /// @param direction    of any length but zero
    /// @param maxDistance  [m], may be infinite
    std::optional<RayHit> raycast(const glm::vec3& origin, const glm::vec3& direction,
                                  float maxDistance) const noexcept;

    /// Valid as long as the field or a copy of it lives.
    Clearance clearance() const noexcept;
    glm::dvec3 origin() const noexcept;  ///< [m]

    float voxelSize() const noexcept;       ///< [m]
    float exteriorWidth() const noexcept;   ///< [m]
    float interiorWidth() const noexcept;   ///< [m]
    const Bounds& bounds() const noexcept;  ///< around all points in the band [m]
    std::size_t memoryBytes() const noexcept;

  private:
    struct Data;
    std::shared_ptr<const Data> data_;
};

}  // namespace bilayer
