#include "integration/bullet/detail/contact_reduction.h"
#include <bilayer/collider/contact.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <numeric>

#include "integration/bullet/detail/convert.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Normals within about 25 degrees form one patch: flat enough for four points to carry it.
constexpr float sameDirection = 0.9f;
// Normals of a patch that continues from the last step stay within about 32 degrees. Its direction is that of the kept
// contacts, and jitters with them; the grouping of the contacts must not.
constexpr float stillSameDirection = 0.85f;
// More patches than any resting body needs. Contacts of further directions join the best matching patch.
constexpr std::size_t maxPatches = 8;
// A patch of the last step continues until its normal is within about 15 degrees of another's.
constexpr float mergedDirection = 0.966f;
// Bodies count as almost at rest if the deepest penetration has changed by less than this fraction of the contacts'
// extent in one step. Contacts of the last step are then preferred, and patches keep their places. In an impact all
// contacts are chosen again.
constexpr float stillness = 3e-3f;
// Tolerance of the choice [fractions of the extent]. A contact that touches earlier than the kept ones by less than
// this need not be kept, and contacts of the last step are kept again. Otherwise rounding would decide which of several
// comes first, and bodies would jitter with each change. The tolerance is smaller for a mere press, since the deepest
// penetration pushes bodies apart, and for shifts and twists, which change separations as little as the smallest tilts.
constexpr float tolerance = 1e-3f, toleranceUntilted = tolerance / 4;
// A contact of the last step stays while some motion meets it first to within this many tolerances. Contacts that bear
// a load must not come and go, or a stack never comes to rest.
constexpr float loyalty = 3;
// Contacts are chosen again when the bodies have moved relative to each other by this fraction of the tolerance.
constexpr float chosenWithin = 0.5f;
// The small motions that contacts are kept for: tilts from those of a fall to those of rest [rad], lateral shifts
// [fractions of the extent] and twists [rad]. Their directions are oblique to typical models, so that each vertex of a
// rectangle is met first by some motion.
constexpr float tilts[] = {1.f / 8, 1.f / 32, 1.f / 128};
// Upper limit of an additional tilt, for steps that move a body farther: the rotation of a body whose other side is
// stopped [rad].
constexpr float maxRotation = 1;
constexpr float aside = 1.f / 64;
constexpr int tiltDirections = 8, shiftDirections = 8;
constexpr float askew = 0.3f;  // [rad]
// The tilts and shifts at which the reduction error is measured [rad], [fractions of the extent].
constexpr float measured = 1.f / 32;
// Limit of contacts in a patch: more would cost the solver more than they help.
constexpr std::size_t maxOfPatch = 3 * MANIFOLD_CACHE_SIZE;

/// Contacts of one patch, as indices in ascending order of the remaining distance.
using Group = std::vector<std::uint32_t>;

/// The contacts of the last step, by feature.
class Memory {
  public:
    explicit Memory(std::span<const Patch> last) {
        for (const Patch& patch : last) {
            groups_ += !patch.goesOn;
            for (int i = 0; i < patch.count; ++i) features_.emplace_back(patch.contacts[i].feature, groups_ - 1);
        }
        std::sort(features_.begin(), features_.end());
    }

    /// The number of groups.
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

/// The current directions of the groups of the last step, from those of their contacts that still exist. Without a last
/// step, the mean direction of all contacts if they differ little from it, else nothing.
std::vector<glm::vec3> directionsOf(const std::vector<Contact>& contacts, const Memory& memory) {
    std::vector<glm::vec3> sums(std::size_t(std::max(memory.groups(), 1)), glm::vec3(0)), directions;
    for (const Contact& contact : contacts)
        if (const int group = memory.groups() > 0 ? memory.groupOf(contact) : 0; group >= 0)
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
    if (memory.groups() == 0 && !directions.empty() && !std::all_of(contacts.begin(), contacts.end(), fits)) return {};
    return directions;
}

std::vector<Group> groupByNormal(const std::vector<Contact>& contacts, const Memory& memory) {
    std::vector<glm::vec3> directions = directionsOf(contacts, memory);
    const std::size_t goingOn = memory.groups() > 0 ? directions.size() : 0;
    const auto nearest = [&](const glm::vec3& normal) {
        std::pair<float, std::size_t> best{-2.f, 0};
        for (std::size_t g = 0; g < directions.size(); ++g)
            if (const float cosine = glm::dot(normal, directions[g]); cosine > best.first) best = {cosine, g};
        return best;
    };
    std::vector<Group> groups(directions.size());
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
        const auto [cosine, best] = nearest(contacts[i].normal);
        const float same = best < goingOn ? stillSameDirection : sameDirection;
        if (cosine < same && groups.size() < maxPatches) {
            directions.push_back(contacts[i].normal);
            groups.push_back({i});
        } else {
            groups[best].push_back(i);
        }
    }
    std::erase_if(groups, [](const Group& group) { return group.empty(); });
    return groups;
}

/// The extent of a group: the size of the bounding box of its positions.
float extentOf(const std::vector<Contact>& contacts, const Group& group) {
    glm::vec3 lower = contacts[group.front()].position, upper = lower;
    for (std::uint32_t i : group) {
        lower = glm::min(lower, contacts[i].position);
        upper = glm::max(upper, contacts[i].position);
    }
    return glm::distance(lower, upper);
}

bool isStill(const std::vector<Contact>& contacts, std::span<const Patch> last) {
    if (contacts.empty() || last.empty()) return false;
    float before = std::numeric_limits<float>::max();
    for (const Patch& patch : last)
        for (int i = 0; i < patch.count; ++i) before = std::min(before, patch.contacts[i].remaining());
    Group all(contacts.size());
    std::iota(all.begin(), all.end(), 0u);
    return std::abs(contacts.front().remaining() - before) <= stillness * extentOf(contacts, all);
}

/// A small motion of A in the axes of a patch: a tilt about an axis in the patch, or a shift along the patch with a
/// twist.
struct Perturbation {
    glm::vec2 tilt{0}, shift{0};
    float twist = 0;
};

glm::vec2 towards(float share) {
    const float angle = askew + 2 * SIMD_PI * share;
    return {std::cos(angle), std::sin(angle)};
}

void addTilts(float tilt, std::vector<Perturbation>& all) {
    for (int k = 0; k < tiltDirections; ++k) all.push_back({.tilt = tilt * towards(float(k) / tiltDirections)});
}

/// The motions that contacts are kept for, in the order of the choice: those that span the patch first, a mere press
/// last.
std::vector<Perturbation> nudges() {
    std::vector<Perturbation> all;
    for (const float tilt : tilts) addTilts(tilt, all);
    for (int k = 0; k < shiftDirections; ++k) all.push_back({.shift = aside * towards(float(k) / shiftDirections)});
    for (const float twist : {aside, -aside}) all.push_back({.twist = twist});
    all.push_back({});
    return all;
}

/// The motions in between, at which the reduction error is measured.
std::vector<Perturbation> nudgesBetween() {
    std::vector<Perturbation> all;
    for (int k = 0; k < tiltDirections; ++k)
        all.push_back({.tilt = measured * towards((float(k) + 0.5f) / tiltDirections)});
    for (int k = 0; k < shiftDirections; ++k)
        all.push_back({.shift = measured * towards((float(k) + 0.5f) / shiftDirections)});
    return all;
}

/// The change of the separations of a patch's contacts when A moves. To first order it is separation + normal . (shift
/// + rotation x arm), a row of the contact's wrench. Each kind of number has its own column, padded so that processors
/// handle several contacts at once.
class Gaps {
  public:
    Gaps(const std::vector<Contact>& contacts, const Group& group)
        : count_(group.size()), padded_((count_ + lanes - 1) / lanes * lanes), numbers_(columns * padded_, 0.f) {
        glm::vec3 normal(0), centre(0);
        for (const std::uint32_t i : group) normal += contacts[i].normal, centre += contacts[i].position;
        normal = glm::normalize(normal);
        centre /= float(count_);
        extent_ = extentOf(contacts, group);
        btVector3 along, across;
        btPlaneSpace1(toBullet(normal), along, across);
        const glm::vec3 x = toGlm(along), y = toGlm(across);
        std::fill(column(gap) + count_, column(gap) + padded_, std::numeric_limits<float>::max());
        // An approaching contact is stopped where it touches. It gets no deeper than the contacts that touch already,
        // which must bear their part of a body that comes down at an angle.
        float first = 0, approach = 0;
        for (const std::uint32_t i : group)
            if (contacts[i].distance > 0) {
                first = std::min(first, contacts[i].remaining());
                approach = std::max(approach, contacts[i].approach);
            }
        turn_ = extent_ > 0 ? std::min(approach / extent_, maxRotation) : 0;
        for (std::size_t k = 0; k < count_; ++k) {
            const Contact& contact = contacts[group[k]];
            const glm::vec3 turn = glm::cross(contact.position - centre, contact.normal);
            column(gap)[k] = contact.distance > 0 ? contact.remaining() - first : contact.distance;
            column(tiltX)[k] = glm::dot(turn, x);
            column(tiltY)[k] = glm::dot(turn, y);
            column(shiftX)[k] = extent_ * glm::dot(contact.normal, x);
            column(shiftY)[k] = extent_ * glm::dot(contact.normal, y);
            column(twist)[k] = glm::dot(turn, normal);
        }
    }

    /// Moves A. Returns the minimum separation after the motion.
    float least(const Perturbation& nudge) {
        const bool tilts = nudge.tilt != glm::vec2(0);
        const float *gaps = column(gap), *x = column(tilts ? tiltX : shiftX), *y = column(tilts ? tiltY : shiftY),
                    *turns = column(twist);
        const glm::vec2 way = tilts ? nudge.tilt : nudge.shift;
        float *now = column(moved), found[lanes];
        std::fill(found, found + lanes, std::numeric_limits<float>::max());
        for (std::size_t k = 0; k < padded_; k += lanes) {
            float values[lanes];  // separate from the input, so that they are computed at once
            for (std::size_t j = 0; j < lanes; ++j)
                values[j] = gaps[k + j] + way.x * x[k + j] + way.y * y[k + j] + nudge.twist * turns[k + j];
            for (std::size_t j = 0; j < lanes; ++j) now[k + j] = values[j];
            for (std::size_t j = 0; j < lanes; ++j) found[j] = values[j] < found[j] ? values[j] : found[j];
        }
        return *std::min_element(found, found + lanes);
    }

    /// The separation of one contact after a motion of A.
    float of(std::uint32_t k, const Perturbation& nudge) const {
        const bool tilts = nudge.tilt != glm::vec2(0);
        const glm::vec2 way = tilts ? nudge.tilt : nudge.shift;
        const float x = at(tilts ? tiltX : shiftX, k), y = at(tilts ? tiltY : shiftY, k);
        return at(gap, k) + way.x * x + way.y * y + nudge.twist * at(twist, k);
    }

    /// The minimum separation of some contacts after a motion of A.
    float minOf(const std::vector<std::uint32_t>& some, const Perturbation& nudge) const {
        float least = std::numeric_limits<float>::max();
        for (const std::uint32_t k : some) least = std::min(least, of(k, nudge));
        return least;
    }

    /// The first contact with this separation after the last motion.
    std::uint32_t with(float gap) const {
        const float* now = numbers_.data() + moved * padded_;
        return std::uint32_t(std::find(now, now + count_, gap) - now);
    }

    float extent() const { return extent_; }
    /// The rotation in the step of a body whose one side is stopped while the other one moves on [rad].
    float turn() const { return turn_; }

  private:
    static constexpr std::size_t lanes = 8;
    enum Column { gap, tiltX, tiltY, shiftX, shiftY, twist, moved, columns };
    float* column(Column which) { return numbers_.data() + which * padded_; }
    float at(Column which, std::uint32_t k) const { return numbers_[which * padded_ + k]; }

    std::size_t count_, padded_;
    std::vector<float> numbers_;  ///< stored by columns
    float extent_ = 0, turn_ = 0;
};

/// The contacts of a group that some small motion of the bodies meets first. A contact of the last step stays while
/// some motion meets it first within the tolerance: contacts that bear a load must not come and go.
class FirstMet {
  public:
    FirstMet(const std::vector<Contact>& contacts, const Group& group) : gaps_(contacts, group) {
        static const std::vector<Perturbation> all = nudges();
        nudges_ = all;
        if (gaps_.turn() > tilts[0]) {
            addTilts(gaps_.turn(), turned_);
            turned_.insert(turned_.end(), all.begin(), all.end());
            nudges_ = turned_;
        }
        for (const Perturbation& nudge : nudges_) least_.push_back(gaps_.least(nudge));
    }

    /// @param before  the contacts of the last step
    std::vector<std::uint32_t> choose(const std::vector<std::uint32_t>& before) {
        for (const std::uint32_t k : before)
            if (metBy(k, loyalty) != 0) add(k);
        for (std::size_t n = 0; n < nudges_.size(); ++n) {
            if (metByAny() >> n & 1 || (kept_.size() >= maxOfPatch && isNearlyMet(n))) continue;
            gaps_.least(nudges_[n]);
            add(gaps_.with(least_[n]));
        }
        for (std::size_t i = kept_.size(); i-- > 0;)
            if (isSpare(i) && !mayBear(kept_[i])) leaveOut(i);
        while (kept_.size() > maxOfPatch) leaveOut(minNeeded());
        return kept_;
    }

    /// The maximum depth that motions in between reach before the chosen contacts touch [m].
    float reductionError() {
        static const std::vector<Perturbation> between = nudgesBetween();
        float most = 0;
        for (const Perturbation& nudge : between) {
            const float least = gaps_.least(nudge);
            most = std::max(most, gaps_.minOf(kept_, nudge) - least);
        }
        return most;
    }

  private:
    using Motions = std::uint64_t;  ///< one bit each

    float toleranceOf(const Perturbation& nudge) const {
        return (nudge.tilt == glm::vec2(0) ? toleranceUntilted : tolerance) * gaps_.extent();
    }

    /// The motions that meet a contact first, to within so many tolerances.
    Motions metBy(std::uint32_t k, float tolerances) const {
        Motions met = 0;
        for (std::size_t n = 0; n < nudges_.size(); ++n) {
            if (gaps_.of(k, nudges_[n]) <= least_[n] + tolerances * toleranceOf(nudges_[n])) met |= Motions(1) << n;
        }
        return met;
    }

    void add(std::uint32_t k) {
        kept_.push_back(k);
        met_.push_back(metBy(k, 1));
    }

    Motions metByAny(std::size_t but = std::size_t(-1)) const {
        Motions met = 0;
        for (std::size_t i = 0; i < met_.size(); ++i)
            if (i != but) met |= met_[i];
        return met;
    }

    /// Whether a kept contact touches not much later than the first one in a motion.
    bool isNearlyMet(std::size_t n) const {
        return gaps_.minOf(kept_, nudges_[n]) <= least_[n] + loyalty * toleranceOf(nudges_[n]);
    }

    /// Whether every motion that meets this contact first is covered by another kept contact.
    bool isSpare(std::size_t i) const { return !(met_[i] & ~metByAny(i)); }

    /// Whether a press could have loaded the contact.
    bool mayBear(std::uint32_t k) const {
        return gaps_.of(k, {}) <= least_.back() + loyalty * tolerance * gaps_.extent();
    }

    /// The redundant contact that is farthest away, or else the last contact.
    std::size_t minNeeded() const {
        std::size_t which = kept_.size();
        for (std::size_t i = 0; i < kept_.size(); ++i)
            if (isSpare(i) && (which == kept_.size() || gaps_.of(kept_[i], {}) > gaps_.of(kept_[which], {}))) which = i;
        return std::min(which, kept_.size() - 1);
    }

    void leaveOut(std::size_t i) {
        kept_.erase(kept_.begin() + std::ptrdiff_t(i));
        met_.erase(met_.begin() + std::ptrdiff_t(i));
    }

    Gaps gaps_;
    std::vector<Perturbation> turned_;  ///< including those of a body that rotates in the step
    std::span<const Perturbation> nudges_;
    std::vector<float> least_;         ///< minimum separation after each motion
    std::vector<std::uint32_t> kept_;  ///< indices into the group
    std::vector<Motions> met_;         ///< motions of each kept contact
};

std::vector<std::uint32_t> firstMet(const std::vector<Contact>& contacts, const Group& group, const Memory& memory,
                                    float& reductionError) {
    std::vector<std::uint32_t> before;
    for (std::uint32_t k = 0; k < group.size(); ++k)
        if (memory.kept(contacts[group[k]])) before.push_back(k);
    FirstMet met(contacts, group);
    std::vector<std::uint32_t> kept = met.choose(before);
    reductionError = std::max(reductionError, met.reductionError());
    return kept;
}

}  // namespace

Reduced reduce(std::vector<Contact>& contacts, std::span<const Patch> last) {
    std::stable_sort(contacts.begin(), contacts.end(),
                     [](const Contact& a, const Contact& b) { return a.remaining() < b.remaining(); });
    if (!isStill(contacts, last)) last = {};
    Reduced result;
    const Memory memory(last);
    float least = std::numeric_limits<float>::max();
    for (const Group& group : groupByNormal(contacts, memory)) {
        std::vector<std::uint32_t> kept(group.size());
        std::iota(kept.begin(), kept.end(), 0u);
        if (group.size() > MANIFOLD_CACHE_SIZE) {
            kept = firstMet(contacts, group, memory, result.reductionError);
            least = std::min(least, extentOf(contacts, group));
            result.slack = chosenWithin * tolerance * least;
        }
        for (std::size_t k = 0; k < kept.size(); ++k) {
            if (k % MANIFOLD_CACHE_SIZE == 0) result.patches.emplace_back();
            Patch& patch = result.patches.back();
            patch.goesOn = k >= MANIFOLD_CACHE_SIZE;
            patch.contacts[std::size_t(patch.count++)] = contacts[group[kept[k]]];
        }
    }
    return result;
}

void Choice::update(std::vector<Contact>& contacts, const btTransform& a, const btTransform& b) {
    if (holds(a, b) && takeAgain(contacts)) return;
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
bool Choice::holds(const btTransform& a, const btTransform& b) const {
    const auto hasHardlyMoved = [&](const Kept& kept) {
        return (a * kept.ofA - b * kept.ofB).length2() <= reduced_.slack * reduced_.slack;
    };
    return reduced_.slack > 0 && std::all_of(kept_.begin(), kept_.end(), hasHardlyMoved);
}

/// Whether all chosen contacts exist again, no contact approaches from afar, and a press meets no other contact earlier
/// than these by more than its tolerance.
bool Choice::takeAgain(const std::vector<Contact>& contacts) {
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
    if (deepest < deepestFound - 0.5f * reduced_.slack) return false;
    auto next = found.begin();
    for (Patch& patch : reduced_.patches)
        for (int i = 0; i < patch.count; ++i) patch.contacts[i] = **next++;
    return true;
}

}  // namespace bilayer::bullet::detail
