// SPDX-License-Identifier: Apache-2.0
// Groups of contacts with similar normals: the contact patches before their reduction.
// Tested by tests/collider/contact_reduction.cpp through reduce().
#pragma once

#include <bilayer/collider/contact.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "collider/contact/contact_reduction.h"

namespace bilayer::detail {

/// Normals within about 25 degrees form one patch, flat enough for four points to carry it. A new contact continues an
/// old one within this angle.
inline constexpr float sameDirection = 0.9f;

/// Contacts of one patch, as indices in ascending order of the remaining distance.
using ContactGroup = std::vector<std::uint32_t>;

/// The contacts of the last step, by feature.
class LastContacts {
  public:
    explicit LastContacts(std::span<const ContactPatch> last);

    /// The count of groups.
    int groups() const { return groups_; }

    /// The group that the contact was kept in; -1 if it was not kept.
    int groupOf(const Contact& contact) const {
        const auto at = std::lower_bound(features_.begin(), features_.end(), std::pair(contact.feature, 0));
        return at != features_.end() && at->first == contact.feature ? at->second : -1;
    }
    bool kept(const Contact& contact) const { return groupOf(contact) >= 0; }

  private:
    std::vector<std::pair<std::uint32_t, int>> features_;
    int groups_ = 0;
};

/// Divides contacts into groups by their normals. The groups of the last step come first and continue.
std::vector<ContactGroup> groupByNormal(const std::vector<Contact>& contacts, const LastContacts& last);

/// The extent of a group: the size of the bounding box of its positions.
float extentOf(const std::vector<Contact>& contacts, const ContactGroup& group);

}  // namespace bilayer::detail
