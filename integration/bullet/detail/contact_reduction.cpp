// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/contact_reduction.h"

#include <bilayer/collider/contact.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "integration/bullet/detail/contact_groups.h"
#include "integration/bullet/detail/convert.h"
#include "integration/bullet/detail/first_contacts.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Bodies count as almost at rest if the deepest penetration has changed by less than this fraction of the contacts'
// extent in one step. Contacts of the last step are then preferred, and patches keep their places. In an impact all
// contacts are chosen again.
constexpr float restTolerance = 3e-3f;
// Contacts are chosen again when the bodies have moved relative to each other by this fraction of the tolerance.
constexpr float slackTolerances = 0.5f;
// They are chosen again, too, when another contact is deeper by this fraction of the slack.
constexpr float pressSlack = pressTolerance / (slackTolerances * reductionTolerance);

bool isStill(const std::vector<Contact>& contacts, std::span<const Patch> last) {
    if (contacts.empty() || last.empty()) return false;
    float before = std::numeric_limits<float>::max();
    for (const Patch& patch : last)
        for (int i = 0; i < patch.count; ++i) before = std::min(before, patch.contacts[i].remaining());
    Group all(contacts.size());
    std::iota(all.begin(), all.end(), 0u);
    return std::abs(contacts.front().remaining() - before) <= restTolerance * extentOf(contacts, all);
}

}  // namespace

ReducedContacts reduce(std::vector<Contact>& contacts, std::span<const Patch> last) {
    std::stable_sort(contacts.begin(), contacts.end(),
                     [](const Contact& a, const Contact& b) { return a.remaining() < b.remaining(); });
    if (!isStill(contacts, last)) last = {};
    ReducedContacts result;
    const LastContacts lastContacts(last);
    float minExtent = std::numeric_limits<float>::max();
    for (const Group& group : groupByNormal(contacts, lastContacts)) {
        std::vector<std::uint32_t> kept(group.size());
        std::iota(kept.begin(), kept.end(), 0u);
        if (group.size() > MANIFOLD_CACHE_SIZE) {
            FirstContacts first = firstContacts(contacts, group, lastContacts);
            kept = std::move(first.kept);
            result.reductionError = std::max(result.reductionError, first.reductionError);
            minExtent = std::min(minExtent, extentOf(contacts, group));
            result.slack = slackTolerances * reductionTolerance * minExtent;
        }
        for (std::size_t k = 0; k < kept.size(); ++k) {
            if (k % MANIFOLD_CACHE_SIZE == 0) result.patches.emplace_back();
            Patch& patch = result.patches.back();
            patch.continuesPrevious = k >= MANIFOLD_CACHE_SIZE;
            patch.contacts[std::size_t(patch.count++)] = contacts[group[kept[k]]];
        }
    }
    return result;
}

void ContactReduction::update(std::vector<Contact>& contacts, const btTransform& a, const btTransform& b) {
    if (holds(a, b) && reuse(contacts)) return;
    reduced_ = reduce(contacts, reduced_.patches);
    const btTransform intoA = a.inverse(), intoB = b.inverse();
    kept_.clear();
    for (const Patch& patch : reduced_.patches)
        for (int i = 0; i < patch.count; ++i) {
            const btVector3 place = toBullet(patch.contacts[i].position);
            kept_.push_back({patch.contacts[i].feature, intoA * place, intoB * place});
        }
    byFeature_.resize(kept_.size());
    std::iota(byFeature_.begin(), byFeature_.end(), 0u);
    std::stable_sort(byFeature_.begin(), byFeature_.end(),
                     [&](std::uint32_t i, std::uint32_t j) { return kept_[i].feature < kept_[j].feature; });
}

/// The kept contacts span all contacts, so none of these has moved farther.
bool ContactReduction::holds(const btTransform& a, const btTransform& b) const {
    const auto hasHardlyMoved = [&](const Kept& kept) {
        return (a * kept.ofA - b * kept.ofB).length2() <= reduced_.slack * reduced_.slack;
    };
    return reduced_.slack > 0 && std::all_of(kept_.begin(), kept_.end(), hasHardlyMoved);
}

/// Whether all chosen contacts exist again, no contact approaches from afar, and a press meets no other contact earlier
/// than these by more than its tolerance.
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
    if (deepest < deepestFound - pressSlack * reduced_.slack) return false;
    auto next = found.begin();
    for (Patch& patch : reduced_.patches)
        for (int i = 0; i < patch.count; ++i) patch.contacts[i] = **next++;
    return true;
}

}  // namespace bilayer::bullet::detail
