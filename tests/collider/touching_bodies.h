// SPDX-License-Identifier: Apache-2.0
// Bodies with fields by formula, and pairs of them in contact.
#pragma once

#include <catch2/catch.hpp>
#include <utility>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include "demos/shared/shapes.h"
#include "tests/support/analytic.h"
#include "tests/support/contacts.h"
#include "tests/support/random_pose.h"

namespace bilayer::test {

inline constexpr float h = 0.02f;  // voxel

inline const Collider& ball() {
    static const Collider collider(shapes::sphere(0.4f, 4), levelSetOf(sphereSolid(0.4), h));
    return collider;
}

inline const Collider& brick() {
    static const Collider collider(shapes::box({0.3f, 0.2f, 0.1f}), levelSetOf(boxSolid({0.3, 0.2, 0.1}), h));
    return collider;
}

inline const Collider& slab() {
    static const Collider collider(shapes::box({0.6f, 0.6f, 0.1f}), levelSetOf(boxSolid({0.6, 0.6, 0.1}), h));
    return collider;
}

inline const Collider& ring() {
    static const Collider collider(shapes::torus(0.35f, 0.13f), levelSetOf(torusSolid(0.35, 0.13), h));
    return collider;
}

inline std::vector<Contact> contactsOf(const Placed& a, const Placed& b, float margin,
                                       ContactReport* report = nullptr) {
    std::vector<Contact> contacts;
    const ContactReport seen = collide(a, b, unfiltered(margin), contacts);
    if (report) *report = seen;
    return contacts;
}

// Pairs of bodies in contact: one is moved until the other's surface is near its own.
inline std::vector<std::pair<Placed, Placed>> touchingPairs(Random& random) {
    std::vector<std::pair<Placed, Placed>> pairs;
    const std::vector<const Collider*> all{&ball(), &brick(), &slab(), &ring()};
    for (int i = 0; pairs.size() < 30 && i < 10000; ++i) {
        const Placed a{*all[i % 4], randomPose(random, 0.6)}, b{*all[i / 4 % 4], randomPose(random, 0.6)};
        const float depth = minDistance(contactsOf(a, b, h));
        if (depth < 0 && depth > -1.5f * h) pairs.emplace_back(a, b);
    }
    REQUIRE(pairs.size() >= 10);
    return pairs;
}

}  // namespace bilayer::test
