// SPDX-License-Identifier: Apache-2.0
// Cores in closed form: segments, boxes and solids of revolution. All are centred at the origin, in metres.
// Tested by tests/bullet/convex.cpp through Convex.
#pragma once

#include "collider/contact/shapes/convex_core.h"

namespace bilayer::detail {

/// A segment along a coordinate axis, or a point.
class SegmentCore : public ConvexCore {
  public:
    SegmentCore(int axis, float halfHeight);
    NearestPoint nearest(const glm::vec3& point, float reach) const override;
    bool isRound(const NearestPoint&) const override { return true; }

  private:
    int axis_;
    float halfHeight_;
};

class BoxCore : public ConvexCore {
  public:
    explicit BoxCore(const glm::vec3& halfExtents);
    NearestPoint nearest(const glm::vec3& point, float reach) const override;
    bool isCurved() const override { return false; }
    bool isFlat(const NearestPoint&) const override { return true; }

  private:
    glm::vec3 halfExtents_;
};

/// A truncated cone between two discs.
class RevolutionCore : public ConvexCore {
  public:
    /// @param lowerRadius, upperRadius  of the discs at the ends of the axis
    /// @param growth                    of the body around the core
    RevolutionCore(int axis, float halfHeight, float lowerRadius, float upperRadius, float growth);
    NearestPoint nearest(const glm::vec3& point, float reach) const override;
    bool isFlat(const NearestPoint& nearest) const override;
    bool isRound(const NearestPoint& nearest) const override;
    glm::vec3 supportNear(const NearestPoint& nearest, const glm::vec3& direction) const override;
    glm::vec3 support(const glm::vec3& direction) const override;
    std::optional<std::array<glm::vec3, 2>> sideLine(const NearestPoint& nearest,
                                                     const glm::vec3& place) const override;
    glm::vec3 place(const ConvexEdge& edge, float fraction) const override;

  private:
    void addRim(float height, float rim);
    bool isOnSide(const NearestPoint& nearest) const;
    std::array<glm::vec3, 2> lineAlong(const glm::vec3& out) const;

    int axis_;
    float halfHeight_, lowerRadius_, upperRadius_, tolerance_;
    float minSidePart_;    ///< min part across the axis of a normal that does not belong to a flat end
    float maxSideCosine_;  ///< max cosine of the angle between such a normal and the axis
};

}  // namespace bilayer::detail
