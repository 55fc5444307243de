// SPDX-License-Identifier: Apache-2.0
// Contacts of points that a motion takes to a field's surface.
#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include <bilayer/collider/collider.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/search/local_field.h"
#include "demos/shared/shapes.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::local_field_test {
using namespace bilayer::detail;
using namespace bilayer::test;

TEST_CASE("a point that slides into the surface next to it, or past its edges, does not meet it from behind") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    constexpr float voxel = 0.0125f;
    const Mesh torus = shapes::torus(0.22f, 0.08f);
    const Collider collider(torus, build(torus, {.voxelSize = voxel}), {.accuracy = ContactAccuracy::exact});
    int found = 0, reversed = 0;
    for (int i = 0; i < 300000; ++i) {
        const glm::vec3 start = glm::vec3(0.32f, 0.32f, 0.1f) * glm::vec3(random.point(1));
        const ClosestPoint surface = collider.exactField().closest(start);
        const glm::vec3 point = surface.position + float(random(1e-4, 0.1)) * voxel * surface.normal;
        const glm::vec3 along = glm::normalize(glm::cross(surface.normal, glm::vec3(random.direction())));
        const Motion motion{voxel * (float(random(0.3, 2)) * along - float(random(0, 0.1)) * surface.normal), {}};
        const LocalField field({.collider = collider}, {}, motion, glm::length(motion.displacement), false);
        const LocalField::FieldSample sample = field.at(point);
        if (!(sample.distance > 0)) continue;
        ContactReport report;
        const auto contact = field.probe(point, sample, 0, 0, 0, report);
        if (!contact) continue;
        ++found;
        reversed += glm::dot(contact->normal, surface.normal) < 0;
    }
    CHECK(found > 10000);
    CHECK(reversed == 0);
}
}  // namespace bilayer::local_field_test
