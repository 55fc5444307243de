// A field as the other body of a pair sees it: in metres and in the field's axes, with the way that the other body
// goes; internal.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include "collider/contact/edge_search.h"
#include "collider/contact/motion.h"
#include "collider/contact/sharp_edges.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

// A surface point touches a face that looks against its own normal, by this cosine at least: the points below the edge
// of a box must not be pushed out sideways. The corners of a cube, whose normals are mixed of three, reach 0.57.
// Those of faces that do not touch yet: farther aslant is an edge of the other body beside them.
inline constexpr ContactOptions normalFilter{
    .minNormalCosine = 0.3f, .minNormalCosineApart = 0.9f, .keepsObliqueEdges = false};
// Edges get no more parts: numbers beyond are those of the next edge.
inline constexpr int partBits = 15;

/// A field in metres of the world and the axes of its body, and how another body moves towards it.
class LocalField {
  public:
    /// @param reach     up to which contacts are made [m]
    /// @param measured  as in ContactOptions
    LocalField(const Placed& field, const Pose& other, const Motion& motion, float reach, bool measured);

    const Collider& collider() const { return collider_; }
    /// Of the other body's points as the field sees them.
    const RelativeMotion& relativeMotion() const { return relativeMotion_; }
    /// The longest way of any that is in the field's box; those that come from afar may go farther by their turn.
    float longestWay() const { return longestWay_; }

    struct Answer {
        enum { near, outside, inside, unclear } where = unclear;
        float distance = 0;   ///< [m]
        glm::vec3 normal{0};  ///< of unit length if near
        glm::vec3 gradient{0};

        bool isKnown() const { return where == near || where == unclear; }
    };

    /// @param radius  by which the point is grown [m]
    Answer at(const glm::vec3& point, float radius = 0) const;

    /// The contact of a point of the other body's core, grown by a radius.
    std::optional<Contact> probe(const glm::vec3& point, const Answer& answer, float radius, std::uint32_t feature,
                                 float margin, ContactReport& report) const;

    /// An edge of the other body, or the middle of one that is round.
    struct Edge {
        std::function<glm::vec3(float)> place;  ///< by the part of the way
        float radius[2];                        ///< by which it is grown at its ends [m]
        bool isStraight;
        std::uint32_t feature;               ///< the first of 2^(partBits + 1)
        std::optional<Conormals> conormals;  ///< of a sharp edge between two faces
        bool isSearched = true;              ///< between the probes

        float radiusAt(float part) const { return radius[0] + part * (radius[1] - radius[0]); }
        glm::vec3 directionAt(float part) const;
    };

    /// The contacts along an edge, ends excluded: of places that lie close enough to each other, and where it goes
    /// deeper between two of them of the deepest one.
    /// @param first, last  the answers at its ends
    void probeEdge(const Edge& edge, const Answer& first, const Answer& last, float margin, ContactReport& report,
                   std::vector<Contact>& contacts) const;

    /// Where an edge between two of its places is deepest, if it falls from either, or crosses a sharp edge.
    std::optional<Contact> deepestBetween(const Edge& edge, float from, const Answer& atFrom, float to,
                                          const Answer& atTo, float margin) const;

    /// Contact::approach of the other body's point.
    float approach(const glm::vec3& point, const glm::vec3& normal, float margin) const;

    Contact contact(const glm::vec3& position, const glm::vec3& normal, float distance, std::uint32_t feature,
                    float approach = 0) const;

  private:
    /// Of an edge, between two of its places.
    struct Piece {
        const Edge& edge;
        float from, to;  ///< parts of the edge's way
        float length;    ///< [m]

        float partAt(float way) const { return from + way / length * (to - from); }
    };

    bool comesNear(const glm::vec3& from, const glm::vec3& to, float reach) const;
    std::optional<Contact> probeOnWay(const glm::vec3& point, float radius, std::uint32_t feature, float margin,
                                      float distance) const;
    Slope slopeOf(const Piece& piece, float way, const Answer& answer) const;
    std::optional<SharpEdges::Crossing> crossingAt(const Edge& edge, float part, const Answer& there) const;
    std::optional<Contact> touchAcross(const Piece& piece, float way, const Answer& there, float margin) const;
    Answer exactly(const glm::vec3& point, const Sample& sample) const;
    Answer farAway(const glm::vec3& point, float radius, float bound) const;

    const Collider& collider_;
    const Field& field_;
    bool measured_;
    float scale_, voxel_;
    Pose pose_;
    RelativeMotion relativeMotion_;
    float longestWay_;
    float exactReach_;    ///< up to which triangles are asked, where the field has any [m]
    float farReach_ = 0;  ///< where contacts are asked for beyond the band; in the field's size
};

}  // namespace bilayer::bullet::detail
