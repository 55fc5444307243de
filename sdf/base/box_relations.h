// SPDX-License-Identifier: Apache-2.0
// Whether bounding boxes overlap or hold each other. Boxes that only touch count as overlapping.
// Tested by tests/sdf/part_nesting.cpp through PartNesting.
#pragma once

#include <glm/vector_relational.hpp>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

inline bool holds(const Bounds& outer, const Bounds& inner) {
    return glm::all(glm::lessThanEqual(outer.lower, inner.lower)) &&
           glm::all(glm::greaterThanEqual(outer.upper, inner.upper));
}

inline bool overlap(const Bounds& a, const Bounds& b) {
    return glm::all(glm::lessThanEqual(a.lower, b.upper)) && glm::all(glm::lessThanEqual(b.lower, a.upper));
}

}  // namespace bilayer::detail
