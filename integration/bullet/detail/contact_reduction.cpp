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

// Normals within about 25 degrees go into one patch: flat enough for four points to carry it.
constexpr float sameDirection = 0.9f;
// Those of a patch that goes on from the last step stay within about 32 degrees: its direction is that of the contacts
// that were kept, and trembles with them, but which contacts belong together must not.
constexpr float stillSameDirection = 0.85f;
// More patches than any resting body needs; contacts of further directions join the patch that suits them best.
constexpr std::size_t maxPatches = 8;
// A patch of the last step goes on until its normal is within about 15 degrees of another's.
constexpr float mergedDirection = 0.966f;
// Contacts that were kept in the last step are preferred, and patches keep their places, for bodies about at rest: when
// the deepest overlap has changed by less than this part of the contacts' extent in one step. In an impact every
// contact is judged anew.
constexpr float stillness = 3e-3f;
// What is met sooner than the contacts that are kept by less than this need not be kept itself, and what was kept in
// the last step is kept again [parts of the extent]: which of several is met first is then a matter of rounding, and
// bodies would tremble with each change. Of a mere press it is less: the deepest overlap is what pushes bodies apart;
// and of shifts and twists, which change gaps by as little as the least tilts.
constexpr float tolerance = 1e-3f, toleranceUntilted = tolerance / 4;
// What was kept in the last step stays as long as some motion meets it first but for so many tolerances: contacts that
// bear a load must not come and go, or a stack never comes to rest.
constexpr float loyalty = 3;
// Contacts are chosen anew when the bodies have moved past each other by this part of the tolerance.
constexpr float chosenWithin = 0.5f;
// The small motions that contacts are kept for: tilts from those of a fall to those of rest [rad], shifts aside [parts
// of the extent] and twists [rad]. Their directions are askew to everything one models: a rectangle's corners are then
// each met first by themselves.
constexpr float tilts[] = {1.f / 8, 1.f / 32, 1.f / 128};
// and, where a step takes a body farther than that, the turn of one whose other side is stopped, at most [rad].
constexpr float maxRotation = 1;
constexpr float aside = 1.f / 64;
constexpr int tiltDirections = 8, shiftDirections = 8;
constexpr float askew = 0.3f;  // [rad]
// The tilts and shifts by which what is lost is measured [rad], [parts of the extent].
constexpr float measured = 1.f / 32;
// More contacts of a patch cost the solver more than they tell it.
constexpr std::size_t maxOfPatch = 3 * MANIFOLD_CACHE_SIZE;

/// Contacts of one patch, as indices in ascending order of the distance that remains.
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

    /// How many groups there were.
    int groups() const { return groups_; }

    /// The group that a contact was kept of; -1 if it was not.
    int groupOf(const Contact& contact) const {
        const auto at = std::lower_bound(features_.begin(), features_.end(), std::pair(contact.feature, 0));
        return at != features_.end() && at->first == contact.feature ? at->second : -1;
    }
    bool kept(const Contact& contact) const { return groupOf(contact) >= 0; }

  private:
    std::vector<std::pair<std::uint32_t, int>> features_;
    int groups_ = 0;
};

/// Where the groups of the last step look now: by those of their contacts that are still there. If there was none, the
/// mean direction of all contacts if they differ little from it, or nothing.
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

/// The extent of a group, by the box of its places.
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

/// A small motion of A in the axes of a patch: turned about one along it, or shifted along it and twisted.
struct Nudge {
    glm::vec2 tilt{0}, shift{0};
    float twist = 0;
};

glm::vec2 towards(float share) {
    const float angle = askew + 2 * SIMD_PI * share;
    return {std::cos(angle), std::sin(angle)};
}

void addTilts(float tilt, std::vector<Nudge>& all) {
    for (int k = 0; k < tiltDirections; ++k) all.push_back({.tilt = tilt * towards(float(k) / tiltDirections)});
}

/// Those that contacts are kept for, in the order in which they choose: what spans the patch comes first, a mere press
/// last.
std::vector<Nudge> nudges() {
    std::vector<Nudge> all;
    for (const float tilt : tilts) addTilts(tilt, all);
    for (int k = 0; k < shiftDirections; ++k) all.push_back({.shift = aside * towards(float(k) / shiftDirections)});
    for (const float twist : {aside, -aside}) all.push_back({.twist = twist});
    all.push_back({});
    return all;
}

/// Those in between, by which what is lost is measured.
std::vector<Nudge> nudgesBetween() {
    std::vector<Nudge> all;
    for (int k = 0; k < tiltDirections; ++k)
        all.push_back({.tilt = measured * towards((float(k) + 0.5f) / tiltDirections)});
    for (int k = 0; k < shiftDirections; ++k)
        all.push_back({.shift = measured * towards((float(k) + 0.5f) / shiftDirections)});
    return all;
}

/// How the gaps of a patch's contacts change when A moves: to first order gap + normal . (shift + turn x arm), a row of
/// the contact's wrench. Of each kind of number a column, padded so that processors take several contacts at once.
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
        // What is on its way is stopped where it touches: it gets no deeper than what touches already, which must bear
        // its part of a body that comes down aslant.
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

    /// Moves A. The least gap that there is then.
    float least(const Nudge& nudge) {
        const bool tilts = nudge.tilt != glm::vec2(0);
        const float *gaps = column(gap), *x = column(tilts ? tiltX : shiftX), *y = column(tilts ? tiltY : shiftY),
                    *turns = column(twist);
        const glm::vec2 way = tilts ? nudge.tilt : nudge.shift;
        float *now = column(moved), found[lanes];
        std::fill(found, found + lanes, std::numeric_limits<float>::max());
        for (std::size_t k = 0; k < padded_; k += lanes) {
            float values[lanes];  // apart from what is read, so that they are computed at once
            for (std::size_t j = 0; j < lanes; ++j)
                values[j] = gaps[k + j] + way.x * x[k + j] + way.y * y[k + j] + nudge.twist * turns[k + j];
            for (std::size_t j = 0; j < lanes; ++j) now[k + j] = values[j];
            for (std::size_t j = 0; j < lanes; ++j) found[j] = values[j] < found[j] ? values[j] : found[j];
        }
        return *std::min_element(found, found + lanes);
    }

    /// The gap of one contact when A is moved.
    float of(std::uint32_t k, const Nudge& nudge) const {
        const bool tilts = nudge.tilt != glm::vec2(0);
        const glm::vec2 way = tilts ? nudge.tilt : nudge.shift;
        const float x = at(tilts ? tiltX : shiftX, k), y = at(tilts ? tiltY : shiftY, k);
        return at(gap, k) + way.x * x + way.y * y + nudge.twist * at(twist, k);
    }

    /// Of some contacts, the least gap when A is moved.
    float minOf(const std::vector<std::uint32_t>& some, const Nudge& nudge) const {
        float least = std::numeric_limits<float>::max();
        for (const std::uint32_t k : some) least = std::min(least, of(k, nudge));
        return least;
    }

    /// The first contact whose gap that is after the last motion.
    std::uint32_t with(float gap) const {
        const float* now = numbers_.data() + moved * padded_;
        return std::uint32_t(std::find(now, now + count_, gap) - now);
    }

    float extent() const { return extent_; }
    /// By what a body is turned in the step whose one side is stopped while the other one goes on [rad].
    float turn() const { return turn_; }

  private:
    static constexpr std::size_t lanes = 8;
    enum Column { gap, tiltX, tiltY, shiftX, shiftY, twist, moved, columns };
    float* column(Column which) { return numbers_.data() + which * padded_; }
    float at(Column which, std::uint32_t k) const { return numbers_[which * padded_ + k]; }

    std::size_t count_, padded_;
    std::vector<float> numbers_;  ///< column by column
    float extent_ = 0, turn_ = 0;
};

/// The contacts of a group that some small motion of the bodies meets first. Those of the last step stay as long as
/// some motion meets them about first: contacts that bear a load must not come and go.
class FirstMet {
  public:
    FirstMet(const std::vector<Contact>& contacts, const Group& group) : gaps_(contacts, group) {
        static const std::vector<Nudge> all = nudges();
        nudges_ = all;
        if (gaps_.turn() > tilts[0]) {
            addTilts(gaps_.turn(), turned_);
            turned_.insert(turned_.end(), all.begin(), all.end());
            nudges_ = turned_;
        }
        for (const Nudge& nudge : nudges_) least_.push_back(gaps_.least(nudge));
    }

    /// @param before  those of the last step
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

    /// What other motions meet before those [m].
    float reductionError() {
        static const std::vector<Nudge> between = nudgesBetween();
        float most = 0;
        for (const Nudge& nudge : between) {
            const float least = gaps_.least(nudge);
            most = std::max(most, gaps_.minOf(kept_, nudge) - least);
        }
        return most;
    }

  private:
    using Motions = std::uint64_t;  ///< a bit for each

    float toleranceOf(const Nudge& nudge) const {
        return (nudge.tilt == glm::vec2(0) ? toleranceUntilted : tolerance) * gaps_.extent();
    }

    /// The motions that meet a contact first, but for so many tolerances.
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

    /// Whether a motion meets one that is kept not much later than the first.
    bool isNearlyMet(std::size_t n) const {
        return gaps_.minOf(kept_, nudges_[n]) <= least_[n] + loyalty * toleranceOf(nudges_[n]);
    }

    /// Whether every motion that meets it first meets others first, too.
    bool isSpare(std::size_t i) const { return !(met_[i] & ~metByAny(i)); }

    /// Whether a press could have loaded it.
    bool mayBear(std::uint32_t k) const {
        return gaps_.of(k, {}) <= least_.back() + loyalty * tolerance * gaps_.extent();
    }

    /// Of what is spare that which is farthest away, else the last.
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
    std::vector<Nudge> turned_;  ///< with those of a body that is turned in the step
    std::span<const Nudge> nudges_;
    std::vector<float> least_;         ///< gap after each motion
    std::vector<std::uint32_t> kept_;  ///< as indices in the group
    std::vector<Motions> met_;         ///< by each of these
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

/// What was kept spans all contacts: these have moved no farther.
bool Choice::holds(const btTransform& a, const btTransform& b) const {
    const auto hasHardlyMoved = [&](const Kept& kept) {
        return (a * kept.ofA - b * kept.ofB).length2() <= reduced_.slack * reduced_.slack;
    };
    return reduced_.slack > 0 && std::all_of(kept_.begin(), kept_.end(), hasHardlyMoved);
}

/// Whether all that were chosen are there again, none of any is on its way from afar, and a press meets none by more
/// than its tolerance before those.
bool Choice::takeAgain(const std::vector<Contact>& contacts) {
    std::vector<const Contact*> found(kept_.size(), nullptr);
    float deepest = std::numeric_limits<float>::max(), deepestFound = deepest;
    for (const Contact& contact : contacts) {
        if (contact.approach > 0) return false;
        deepest = std::min(deepest, contact.distance);
        auto at = std::lower_bound(byFeature_.begin(), byFeature_.end(), contact.feature,
                                   [&](std::uint32_t i, std::uint32_t feature) { return kept_[i].feature < feature; });
        // of several contacts of one feature each has its turn
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
