// SPDX-License-Identifier: Apache-2.0
// Contacts of a field's surface points with the faces of triangles.
// Tested by tests/bullet/sliding.cpp through bullet::Dispatcher.
#pragma once

#include <bilayer/collider/contact.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "collider/contact/open_surface/face_height.h"
#include "collider/contact/open_surface/nearby_triangles.h"
#include "collider/contact/open_surface/triangle_face.h"
#include "collider/contact/search/probed_field.h"

namespace bilayer::detail {

class FaceContacts {
  public:
    FaceContacts(const ProbedField& field, const NearbyTriangles& triangles, ContactReport& report)
        : field_(field), triangles_(triangles), height_(field, triangles), report_(report) {}

    /// Tests a triangle that is larger than the probe spacing: the field at the feet of its own surface points, which
    /// finds bumps over the face. Points that are not over the face belong to its edges and neighbours.
    void visitLarge(std::uint32_t triangle);

    /// Tests small triangles. Their vertices and edges are enough, except for a convex vertex of the field between
    /// them.
    void visitSmall(const std::vector<std::uint32_t>& triangles);

    /// Hands over the contacts. A point over several faces, as in a valley, has a contact and a feature for each of
    /// them.
    void take(std::vector<Contact>& contacts);

  private:
    /// A convex vertex of the field, or an end of its edges.
    struct SharpVertex {
        glm::vec3 place;
        std::uint32_t index;
    };
    /// The contact of a surface point of the field with a triangle.
    struct OverFace {
        std::uint32_t point;
        std::uint64_t face;  ///< its id
        Contact contact;
    };

    std::vector<SharpVertex> sharpVerticesNear(const std::vector<std::uint32_t>& triangles) const;
    void visitSmall(std::uint32_t triangle, TriangleFace& face, const SharpVertex& vertex);
    std::optional<Contact> contactOver(const TriangleFace& face, bool probesFoot, std::uint32_t index,
                                       const SurfacePoint& point);
    std::optional<Contact> contactBelowCrease(const TriangleFace& face, std::uint32_t index, const glm::vec3& normal,
                                              float height);
    bool reaches(const TriangleFace& face, const glm::vec3& place, const glm::vec3& normal, float height) const;
    Contact contactAt(const glm::vec3& place, const glm::vec3& normal, float height);
    std::optional<Contact> contactAtFoot(const glm::vec3& foot, const glm::vec3& normal,
                                         const LocalField::FieldSample& there);

    const ProbedField& field_;
    const NearbyTriangles& triangles_;
    FaceHeight height_;
    ContactReport& report_;
    std::vector<OverFace> found_;
};

}  // namespace bilayer::detail
