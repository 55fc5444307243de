// SPDX-License-Identifier: Apache-2.0
// Contacts from the results of a PointSampler.
// Tested by tests/bullet/sampled_pairs.cpp.
#pragma once

#include <bilayer/collider/contact.h>

#include <optional>
#include <span>
#include <vector>

#include "collider/contact/search/sampled_points.h"

namespace bilayer::detail {

/// The query to a PointSampler for a body in the field of another and contacts up to a margin [m]. The caller sets the
/// body indices. Nothing if motion takes any point farther than the margin: such points need the swept search.
std::optional<PointQuery> pointQuery(const Placed& body, const Placed& other, float margin);

/// The body as input of a PointSampler. The collider must outlive it.
SampledBody sampledBody(const Collider& collider);

/// The same contacts as collide(), from the sampler's results for A in the field of B and for B in the field of A. They
/// are equal bit for bit if the samples are. The report counts the found points as tested.
ContactReport collideFound(const Placed& a, const Placed& b, const ContactOptions& options,
                           std::span<const FoundPoint> ofA, std::span<const FoundPoint> ofB,
                           std::vector<Contact>& contacts);

}  // namespace bilayer::detail
