// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/reduction/first_contacts.h"
#include "sdf/base/perpendicular.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <span>
#include <utility>

namespace bilayer::detail {

namespace {

// The tolerance is smaller for shifts and twists, which change separations as little as the smallest tilts.
constexpr float toleranceUntilted = reductionTolerance / 4;
// A contact of the last step stays while some motion meets it first to within this many tolerances. Contacts that bear
// a load must not come and go, or a stack never rests.
constexpr float hysteresis = 3;
// The small motions that contacts are kept for: tilts from those of a fall to those of rest [rad], lateral shifts
// [fractions of the extent] and twists [rad]. Their directions are oblique to typical models, so that each vertex of a
// rectangle is met first by some motion.
constexpr float tilts[] = {1.f / 8, 1.f / 32, 1.f / 128};
// Upper limit of an additional tilt, for steps that move a body farther: the rotation of a body whose other side is
// stopped [rad].
constexpr float maxStepRotation = 1;
// The approach of contacts that touch counts while the bodies rotate by no more than this in the step: the approach is
// that of straight paths [rad].
constexpr float maxStraightRotation = 0.1f;
constexpr float shiftSize = 1.f / 64;
constexpr int tiltDirections = 8, shiftDirections = 8;
constexpr float directionOffset = 0.3f;  // [rad]
// The tilts and shifts at which the reduction error is measured [rad], [fractions of the extent].
constexpr float errorProbeSize = 1.f / 32;
// A body's radius of gyration, where it is stopped by the contacts of a patch [fractions of the extent], and the
// iterations that find out where it stops.
constexpr float gyration = 0.3f;
constexpr int stopSweeps = 60;
// Limit of contacts in a patch: more would cost the solver more than they help.
constexpr std::size_t maxContacts = 3 * patchSize;

/// A small motion of A in the axes of a patch: a tilt about an axis in the patch, or a shift along the patch with a
/// twist.
struct Perturbation {
    glm::vec2 tilt{0}, shift{0};
    float twist = 0;
};

/// How contacts change the motion of A in a step: along the normal [m], and tilts about the axes of a patch [rad].
struct Stop {
    float rise = 0;
    glm::vec2 tilt{0};
};

glm::vec2 directionAt(float share) {
    const float angle = directionOffset + 2 * glm::pi<float>() * share;
    return {std::cos(angle), std::sin(angle)};
}

void addTilts(float tilt, std::vector<Perturbation>& all) {
    for (int k = 0; k < tiltDirections; ++k) all.push_back({.tilt = tilt * directionAt(float(k) / tiltDirections)});
}

/// The motions that contacts are kept for, in the order of the choice: those that span the patch first, the motion
/// along the normal alone last.
std::vector<Perturbation> perturbations() {
    std::vector<Perturbation> all;
    for (const float tilt : tilts) addTilts(tilt, all);
    for (int k = 0; k < shiftDirections; ++k)
        all.push_back({.shift = shiftSize * directionAt(float(k) / shiftDirections)});
    for (const float twist : {shiftSize, -shiftSize}) all.push_back({.twist = twist});
    all.push_back({});
    return all;
}

/// The motions in between, at which the reduction error is measured.
std::vector<Perturbation> errorPerturbations() {
    std::vector<Perturbation> all;
    for (int k = 0; k < tiltDirections; ++k)
        all.push_back({.tilt = errorProbeSize * directionAt((float(k) + 0.5f) / tiltDirections)});
    for (int k = 0; k < shiftDirections; ++k)
        all.push_back({.shift = errorProbeSize * directionAt((float(k) + 0.5f) / shiftDirections)});
    return all;
}

/// The separations of a patch's contacts after a small motion of A: separation + normal . (shift + rotation x arm), to
/// first order. Each kind of number has its own column, padded so that processors handle several contacts at once.
class Separations {
  public:
    Separations(const std::vector<Contact>& contacts, const ContactGroup& group, float rotation)
        : count_(group.size()), padded_((count_ + lanes - 1) / lanes * lanes), numbers_(columns * padded_, 0.f) {
        glm::vec3 normal(0), centre(0);
        for (const std::uint32_t i : group) normal += contacts[i].normal, centre += contacts[i].position;
        normal = glm::normalize(normal);
        centre /= float(count_);
        extent_ = extentOf(contacts, group);
        const glm::vec3 x = perpendicularTo(normal), y = glm::cross(normal, x);
        std::fill(column(gap) + count_, column(gap) + padded_, std::numeric_limits<float>::max());
        // An approaching contact is stopped where it touches. It gets no deeper than the contacts that touch already,
        // which must bear their part of a body that comes down at an angle. Those count with what they approach more
        // than the others: a body that slides needs the contacts of the face that it moves on to.
        float first = 0, approach = 0, common = std::numeric_limits<float>::max();
        for (const std::uint32_t i : group)
            if (contacts[i].distance > 0) {
                first = std::min(first, contacts[i].remaining());
                approach = std::max(approach, contacts[i].approach);
            } else {
                common = std::min(common, contacts[i].approach);
            }
        const auto gapOf = [&](const Contact& contact) {
            if (contact.distance > 0) return contact.remaining() - first;
            return rotation < maxStraightRotation ? contact.remaining() + common : contact.distance;
        };
        rotation_ = extent_ > 0 ? std::min(approach / extent_, maxStepRotation) : 0;
        for (std::size_t k = 0; k < count_; ++k) {
            const Contact& contact = contacts[group[k]];
            const glm::vec3 torque = glm::cross(contact.position - centre, contact.normal);
            column(gap)[k] = gapOf(contact);
            column(left)[k] = std::max(contact.distance, 0.f) - contact.approach;
            column(tiltX)[k] = glm::dot(torque, x);
            column(tiltY)[k] = glm::dot(torque, y);
            column(shiftX)[k] = extent_ * glm::dot(contact.normal, x);
            column(shiftY)[k] = extent_ * glm::dot(contact.normal, y);
            column(twist)[k] = glm::dot(torque, normal);
        }
    }

    /// Moves A. Returns the minimum separation after the motion.
    float minSeparation(const Perturbation& perturbation) {
        const bool tilts = perturbation.tilt != glm::vec2(0);
        const float *gaps = column(gap), *x = column(tilts ? tiltX : shiftX), *y = column(tilts ? tiltY : shiftY),
                    *twists = column(twist);
        const glm::vec2 motion = tilts ? perturbation.tilt : perturbation.shift;
        float *now = column(moved), found[lanes];
        std::fill(found, found + lanes, std::numeric_limits<float>::max());
        for (std::size_t k = 0; k < padded_; k += lanes) {
            float values[lanes];  // separate from the input, so that they are computed at once
            for (std::size_t j = 0; j < lanes; ++j)
                values[j] =
                    gaps[k + j] + motion.x * x[k + j] + motion.y * y[k + j] + perturbation.twist * twists[k + j];
            for (std::size_t j = 0; j < lanes; ++j) now[k + j] = values[j];
            for (std::size_t j = 0; j < lanes; ++j) found[j] = values[j] < found[j] ? values[j] : found[j];
        }
        return *std::min_element(found, found + lanes);
    }

    /// The separation of one contact after a motion of A.
    float of(std::uint32_t k, const Perturbation& perturbation) const {
        const bool tilts = perturbation.tilt != glm::vec2(0);
        const glm::vec2 motion = tilts ? perturbation.tilt : perturbation.shift;
        const float x = at(tilts ? tiltX : shiftX, k), y = at(tilts ? tiltY : shiftY, k);
        return at(gap, k) + motion.x * x + motion.y * y + perturbation.twist * at(twist, k);
    }

    /// The minimum separation of some contacts after a motion of A.
    float minOf(const std::vector<std::uint32_t>& some, const Perturbation& perturbation) const {
        float result = std::numeric_limits<float>::max();
        for (const std::uint32_t k : some) result = std::min(result, of(k, perturbation));
        return result;
    }

    /// The contact of minimum separation after the last motion, the first of several.
    std::uint32_t nearest() const {
        const float* now = numbers_.data() + moved * padded_;
        return std::uint32_t(std::min_element(now, now + count_) - now);
    }

    /// How some contacts change the predicted motion of A if it gets no deeper there. A is a body of unit mass, with a
    /// radius of gyration of `gyration`.
    Stop stopBy(const std::vector<std::uint32_t>& some) const {
        const float arm = gyration * extent_, perInertia = 1 / (arm * arm);
        std::vector<float> impulses(some.size(), 0);
        Stop stop;
        for (int sweep = 0; sweep < stopSweeps; ++sweep)
            for (std::size_t i = 0; i < some.size(); ++i) {
                const glm::vec2 torque = torqueOf(some[i]);
                const float mobility = 1 + perInertia * glm::dot(torque, torque);
                const float before =
                    std::exchange(impulses[i], std::max(impulses[i] - leftAfter(some[i], stop) / mobility, 0.f));
                stop.rise += impulses[i] - before;
                stop.tilt += perInertia * (impulses[i] - before) * torque;
            }
        return stop;
    }

    /// The contact that is deepest after the predicted motion and its stop, and how much deeper than before, or than
    /// touching, it is then [m].
    std::pair<std::uint32_t, float> deepestAfter(const Stop& stop) const {
        std::pair<std::uint32_t, float> deepest(0, -std::numeric_limits<float>::max());
        for (std::uint32_t k = 0; k < count_; ++k)
            if (const float depth = -leftAfter(k, stop); depth > deepest.second) deepest = {k, depth};
        return deepest;
    }

    float extent() const { return extent_; }
    /// The rotation in the step of a body whose one side is stopped while the other one moves on [rad].
    float rotation() const { return rotation_; }

  private:
    static constexpr std::size_t lanes = 8;
    enum Column { gap, left, tiltX, tiltY, shiftX, shiftY, twist, moved, columns };
    float* column(Column which) { return numbers_.data() + which * padded_; }
    float at(Column which, std::uint32_t k) const { return numbers_[which * padded_ + k]; }
    glm::vec2 torqueOf(std::uint32_t k) const { return {at(tiltX, k), at(tiltY, k)}; }
    float leftAfter(std::uint32_t k, const Stop& stop) const {
        return at(left, k) + stop.rise + glm::dot(stop.tilt, torqueOf(k));
    }

    std::size_t count_, padded_;
    std::vector<float> numbers_;  ///< stored by columns
    float extent_ = 0, rotation_ = 0;
};

/// The search of firstContacts().
class FirstContactSearch {
  public:
    FirstContactSearch(const std::vector<Contact>& contacts, const ContactGroup& group, float rotation)
        : separations_(contacts, group, rotation) {
        static const std::vector<Perturbation> all = perturbations();
        perturbations_ = all;
        isStraight_ = std::max(rotation, separations_.rotation()) < maxStraightRotation;
        if (separations_.rotation() > tilts[0]) {
            addTilts(separations_.rotation(), withRotation_);
            withRotation_.insert(withRotation_.end(), all.begin(), all.end());
            perturbations_ = withRotation_;
        }
        for (const Perturbation& perturbation : perturbations_)
            minSeparations_.push_back(separations_.minSeparation(perturbation));
    }

    /// @param before  the contacts of the last step
    std::vector<std::uint32_t> choose(const std::vector<std::uint32_t>& before) {
        for (const std::uint32_t k : before)
            if (metBy(k, hysteresis) != 0) add(k);
        for (std::size_t n = 0; n < perturbations_.size(); ++n) {
            if (metByAny() >> n & 1 || (kept_.size() >= maxContacts && isNearlyMet(n))) continue;
            separations_.minSeparation(perturbations_[n]);
            add(separations_.nearest());
        }
        for (std::size_t i = kept_.size(); i-- > 0;)
            if (isRedundant(i) && !mayCarryLoad(kept_[i])) remove(i);
        while (kept_.size() > maxContacts) remove(whichToRemove());
        // where separations exceed floats, no motion meets any
        if (kept_.empty()) add(separations_.nearest());
        if (isStraight_ && separations_.rotation() > 0) addMissed();
        return kept_;
    }

    /// The maximum depth that motions in between reach before the chosen contacts touch [m].
    float reductionError() {
        static const std::vector<Perturbation> between = errorPerturbations();
        float error = 0;
        for (const Perturbation& perturbation : between) {
            const float first = separations_.minSeparation(perturbation);
            error = std::max(error, separations_.minOf(kept_, perturbation) - first);
        }
        return error;
    }

  private:
    using Motions = std::uint64_t;  ///< one bit each

    /// The last motion, which is a translation along the normal, while no body approaches another.
    bool isNormalMotionAtRest(std::size_t n) const {
        return n + 1 == perturbations_.size() && separations_.rotation() == 0;
    }

    float toleranceOf(std::size_t n) const {
        const bool tilts = perturbations_[n].tilt != glm::vec2(0);
        const float tolerance = tilts                     ? reductionTolerance
                                : isNormalMotionAtRest(n) ? normalMotionTolerance
                                                          : toleranceUntilted;
        return tolerance * separations_.extent();
    }

    /// The motions that meet a contact first, to within so many tolerances.
    Motions metBy(std::uint32_t k, float tolerances) const {
        Motions met = 0;
        for (std::size_t n = 0; n < perturbations_.size(); ++n) {
            if (separations_.of(k, perturbations_[n]) <= minSeparations_[n] + tolerances * toleranceOf(n))
                met |= Motions(1) << n;
        }
        return met;
    }

    // The choice prefers contacts that bear a body to those that its other side has still to reach. Adds those that get
    // too deep where the chosen ones stop the body.
    void addMissed() {
        for (std::size_t n = 0; n < patchSize; ++n) {
            const auto [deepest, depth] = separations_.deepestAfter(separations_.stopBy(kept_));
            const bool isKept = std::find(kept_.begin(), kept_.end(), deepest) != kept_.end();
            if (isKept || depth <= reductionTolerance * separations_.extent()) return;
            if (kept_.size() == maxContacts) remove(whichToRemove());
            add(deepest);
        }
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
        if (isNormalMotionAtRest(n)) return false;
        return separations_.minOf(kept_, perturbations_[n]) <= minSeparations_[n] + hysteresis * toleranceOf(n);
    }

    /// Whether every motion that meets this contact first is covered by another kept contact.
    bool isRedundant(std::size_t i) const { return !(met_[i] & ~metByAny(i)); }

    /// Whether a translation along the normal could have loaded the contact.
    bool mayCarryLoad(std::uint32_t k) const {
        return separations_.of(k, {}) <=
               minSeparations_.back() + hysteresis * reductionTolerance * separations_.extent();
    }

    /// The redundant contact that is farthest away, or else the last one; but none that bears a body at rest.
    std::size_t whichToRemove() const {
        std::size_t which = kept_.size();
        for (std::size_t i = 0; i < kept_.size(); ++i)
            if (isRedundant(i) &&
                (which == kept_.size() || separations_.of(kept_[i], {}) > separations_.of(kept_[which], {})))
                which = i;
        if (which < kept_.size()) return which;
        const std::size_t last = perturbations_.size() - 1;
        const Motions bearing = isNormalMotionAtRest(last) ? Motions(1) << last : 0;
        for (which = kept_.size() - 1; which > 0 && met_[which] & bearing; --which) {
        }
        return which;
    }

    void remove(std::size_t i) {
        kept_.erase(kept_.begin() + std::ptrdiff_t(i));
        met_.erase(met_.begin() + std::ptrdiff_t(i));
    }

    Separations separations_;
    bool isStraight_;                         ///< whether contacts approach and are stopped on straight paths
    std::vector<Perturbation> withRotation_;  ///< including those of a body that rotates in the step
    std::span<const Perturbation> perturbations_;
    std::vector<float> minSeparations_;  ///< minimum separation after each motion
    std::vector<std::uint32_t> kept_;    ///< indices into the group
    std::vector<Motions> met_;           ///< motions of each kept contact
};

}  // namespace

FirstContacts firstContacts(const std::vector<Contact>& contacts, const ContactGroup& group, const LastContacts& last,
                            float rotation) {
    std::vector<std::uint32_t> before;
    for (std::uint32_t k = 0; k < group.size(); ++k)
        if (last.kept(contacts[group[k]])) before.push_back(k);
    FirstContactSearch search(contacts, group, rotation);
    std::vector<std::uint32_t> kept = search.choose(before);
    return {std::move(kept), search.reductionError()};
}

}  // namespace bilayer::detail
