// SPDX-License-Identifier: Apache-2.0
// Refinement of contacts to the closest points of two surfaces.
// Tested by tests/collider/collide.cpp through collide().
#pragma once

#include <bilayer/collider/contact.h>

#include <span>

namespace bilayer::detail {

/// Refines the contacts that may be the closest of two bodies, for exact distances. Contacts between surface points are
/// only approximate there: edges made of surface points may cut across the surface.
void refineClosest(std::span<Contact> contacts, const Placed& a, const Placed& b);

}  // namespace bilayer::detail
