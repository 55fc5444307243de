// SPDX-License-Identifier: Apache-2.0
// Contact generation between two posed bodies.
// Tested by tests/collider/collide.cpp.
#pragma once

#include <bilayer/collider/collider.h>
#include <bilayer/collider/pose.h>
#include <bilayer/collider/shapes.h>

#include <cstdint>
#include <glm/geometric.hpp>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace bilayer {

namespace detail {
struct Access;
struct ContactMemory;
struct DeviceSampler;
}  // namespace detail

/// The predicted motion of a body over the step, in world coordinates. A point x of the body moves by displacement +
/// rotation x (x - pose position). The path is linear: it deviates for rotations of more than a fraction of a radian.
struct Motion {
    glm::vec3 displacement{0};  ///< of the pose position [m]
    glm::vec3 rotation{0};      ///< rotation vector about the pose position [rad]

    /// The same motion with another point of the body as its reference.
    Motion about(const glm::vec3& from, const glm::vec3& to) const {
        return {displacement + glm::cross(rotation, to - from), rotation};
    }
};

/// A collider placed in the world, with an optional uniform scale. Body coordinates x map to pose.toWorld(scale * x).
struct Placed {
    const Collider& collider;  ///< the body's shape; must outlive the call
    Pose pose{};               ///< of the body's mesh in the world
    float scale = 1;           ///< positive; also scales distances
    Motion motion{};           ///< over the step, in world coordinates
};

/// A shape placed in the world, with an optional uniform scale. Body coordinates x map to pose.toWorld(scale * x).
struct PlacedShape {
    ContactShape shape;  ///< shares its data
    Pose pose{};         ///< in the world
    float scale = 1;     ///< positive; also scales distances
    Motion motion{};     ///< over the step
};

/// A contact point between two bodies: touching, close to each other, or predicted to touch.
struct Contact {
    glm::vec3 position;  ///< on the surface of B, in world coordinates [m]
    glm::vec3 normal;    ///< unit vector from B to A
    float distance;      ///< separation of the surfaces; negative: penetration [m]
    /// The surface point's index, or the point count plus the index of the sharp edge that the contact lies on. The top
    /// bit is set for features of B, clear for features of A.
    std::uint32_t feature;
    /// How far the predicted motion reduces the distance [m]. Non-zero only if the motion moves points where the bodies
    /// can touch farther than the margin.
    float approach = 0;
    /// The rounding radius of a vertex or edge that the contact position is fixed to, on the body that owns the feature
    /// [m]; the position rotates with that body. Negative: the position is the closest point of two surfaces, and
    /// remains so while they roll.
    float roundingRadius = -1;

    /// The distance after the predicted motion, if nothing stops it [m].
    float remaining() const { return distance - approach; }
};

/// The bit of Contact::feature that says that the feature is of B.
inline constexpr std::uint32_t featureOfB = 0x80000000u;

/// Options of collide().
struct ContactOptions {
    /// Contacts are reported up to this separation [m], and as speculative contacts beyond it where a point's motion
    /// hits the other surface. An exterior band that is sqrt(3) voxels wider than the margin makes the search fast:
    /// points beyond the band run a closest-point search each (see Field::closest()), which takes the triangles if the
    /// body has them. The interior band must be sqrt(3) voxels wider than the deepest penetration (see
    /// Sample::inBand).
    float margin = 0;
    /// Takes distances from the triangles where the bodies have them (Collider::exactField()). Points outside both the
    /// other body and its band run a closest-point search each. Points too deep inside are still only counted in the
    /// report.
    bool exact = false;
    /// Minimum cosine between a point's own normal and the reversed surface normal; contacts below it are dropped. It
    /// is the ghost-collision (internal-edge) filter. Points just below an edge of the other body get the normal of the
    /// nearest face, which may be the wrong one. A sharp point that fails the test is tested again one voxel back along
    /// its own normal, if that is outside. Vertices of a cube, whose normals average three faces, reach 0.57. If this
    /// and minNormalCosineApart are below -1, they drop no contact.
    float minNormalCosine = 0.3f;
    /// The same limit for face points that do not touch yet, or are less than a thousandth of a voxel deep. A point
    /// next to the other body sees its edge obliquely, or approaches its side, and would be blocked there.
    float minNormalCosineApart = 0.9f;
    /// Whether face points that are apart keep contacts with edges that they see at more than half a degree off
    /// their normal. Such contacts are redundant: the edges' own points meet the faces perpendicularly.
    bool keepsObliqueEdges = false;
    /// Reduces the contacts to those that a solver needs: for each patch of contacts with similar normals up to twelve,
    /// those that any small motion of the bodies meets first. They bear the same loads as all contacts. With a
    /// ContactCache, the choice stays the same from step to step while the bodies hardly move.
    bool reduced = false;
};

/// Diagnostics of collide().
struct ContactReport {
    std::uint32_t pointsTested = 0;  ///< surface points sampled in the other body's field
    std::uint32_t beyondBand = 0;    ///< points too deep inside for the band; they make no contact
};

/// Data that collide() keeps for a pair of bodies between steps, to find the same contacts faster. Use one per pair,
/// from one thread at a time.
class ContactCache {
  public:
    /// An empty cache, for a pair of bodies that collide() has not seen.
    ContactCache();
    ~ContactCache();
    /// Takes over the data of another cache, which may then only be destroyed or assigned to.
    ContactCache(ContactCache&&) noexcept;
    /// The same, in place of its own data.
    ContactCache& operator=(ContactCache&&) noexcept;

  private:
    friend struct detail::Access;

    std::unique_ptr<detail::ContactMemory> data_;
};

/// Appends the contacts between two bodies: surface points of A in the field of B, then surface points of B in the
/// field of A, each in ascending order of points. After the points of a body come its sharp edges that reach deeper
/// than their end points. Deterministic, and safe from any thread. Takes time proportional to the count of points near
/// the other body. Throws std::invalid_argument for a rotation that is no unit quaternion.
/// @param cache  null, or the cache of this pair from the last step; the contacts are the same, found faster
ContactReport collide(const Placed& a, const Placed& b, const ContactOptions& options, std::vector<Contact>& contacts,
                      ContactCache* cache = nullptr);

/// The same for unscaled bodies without motion.
inline ContactReport collide(const Collider& a, const Pose& poseA, const Collider& b, const Pose& poseB,
                             const ContactOptions& options, std::vector<Contact>& contacts) {
    return collide(Placed{a, poseA}, Placed{b, poseB}, options, contacts);
}

/// Appends the contacts between two shapes; at least one of them is a collider. Two colliders make the contacts of the
/// function above. Otherwise the features of contacts are: surface points and sharp edges of the collider as above; and
/// numbers of the other shape's vertices, edges or triangles, which stay the same from step to step. Throws
/// std::invalid_argument if neither is a collider, a scale is not positive, or a rotation is no unit quaternion.
ContactReport collide(const PlacedShape& a, const PlacedShape& b, const ContactOptions& options,
                      std::vector<Contact>& contacts, ContactCache* cache = nullptr);

/// Samples the surface points of many bodies in each other's fields on a device. openclPointSampler() in
/// cl/field.h makes one. Use it from one thread at a time. Cheap to copy.
class PointSampler {
  public:
    PointSampler() = default;  ///< no sampler

    /// Whether there is a sampler.
    explicit operator bool() const { return data_ != nullptr; }
    const std::string& backend() const;  ///< "opencl"; requires a sampler
    const std::string& device() const;   ///< the device's name; requires a sampler

  private:
    friend struct detail::Access;
    explicit PointSampler(detail::DeviceSampler sampler);

    std::shared_ptr<const detail::DeviceSampler> data_;
};

}  // namespace bilayer
