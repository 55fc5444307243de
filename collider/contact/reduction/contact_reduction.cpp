// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/reduction/contact_reduction.h"

#include <bilayer/collider/contact.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <utility>

#include "collider/contact/reduction/contact_cache.h"
#include "collider/contact/reduction/contact_groups.h"
#include "collider/contact/reduction/first_contacts.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

namespace {

// Bodies count as almost at rest if the deepest penetration has changed by less than this fraction of the contacts'
// extent in one step. Contacts of the last step are then preferred, and patches keep their places. In an impact all
// contacts are chosen again.
constexpr float restTolerance = 3e-3f;
// Contacts are chosen again when the bodies have moved relative to each other by this fraction of the tolerance.
constexpr float slackTolerances = 0.5f;
// They are chosen again, too, when another contact is deeper by this fraction of the slack.
constexpr float normalMotionSlack = normalMotionTolerance / (slackTolerances * reductionTolerance);

bool isStill(const std::vector<Contact>& contacts, std::span<const ContactPatch> last) {
    if (contacts.empty() || last.empty()) return false;
    float before = std::numeric_limits<float>::max();
    for (const ContactPatch& patch : last)
        for (int i = 0; i < patch.count; ++i) before = std::min(before, patch.contacts[i].remaining());
    ContactGroup all(contacts.size());
    std::iota(all.begin(), all.end(), 0u);
    return std::abs(contacts.front().remaining() - before) <= restTolerance * extentOf(contacts, all);
}

}  // namespace

ReducedContacts reduce(std::vector<Contact>& contacts, std::span<const ContactPatch> last, float rotation) {
    std::stable_sort(contacts.begin(), contacts.end(),
                     [](const Contact& a, const Contact& b) { return a.remaining() < b.remaining(); });
    if (!isStill(contacts, last)) last = {};
    ReducedContacts result;
    const bool approaches =
        std::any_of(contacts.begin(), contacts.end(), [](const Contact& contact) { return contact.approach > 0; });
    const LastContacts lastContacts(last);
    float minExtent = std::numeric_limits<float>::max();
    for (const ContactGroup& group : groupByNormal(contacts, lastContacts)) {
        std::vector<std::uint32_t> kept(group.size());
        std::iota(kept.begin(), kept.end(), 0u);
        if (group.size() > patchSize) {
            FirstContacts first = firstContacts(contacts, group, lastContacts, rotation);
            kept = std::move(first.kept);
            result.reductionError = std::max(result.reductionError, first.reductionError);
            minExtent = std::min(minExtent, extentOf(contacts, group));
            result.slack = approaches ? 0 : slackTolerances * reductionTolerance * minExtent;
        }
        for (std::size_t k = 0; k < kept.size(); ++k) {
            if (k % patchSize == 0) result.patches.emplace_back();
            ContactPatch& patch = result.patches.back();
            patch.continuesPrevious = k >= patchSize;
            patch.contacts[std::size_t(patch.count++)] = contacts[group[kept[k]]];
        }
    }
    return result;
}

void ContactReduction::update(std::vector<Contact>& contacts, const Pose& a, const Pose& b, float rotation) {
    if (holds(a, b) && reuse(contacts)) return;
    reduced_ = reduce(contacts, reduced_.patches, rotation);
    kept_.clear();
    for (const ContactPatch& patch : reduced_.patches)
        for (int i = 0; i < patch.count; ++i) {
            const glm::vec3& place = patch.contacts[i].position;
            kept_.push_back({patch.contacts[i].feature, a.toBody(place), b.toBody(place)});
        }
    byFeature_.resize(kept_.size());
    std::iota(byFeature_.begin(), byFeature_.end(), 0u);
    std::stable_sort(byFeature_.begin(), byFeature_.end(),
                     [&](std::uint32_t i, std::uint32_t j) { return kept_[i].feature < kept_[j].feature; });
}

/// The kept contacts span all contacts, so none of these has moved farther.
bool ContactReduction::holds(const Pose& a, const Pose& b) const {
    const auto hasHardlyMoved = [&](const Kept& kept) {
        return glm::distance(a.toWorld(kept.ofA), b.toWorld(kept.ofB)) <= reduced_.slack;
    };
    return reduced_.slack > 0 && std::all_of(kept_.begin(), kept_.end(), hasHardlyMoved);
}

/// Whether all chosen contacts exist again, no contact is predicted, and no other contact is deeper than these by more
/// than normalMotionTolerance.
bool ContactReduction::reuse(const std::vector<Contact>& contacts) {
    std::vector<const Contact*> found(kept_.size(), nullptr);
    float deepest = std::numeric_limits<float>::max(), deepestFound = deepest;
    for (const Contact& contact : contacts) {
        if (contact.approach > 0) return false;
        deepest = std::min(deepest, contact.distance);
        auto at = std::lower_bound(byFeature_.begin(), byFeature_.end(), contact.feature,
                                   [&](std::uint32_t i, std::uint32_t feature) { return kept_[i].feature < feature; });
        // several contacts of one feature are matched in turn
        while (at != byFeature_.end() && kept_[*at].feature == contact.feature && found[*at]) ++at;
        if (at != byFeature_.end() && kept_[*at].feature == contact.feature) found[*at] = &contact;
    }
    for (const Contact* contact : found) {
        if (!contact) return false;
        deepestFound = std::min(deepestFound, contact->distance);
    }
    if (deepest < deepestFound - normalMotionSlack * reduced_.slack) return false;
    auto next = found.begin();
    for (ContactPatch& patch : reduced_.patches)
        for (int i = 0; i < patch.count; ++i) patch.contacts[i] = **next++;
    return true;
}

void reduceFrom(std::size_t first, std::vector<Contact>& contacts, const Pose& a, const Pose& b, float rotation,
                ContactCache* cache) {
    const auto begin = contacts.begin() + std::ptrdiff_t(first);
    std::vector<Contact> found(begin, contacts.end());
    contacts.erase(begin, contacts.end());
    ContactReduction once;
    ContactReduction& reduction = cache ? dataOf(*cache).reduction : once;
    reduction.update(found, a, b, rotation);
    for (const ContactPatch& patch : reduction.reduced().patches)
        contacts.insert(contacts.end(), patch.contacts.begin(), patch.contacts.begin() + patch.count);
}

}  // namespace bilayer::detail
