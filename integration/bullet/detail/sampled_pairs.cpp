// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/sampled_pairs.h"
#include <bilayer/collider/contact.h>
#include "collider/contact/search/sampled_contacts.h"

#include <fmt/format.h>

#include <exception>

#include "integration/bullet/detail/warning.h"
#include "sdf/base/access.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

void SampledPairs::clear() {
    bodies_.clear();
    places_.clear();
    queries_.clear();
    found_.times = {};
}

std::uint32_t SampledPairs::placeOf(const Collider& collider) {
    const auto [place, isNew] = places_.emplace(collider.id(), std::uint32_t(bodies_.size()));
    if (isNew) bodies_.push_back(sampledBody(collider));
    return place->second;
}

std::optional<std::size_t> SampledPairs::add(const Placed& a, const Placed& b, float margin) {
    auto ofA = pointQuery(a, b, margin), ofB = pointQuery(b, a, margin);
    if (!works() || !ofA || !ofB) return std::nullopt;
    ofA->body = ofB->other = placeOf(a.collider);
    ofA->other = ofB->body = placeOf(b.collider);
    queries_.push_back(*ofA);
    queries_.push_back(*ofB);
    return size() - 1;
}

bool SampledPairs::sample() {
    if (queries_.empty()) return true;
    try {
        dataOf(sampler_).sample(bodies_, queries_, found_);
        return true;
    } catch (const std::exception& error) {
        warn(fmt::format("{} failed to sample contacts, and the processor finds them instead: {}", sampler_.device(),
                         error.what())
                 .c_str());
        sampler_ = {};
        return false;
    }
}

}  // namespace bilayer::bullet::detail
