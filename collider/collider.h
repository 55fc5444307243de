// A rigid body's shape, and the contacts between two of them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "collider/body.h"
#include "collider/field.h"
#include "collider/motion.h"
#include "collider/near_points.h"
#include "collider/pose.h"
#include "collider/sharp_edges.h"
#include "collider/strays.h"
#include "sdf/point_sampler.h"

namespace bilayer {

struct ColliderOptions {
    /// Distance between neighbouring surface points [voxels of the field]. Smaller finds finer contacts and costs more.
    /// What is round has points closer to each other, so that it sinks in between them by 0.05 spacings at most.
    float pointSpacing = 2.0f;
    /// Contacts are made up to this distance between the surfaces [m], 1000 voxels at most. Negative: one voxel of the
    /// field.
    float margin = -1;
    /// Measure::edges asks the triangles where samples are off by more than a tenth of a voxel (see Strays). But
    /// for samples alone, the mesh takes memory (see Field), and a microsecond a triangle to sort. Measure::triangles
    /// costs more time the more contacts there are: for parts that fit into each other to a fraction of a voxel.
    Measure measure = Measure::edges;
};

/// A field, points on the surface, and what else contacts need. Immutable; share it between bodies and threads.
class Collider {
  public:
    /// Of a mesh and the level set that was built of it. Triangles that face the wrong way are turned around, as
    /// build() does. Where the signs are of winding numbers, the holes that these close are filled with triangles and
    /// cracks of up to a hundredth of a voxel are closed (see fillHoles()): a level set is then built of the closed
    /// mesh, with the same voxels and widths, and the body has its distances and normals there too. Throws
    /// std::invalid_argument as validate() does, for options of no sense, and if the level set is of another mesh.
    Collider(Mesh mesh, const LevelSet& levelSet, const ColliderOptions& options = {});

    /// Of a level set with a body beside it, as readVdb() gives back what withBody() was written of. It is as the one
    /// that it was made of, to the bit; but a body without a mesh gives the triangles of the field's zero set where
    /// triangles are asked for. Throws std::invalid_argument as bodyOf() does.
    explicit Collider(const LevelSet& levelSet) : Collider(levelSet, bodyOf(levelSet)) {}

    /// The mesh, all of it facing outward, the triangles over its holes last. Where the body has none, one like it is
    /// extracted from the field when first asked for, once.
    const Mesh& mesh() const;
    const Field& field() const { return field_; }
    /// The field with the mesh, if the body has one: field() itself where contacts ask triangles, else made when first
    /// asked for, once, and sharing the samples.
    const Field& measured() const;
    /// Whether contacts ask the triangles at a point of the body's coordinates [m], by Body::measure.
    /// @param measured  as in ContactOptions
    bool asksTriangles(const glm::vec3& point, bool measured = false) const {
        if (measured || body_.measure == Measure::triangles) return body_.mesh != nullptr;
        return strays_.hold(point);
    }
    const Body& body() const { return body_; }
    const SurfacePoints& points() const { return body_.points; }
    const SharpEdges& edges() const { return edges_; }
    const Bounds& bounds() const { return body_.bounds; }  ///< of the mesh [m]
    float margin() const { return body_.margin; }          ///< as in ColliderOptions, never negative [m]
    /// Of the mesh; where that has holes, of what the field has inside, but for a body from elsewhere. Throws
    /// std::invalid_argument where there is no volume.
    const MassProperties& mass() const;
    std::uint64_t id() const { return id_; }  ///< no other collider of this process has it

  private:
    class OnDemand;
    Collider(const LevelSet& levelSet, Body body);

    Body body_;
    Field field_;
    std::shared_ptr<OnDemand> onDemand_;
    Strays strays_;
    SharpEdges edges_;
    std::uint64_t id_;
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
    bool measured = false;
    /// Least cosine between the point's own normal and the opposite of the surface's that it touches; contacts below
    /// are left out. Points just under the edge of the other body look along the surface that is nearest to them; sharp
    /// ones among these touch the surface that they oppose a voxel back along their own normal, if there is one. The
    /// corners of a cube, whose normals are mixed of three, reach 0.57. Below -1: no contact is left out.
    float leastOpposition = -2;
    /// The same for points of faces that do not touch yet: a point beside the other body sees its edge aslant, or meets
    /// its side, and would stop it like a curb.
    float leastOppositionApart = -2;
    /// Whether points of faces that neither touch yet nor are on their way touch edges that they see by more than half
    /// a degree aslant: the edges' own points meet the faces straight.
    bool keepsEdgesAslant = true;

    /// Whether a contact is kept that looks against its point's normal by this cosine.
    /// @param apart  its point is of a face that does not touch yet
    bool keeps(float opposition, bool apart) const {
        return opposition >= (apart ? std::max(leastOppositionApart, leastOpposition) : leastOpposition);
    }
    /// The same where the point turns with its body, and looks against the surface now, later or in between.
    /// @param seen, normal  of the surface, outward, and of the point
    /// @param turn          in the step, as the surface sees it [rad]
    bool keeps(const glm::vec3& seen, const glm::vec3& normal, const glm::vec3& turn, bool apart) const {
        const auto isKept = [&](float part) {
            return keeps(-glm::dot(seen, glm::normalize(normal + part * glm::cross(turn, normal))), apart);
        };
        return isKept(0) || (turn != glm::vec3(0) && (isKept(0.5f) || isKept(1)));
    }
};

/// What collide() saw beside the contacts.
struct ContactReport {
    std::uint32_t pointsTested = 0;  ///< surface points sampled in the other body's field
    std::uint32_t beyondBand = 0;    ///< points so deep that the band does not reach them: no contact is made of them
};

/// Appends the contacts between two bodies: surface points of A in B's field, then those of B in A's field, each in
/// ascending order of points; behind a point's, those of the sharp edges that go deeper from there before they come up
/// to the next point. Deterministic; safe from any thread. O(points near the other body).
/// @param near  null, or what was kept of the same two bodies in the last step: the contacts are the same, found sooner
ContactReport collide(const Placed& a, const Placed& b, const ContactOptions& options, std::vector<Contact>& contacts,
                      NearPoints* near = nullptr);

/// What a PointSampler is to find of a body in the field of another, for contacts up to a margin [m]; the places among
/// its bodies are left open. Nothing where motion takes any point farther than the margin: such points are followed on
/// their ways.
std::optional<PointQuery> pointQuery(const Placed& body, const Placed& other, float margin);

/// The body as a PointSampler sees it, which the collider must outlive.
SampledBody sampledBody(const Collider& collider);

/// The same contacts as collide(), of what a sampler has found of A in B's field and of B in A's: to the bit, if its
/// samples are. The report counts the points found as tested.
ContactReport collideFound(const Placed& a, const Placed& b, const ContactOptions& options,
                           std::span<const FoundPoint> ofA, std::span<const FoundPoint> ofB,
                           std::vector<Contact>& contacts);

/// The same for bodies of their own size.
inline ContactReport collide(const Collider& a, const Pose& poseA, const Collider& b, const Pose& poseB,
                             const ContactOptions& options, std::vector<Contact>& contacts) {
    return collide(Placed{a, poseA}, Placed{b, poseB}, options, contacts);
}

}  // namespace bilayer
