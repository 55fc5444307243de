// The contacts between two posed bodies.
#pragma once

#include <bilayer/collider/collider.h>
#include <bilayer/collider/pose.h>

#include <cstdint>
#include <functional>
#include <glm/geometric.hpp>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace bilayer {

namespace detail {
struct CandidateLists;
struct SampledBody;
struct PointQuery;
class FoundPoints;
}  // namespace detail

/// How a body moves until it is looked at again: a point x of it goes way + turn x (x - its pose's position), in the
/// world. Straight: turns of more than a fraction of a radian bend away from it.
struct Motion {
    glm::vec3 displacement{0};  ///< of the pose's position [m]
    glm::vec3 rotation{0};      ///< about it [rad]

    /// The same motion as told of another point of the body.
    Motion about(const glm::vec3& from, const glm::vec3& to) const {
        return {displacement + glm::cross(rotation, to - from), rotation};
    }
};

/// A collider somewhere in the world, perhaps grown: body coordinates x become pose.toWorld(scale * x).
struct Placed {
    const Collider& collider;
    Pose pose{};
    float scale = 1;  ///< positive; distances grow by it
    Motion motion{};
};

/// A point where two bodies touch, nearly do, or are going to.
struct Contact {
    glm::vec3 position;  ///< on the surface of B, in the world [m]
    glm::vec3 normal;    ///< from B to A, of unit length
    float distance;      ///< gap between the surfaces, negative when they overlap [m]
    /// Index of the surface point, or behind those of all points that of the sharp edge that it is on; the top bit is
    /// set where the point is of B, else it is of A.
    std::uint32_t feature;
    /// What the bodies' motion takes off the distance, where it takes any point farther than the margin [m].
    float approach = 0;
    /// Where its place turns with the body that the feature is of: 0, or what a corner or edge that turns so is rounded
    /// by [m]. Else, where two surfaces are nearest to each other, and stay so while they roll: negative.
    float turningRadius = -1;

    /// What the motion leaves of the distance if nothing stops it [m].
    float remaining() const { return distance - approach; }
};

inline constexpr std::uint32_t featureOfB = 0x80000000u;

struct ContactOptions {
    /// Contacts are reported up to this distance [m], and beyond it where a point's motion meets the other surface. The
    /// band must reach sqrt(3) voxels farther for all of them to be found (what moves on from there is met all the
    /// same), and as much deeper than bodies sink into each other (see Sample::inBand).
    float margin = 0;
    /// Whether distances are measured by the triangles, where the bodies have them (Collider::measured()), and points
    /// outside of the other body and of its band are asked for the closest place, which takes a search for each; those
    /// too deep inside are counted all the same.
    bool exact = false;
    /// Least cosine between the point's own normal and the opposite of the surface's that it touches; contacts below
    /// are left out. Points just under the edge of the other body look along the surface that is nearest to them; sharp
    /// ones among these touch the surface that they oppose a voxel back along their own normal, if there is one. The
    /// corners of a cube, whose normals are mixed of three, reach 0.57. Below -1: no contact is left out.
    float minNormalCosine = -2;
    /// The same for points of faces that do not touch yet: a point beside the other body sees its edge aslant, or meets
    /// its side, and would stop it like a curb.
    float minNormalCosineApart = -2;
    /// Whether points of faces that neither touch yet nor are on their way touch edges that they see by more than half
    /// a degree aslant: the edges' own points meet the faces straight.
    bool keepsObliqueEdges = true;
};

/// What collide() saw beside the contacts.
struct ContactReport {
    std::uint32_t pointsTested = 0;  ///< surface points sampled in the other body's field
    std::uint32_t beyondBand = 0;    ///< points so deep that the band does not reach them: no contact is made of them
};

/// What collide() keeps of two bodies from one step to the next, so that it finds the same contacts sooner. One for
/// each pair of bodies; not for two threads at once.
class ContactCache {
  public:
    ContactCache();
    ~ContactCache();
    ContactCache(ContactCache&&) noexcept;
    ContactCache& operator=(ContactCache&&) noexcept;

    detail::CandidateLists& data() { return *data_; }

  private:
    std::unique_ptr<detail::CandidateLists> data_;
};

/// Appends the contacts between two bodies: surface points of A in B's field, then those of B in A's field, each in
/// ascending order of points; behind a point's, those of the sharp edges that go deeper from there before they come up
/// to the next point. Deterministic; safe from any thread. O(points near the other body).
/// @param cache  null, or what was kept of the same two bodies in the last step: the contacts are the same, found
/// sooner
ContactReport collide(const Placed& a, const Placed& b, const ContactOptions& options, std::vector<Contact>& contacts,
                      ContactCache* cache = nullptr);

/// The same for bodies of their own size.
inline ContactReport collide(const Collider& a, const Pose& poseA, const Collider& b, const Pose& poseB,
                             const ContactOptions& options, std::vector<Contact>& contacts) {
    return collide(Placed{a, poseA}, Placed{b, poseB}, options, contacts);
}

/// Samples the surface points of many bodies in the fields of others on some device: openclPointSampler() in
/// cl/point_sampler.h makes one. To be called by one thread at a time.
struct PointSampler {
    std::string backend;  ///< "opencl"
    std::string device;   ///< the device's name
    /// Throws what the device's trouble calls for; the next call may succeed.
    std::function<void(std::span<const detail::SampledBody>, std::span<const detail::PointQuery>, detail::FoundPoints&)>
        sample;
};

}  // namespace bilayer
