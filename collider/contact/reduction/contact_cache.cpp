// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/reduction/contact_cache.h"

#include <bilayer/collider/contact.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace bilayer::detail {
namespace {

// Slack of a list. A longer slack keeps the list valid for more steps, but lists more points.
constexpr float minSlack = 0.25f;          // [voxels]
constexpr float minValidSteps = 8;         // the count of steps that a list should be valid for
constexpr float positionRounding = 1e-5f;  // of positions, relative to the lengths that they come from
const float halfRoot = std::sqrt(0.5f);

bool isSameSearch(const CandidateLists::RelativePose& a, const CandidateLists::RelativePose& b) {
    return a.body == b.body && a.other == b.other && a.reach == b.reach;
}

// An upper bound of the displacement of any point in a sphere between two poses. The difference of two rotations
// scales vectors in a plane by 2 sin(angle / 2), and is zero along the axis. The factor is its Frobenius norm over the
// root of two.
float maxDisplacement(const CandidateLists::RelativePose& from, const CandidateLists::RelativePose& to,
                      const glm::vec3& centre, float radius) {
    const glm::mat3 change = to.linear - from.linear;
    const float norm2 =
        glm::dot(change[0], change[0]) + glm::dot(change[1], change[1]) + glm::dot(change[2], change[2]);
    const glm::vec3 displacement = change * centre + (to.shift - from.shift);
    const float size = glm::length(to.shift) + glm::length(to.linear[0]) * (glm::length(centre) + radius);
    return glm::length(displacement) + radius * halfRoot * std::sqrt(norm2) + positionRounding * size;
}

}  // namespace

bool CandidateLists::List::keepOrReset(const RelativePose& pose, const glm::vec3& centre, float radius, float voxel,
                                       float maxSlack) {
    const bool same = isSameSearch(pose, last_);
    const float step = same ? maxDisplacement(last_, pose, centre, radius) : maxSlack;
    last_ = pose;
    if (same && slack_ > 0 && maxDisplacement(listed_, pose, centre, radius) <= slack_) return true;
    slack_ = std::max(minSlack * voxel, minValidSteps * step);
    if (!(slack_ <= maxSlack)) slack_ = 0;
    listed_ = pose;
    points_.clear();
    return false;
}

}  // namespace bilayer::detail

namespace bilayer {

using namespace detail;

ContactCache::ContactCache() : data_(std::make_unique<ContactMemory>()) {}
ContactCache::~ContactCache() = default;
ContactCache::ContactCache(ContactCache&&) noexcept = default;
ContactCache& ContactCache::operator=(ContactCache&&) noexcept = default;

}  // namespace bilayer
