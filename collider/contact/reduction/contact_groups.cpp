// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/reduction/contact_groups.h"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace bilayer::detail {

namespace {

// Normals of a patch that continues from the last step stay within about 32 degrees. Its direction is that of the kept
// contacts, and jitters with them; the grouping of the contacts must not.
constexpr float continuedDirection = 0.85f;
// More patches than any resting body needs. Contacts of further directions join the best matching patch.
constexpr std::size_t maxPatches = 8;
// A patch of the last step continues until its normal is within about 15 degrees of another's.
constexpr float mergedDirection = 0.966f;

/// The current directions of the groups of the last step, from those of their contacts that still exist. Without a last
/// step, the mean direction of all contacts if they differ little from it, else nothing.
std::vector<glm::vec3> directionsOf(const std::vector<Contact>& contacts, const LastContacts& last) {
    std::vector<glm::vec3> sums(std::size_t(std::max(last.groups(), 1)), glm::vec3(0)), directions;
    for (const Contact& contact : contacts)
        if (const int group = last.groups() > 0 ? last.groupOf(contact) : 0; group >= 0)
            sums[std::size_t(group)] += contact.normal;
    for (const glm::vec3& sum : sums) {
        const float length = glm::length(sum);
        const auto isSame = [&](const glm::vec3& other) { return glm::dot(sum, other) >= mergedDirection * length; };
        if (length > 0 && std::none_of(directions.begin(), directions.end(), isSame))
            directions.push_back(sum / length);
    }
    const auto fits = [&](const Contact& contact) {
        return glm::dot(contact.normal, directions.front()) >= sameDirection;
    };
    if (last.groups() == 0 && !directions.empty() && !std::all_of(contacts.begin(), contacts.end(), fits)) return {};
    return directions;
}

}  // namespace

LastContacts::LastContacts(std::span<const ContactPatch> last) {
    for (const ContactPatch& patch : last) {
        groups_ += !patch.continuesPrevious;
        for (int i = 0; i < patch.count; ++i) features_.emplace_back(patch.contacts[i].feature, groups_ - 1);
    }
    std::sort(features_.begin(), features_.end());
}

std::vector<ContactGroup> groupByNormal(const std::vector<Contact>& contacts, const LastContacts& last) {
    std::vector<glm::vec3> directions = directionsOf(contacts, last);
    const std::size_t continued = last.groups() > 0 ? directions.size() : 0;
    const auto nearest = [&](const glm::vec3& normal) {
        std::pair<float, std::size_t> best{-2.f, 0};
        for (std::size_t g = 0; g < directions.size(); ++g)
            if (const float cosine = glm::dot(normal, directions[g]); cosine > best.first) best = {cosine, g};
        return best;
    };
    std::vector<ContactGroup> groups(directions.size());
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
        const auto [cosine, best] = nearest(contacts[i].normal);
        const float same = best < continued ? continuedDirection : sameDirection;
        if (cosine < same && groups.size() < maxPatches) {
            directions.push_back(contacts[i].normal);
            groups.push_back({i});
        } else {
            groups[best].push_back(i);
        }
    }
    std::erase_if(groups, [](const ContactGroup& group) { return group.empty(); });
    return groups;
}

float extentOf(const std::vector<Contact>& contacts, const ContactGroup& group) {
    glm::vec3 lower = contacts[group.front()].position, upper = lower;
    for (std::uint32_t i : group) {
        lower = glm::min(lower, contacts[i].position);
        upper = glm::max(upper, contacts[i].position);
    }
    return glm::distance(lower, upper);
}

}  // namespace bilayer::detail
