// SPDX-License-Identifier: Apache-2.0
// Contacts between a field and the triangles of an open surface.
#include "collider/contact/open_surface/triangle_contacts.h"

#include <bilayer/collider/contact.h>

#include <algorithm>
#include <array>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <optional>

#include "collider/contact/body/body_transform.h"
#include "collider/contact/open_surface/face_contacts.h"
#include "collider/contact/open_surface/nearby_triangles.h"
#include "collider/contact/open_surface/triangle_face.h"
#include "collider/contact/search/edge_contacts.h"
#include "collider/contact/search/probed_field.h"

namespace bilayer::detail {

namespace {

// A vertex or an edge of the triangles touches points whose normals oppose one of its own normals to within this
// cosine.
constexpr float minNormalCosine = 0.9f;

/// Tests the vertices and edges of triangles in a field. Shared ones are tested once.
class TriangleProbes {
  public:
    TriangleProbes(const ProbedField& field, const NearbyTriangles& triangles, ContactReport& report,
                   std::vector<Contact>& contacts)
        : field_(field), triangles_(triangles), report_(report), contacts_(contacts) {}

    /// @param isLarge  longer than the probe spacing. Inside a plane of large triangles the field's own points are more
    ///                 accurate
    void visit(std::uint32_t f, bool isLarge) const {
        const Triangle& corners = triangles_[f];
        LocalField::FieldSample samples[3];
        std::array<std::optional<Conormals>, 3> conormals;
        std::array<bool, 3> flat;
        for (int i = 0; i < 3; ++i) {
            samples[i] = field_.local.at(corners[i]);
            conormals[i] = triangles_.adjacency().conormalsOf(f, i);
            flat[i] = conormals[i] && glm::dot((*conormals[i])[0], (*conormals[i])[1]) <= flatEdge;
        }
        for (int i = 0; i < 3; ++i) {
            if (!isLarge || !flat[i] || !flat[(i + 2) % 3]) visitVertex(f, i, samples[i]);
            const Adjacency::Member& first = triangles_.adjacency().atEdge(f, i).front();
            if (first.triangle != f || first.index != i || (isLarge && flat[i])) continue;
            const glm::vec3 &from = corners[i], &to = corners[(i + 1) % 3];
            const ProbedEdge edge{
                [&](float fraction) { return glm::mix(from, to, fraction); },   {0, 0},       true,
                NearbyTriangles::featureOf(triangles_.id(f), std::uint32_t(i)), conormals[i], !flat[i]};
            visitEdge(f, i, edge, samples[i], samples[(i + 1) % 3]);
        }
    }

  private:
    void visitEdge(std::uint32_t f, int i, const ProbedEdge& edge, const LocalField::FieldSample& first,
                   const LocalField::FieldSample& last) const {
        const std::size_t before = contacts_.size();
        EdgeContacts(field_.local, field_.margin).find(edge, first, last, report_, contacts_);
        const auto normalOf = [&](const glm::vec3& towards) {
            return triangles_.adjacency().edgeNormal(f, i, towards);
        };
        std::size_t kept = before;
        for (std::size_t k = before; k < contacts_.size(); ++k)
            if (const auto contact = withNormal(contacts_[k], normalOf)) contacts_[kept++] = *contact;
        contacts_.resize(kept);
    }

    void visitVertex(std::uint32_t f, int i, const LocalField::FieldSample& sample) const {
        const std::uint32_t feature = NearbyTriangles::featureOf(triangles_.id(f), std::uint32_t(3 + i));
        const auto found = field_.local.probe(triangles_[f][i], sample, 0, feature, field_.margin, report_);
        if (!found) return;
        const auto normalOf = [&](const glm::vec3& towards) {
            return triangles_.adjacency().vertexNormal(f, i, towards);
        };
        if (const auto contact = withNormal(*found, normalOf)) contacts_.push_back(*contact);
    }

    /// The contact of an edge or a vertex with its own normal that is nearest to the field's. Nothing if it is far from
    /// the field's normal: another feature of the triangles is then nearer to the field's surface there.
    /// @param normalOf  callback for a direction towards the field, in its axes
    template <class NormalOf>
    std::optional<Contact> withNormal(Contact contact, NormalOf&& normalOf) const {
        const glm::vec3 towards = -(glm::conjugate(field_.placed.pose.rotation) * contact.normal);
        const auto normal = normalOf(towards);
        if (!normal || glm::dot(*normal, towards) < minNormalCosine) return std::nullopt;
        setNormal(contact, field_, -*normal);
        contact.roundingRadius = -1;
        return contact;
    }

    const ProbedField& field_;
    const NearbyTriangles& triangles_;
    ContactReport& report_;
    std::vector<Contact>& contacts_;
};

float maxSide(const Triangle& corners) {
    float side = 0;
    for (int i = 0; i < 3; ++i) side = std::max(side, glm::distance(corners[i], corners[(i + 1) % 3]));
    return side;
}

}  // namespace

ContactReport collideTriangles(const OpenSurface& openSurface, const Pose& pose, const Motion& motion,
                               const Placed& field, const ContactOptions& options, std::vector<Contact>& contacts) {
    ContactReport report;
    const ProbedField probed(field, pose, motion, options);
    NearbyTriangles triangles(probed, relative(field.pose, pose));
    const BodyTransform intoOpenSurface(field.pose, field.scale, pose, 1);
    openSurface.visit(intoOpenSurface.boxAround(field.collider.bounds(), probed.maxTriangleDistance()),
                      [&](const Triangle& corners, std::uint64_t id) { triangles.add(corners, id); });
    triangles.connect();

    const TriangleProbes probes(probed, triangles, report, contacts);
    FaceContacts faces(probed, triangles, report);
    std::vector<std::uint32_t> small;
    for (std::uint32_t f = 0; f < triangles.size(); ++f) {
        const bool isLarge = maxSide(triangles[f]) > probed.spacing;
        probes.visit(f, isLarge);
        if (isLarge)
            faces.visitLarge(f);
        else
            small.push_back(f);
    }
    faces.visitSmall(small);
    faces.take(contacts);
    return report;
}

}  // namespace bilayer::detail
