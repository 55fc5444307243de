// Contacts of points that a PointSampler has found.
#pragma once

#include <bilayer/collider/contact.h>

#include <optional>
#include <span>
#include <vector>

#include "collider/contact/sampled_points.h"

namespace bilayer::detail {

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

}  // namespace bilayer::detail
