#include "collider/contact/contact_cache.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace bilayer::detail {
namespace {

// Slack of a list. A longer slack keeps the list valid for more steps, but lists more points.
constexpr float minSlack = 0.25f;   // [voxels]
constexpr float stepsThatHold = 8;  // the count of steps that a list should be valid for
constexpr float rounding = 1e-5f;   // of places, relative to the lengths that they come from
const float halfRoot = std::sqrt(0.5f);

bool sameBodies(const CandidateLists::Place& a, const CandidateLists::Place& b) {
    return a.body == b.body && a.other == b.other && a.reach == b.reach;
}

// An upper bound of the displacement of any point in a sphere between two places. The difference of two rotations
// scales vectors in a plane by 2 sin(angle / 2), and is zero along the axis. The factor is its Frobenius norm over the
// root of two.
float moved(const CandidateLists::Place& from, const CandidateLists::Place& to, const glm::vec3& centre, float radius) {
    const glm::mat3 turn = to.linear - from.linear;
    const float norm2 = glm::dot(turn[0], turn[0]) + glm::dot(turn[1], turn[1]) + glm::dot(turn[2], turn[2]);
    const glm::vec3 way = turn * centre + (to.shift - from.shift);
    const float size = glm::length(to.shift) + glm::length(to.linear[0]) * (glm::length(centre) + radius);
    return glm::length(way) + radius * halfRoot * std::sqrt(norm2) + rounding * size;
}

}  // namespace

bool CandidateLists::List::holds(const Place& now, const glm::vec3& centre, float radius, float voxel, float maxSlack) {
    const bool same = sameBodies(now, last_);
    const float step = same ? moved(last_, now, centre, radius) : maxSlack;
    last_ = now;
    if (same && slack_ > 0 && moved(listed_, now, centre, radius) <= slack_) return true;
    slack_ = std::max(minSlack * voxel, stepsThatHold * step);
    if (!(slack_ <= maxSlack)) slack_ = 0;
    listed_ = now;
    points_.clear();
    return false;
}

}  // namespace bilayer::detail
