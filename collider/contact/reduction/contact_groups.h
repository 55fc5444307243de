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

#include "collider/contact/reduction/contact_reduction.h"

namespace bilayer::detail {

/// Min cosine between the normals of one patch: 25 degrees, flat enough for four points to bear the loads of all. A
/// contact whose normal differs by less from that of the last step is the same contact.
inline constexpr float sameDirection = 0.9f;

/// Contacts of one patch, as indices in ascending order of the remaining distance.
using ContactGroup = std::vector<std::uint32_t>;

/// The contacts of the last step, by feature.
class LastContacts {
  public:
    explicit LastContacts(std::span<const ContactPatch> last);

    /// The count of groups.
    int groups() const { return groups_; }

    /// The group in which the contact's feature was kept in the last step; -1 for a feature that was not.
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
