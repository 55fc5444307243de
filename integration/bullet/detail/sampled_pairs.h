// The pairs of fields in a step whose points are sampled elsewhere, on an OpenCL device for example, all in one batch.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include "collider/contact/sampled_contacts.h"
#include "collider/contact/sampled_points.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

class SampledPairs {
  public:
    explicit SampledPairs(PointSampler sampler) : sampler_(std::move(sampler)) {}

    /// Whether there is a sampler that works.
    bool works() const { return static_cast<bool>(sampler_.sample); }

    /// Begins a step.
    void clear();

    /// Takes a pair into the batch. Nothing for one that is to be collided without: whose motion is to be followed.
    /// @return its number; the colliders must stay until the sample()
    std::optional<std::size_t> add(const Placed& a, const Placed& b, float margin);

    /// Samples all pairs of the batch. Where the sampler fails, that is told once on the standard error output, and it
    /// is not asked again.
    /// @return whether it has not
    bool sample();

    std::size_t size() const { return queries_.size() / 2; }
    std::span<const FoundPoint> ofA(std::size_t pair) const { return found_.of(2 * pair); }
    std::span<const FoundPoint> ofB(std::size_t pair) const { return found_.of(2 * pair + 1); }

  private:
    std::uint32_t placeOf(const Collider& collider);

    PointSampler sampler_;
    std::vector<SampledBody> bodies_;
    std::map<std::uint64_t, std::uint32_t> places_;  // of bodies, by Collider::id()
    std::vector<PointQuery> queries_;                // two for each pair
    FoundPoints found_;
};

}  // namespace bilayer::bullet::detail
