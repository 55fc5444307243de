// SPDX-License-Identifier: Apache-2.0
// The pairs of fields of a step whose points a sampler samples in one batch, for example on an OpenCL device.
// Tested by tests/bullet/sampled_pairs.cpp through bullet::Dispatcher.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include "collider/contact/search/sampled_contacts.h"
#include "collider/contact/search/sampled_points.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

class SampledPairs {
  public:
    explicit SampledPairs(PointSampler sampler) : sampler_(std::move(sampler)) {}

    /// Whether there is a sampler that works.
    bool works() const { return static_cast<bool>(sampler_); }

    /// Begins a step.
    void clear();

    /// Adds a pair to the batch. Nothing for a pair that must be collided without the sampler, because it needs
    /// speculative contacts.
    /// @return its number; the colliders must outlive the call of sample()
    std::optional<std::size_t> add(const Placed& a, const Placed& b, float margin);

    /// Samples all pairs of the batch. If the sampler fails, that is reported once by warn(), and the sampler is not
    /// used again.
    /// @return whether it succeeded
    bool sample();

    /// What the device took for the batch.
    const DeviceTimes& times() const { return found_.times; }
    std::size_t size() const { return queries_.size() / 2; }
    std::span<const FoundPoint> ofA(std::size_t pair) const { return found_.of(2 * pair); }
    std::span<const FoundPoint> ofB(std::size_t pair) const { return found_.of(2 * pair + 1); }

  private:
    std::uint32_t placeOf(const Collider& collider);

    PointSampler sampler_;
    std::vector<SampledBody> bodies_;
    std::map<std::uint64_t, std::uint32_t> places_;  // indices of bodies, by Collider::id()
    std::vector<PointQuery> queries_;                // two for each pair
    FoundPoints found_;
};

}  // namespace bilayer::bullet::detail
