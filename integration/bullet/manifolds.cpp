#include "integration/bullet/manifolds.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <numeric>
#include <utility>

#include "integration/bullet/convert.h"

namespace bilayer::bullet {

namespace {

// Normals within about 25 degrees go into one patch: flat enough for four points to carry it.
constexpr float sameDirection = 0.9f;
// More patches than any resting body needs; contacts of further directions join the patch that suits them best.
constexpr std::size_t mostPatches = 8;
// A patch of the last step goes on until its normal is within about 15 degrees of another's.
constexpr float mergedDirection = 0.966f;
// Contacts that were kept in the last step are preferred, and patches keep their places, for bodies about at rest: when
// the deepest overlap has changed by less than this part of the contacts' extent in one step. In an impact every
// contact is judged anew.
constexpr float stillness = 3e-3f;
// What is met sooner than the contacts that are kept by less than this need not be kept itself, and what was kept in
// the last step is kept again [parts of the extent]: which of several is met first is then a matter of rounding, and
// bodies would tremble with each change. Of a mere press it is less: the deepest overlap is what pushes bodies apart.
constexpr float tolerance = 1e-3f, toleranceOfPress = tolerance / 4;
// The small motions that contacts are kept for: tilts from those of a fall to those of rest [rad], shifts aside [parts
// of the extent] and twists [rad]. Their directions are askew to everything one models: a rectangle's corners are then
// each met first by themselves.
constexpr float tilts[] = {1.f / 8, 1.f / 32, 1.f / 128};
constexpr float aside = 1.f / 64;
constexpr int tiltDirections = 8, shiftDirections = 4;
constexpr float askew = 0.3f;             // [rad]
constexpr float measuredTilt = 1.f / 32;  // by which what is lost is measured [rad]
// More contacts of a patch cost the solver more than they tell it.
constexpr std::size_t mostOfPatch = 3 * MANIFOLD_CACHE_SIZE;

// Friction holds below this part of the most that it can bear. What has drifted farther than this along the surface
// stays where it is [parts of the distance within which contacts are the same].
constexpr float held = 0.98f, mostDrift = 0.25f;

/// Contacts of one patch, as indices in ascending order of the distance that remains.
using Group = std::vector<std::uint32_t>;

/// The contacts of the last step, by feature.
class Memory {
  public:
    explicit Memory(std::span<const Patch> last) {
        for (const Patch& patch : last)
            for (int i = 0; i < patch.count; ++i) features_.push_back(patch.contacts[i].feature);
        std::sort(features_.begin(), features_.end());
    }

    bool kept(const Contact& contact) const {
        return std::binary_search(features_.begin(), features_.end(), contact.feature);
    }

  private:
    std::vector<std::uint32_t> features_;
};

/// @param seeds  contacts that found groups first, in this order
std::vector<Group> groupByNormal(const std::vector<Contact>& contacts, const std::vector<std::uint32_t>& seeds) {
    std::vector<glm::vec3> directions;
    const auto nearest = [&](const glm::vec3& normal) {
        std::pair<float, std::size_t> best{-2.f, 0};
        for (std::size_t g = 0; g < directions.size(); ++g)
            if (const float cosine = glm::dot(normal, directions[g]); cosine > best.first) best = {cosine, g};
        return best;
    };
    for (const std::uint32_t seed : seeds)
        if (nearest(contacts[seed].normal).first < mergedDirection) directions.push_back(contacts[seed].normal);

    std::vector<Group> groups(directions.size());
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
        const auto [cosine, best] = nearest(contacts[i].normal);
        if (cosine < sameDirection && groups.size() < mostPatches) {
            directions.push_back(contacts[i].normal);
            groups.push_back({i});
        } else {
            groups[best].push_back(i);
        }
    }
    std::erase_if(groups, [](const Group& group) { return group.empty(); });
    return groups;
}

/// Of each patch of the last step, the contact that is still there and was named first.
std::vector<std::uint32_t> seedsOf(const std::vector<Contact>& contacts, std::span<const Patch> last) {
    std::vector<std::uint32_t> seeds;
    for (const Patch& patch : last)
        for (int k = 0; k < patch.count; ++k) {
            const auto same = [&](const Contact& c) { return c.feature == patch.contacts[k].feature; };
            const auto found = std::find_if(contacts.begin(), contacts.end(), same);
            if (found == contacts.end()) continue;
            seeds.push_back(std::uint32_t(found - contacts.begin()));
            break;
        }
    return seeds;
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

/// Those that contacts are kept for, in the order in which they choose: what spans the patch comes first.
std::vector<Nudge> nudges() {
    std::vector<Nudge> all;
    for (const float tilt : tilts)
        for (int k = 0; k < tiltDirections; ++k) all.push_back({.tilt = tilt * towards(float(k) / tiltDirections)});
    for (int k = 0; k < shiftDirections; ++k) all.push_back({.shift = aside * towards(float(k) / shiftDirections)});
    for (const float twist : {aside, -aside}) all.push_back({.twist = twist});
    return all;
}

/// Those in between, by which what is lost is measured.
std::vector<Nudge> nudgesBetween() {
    std::vector<Nudge> all;
    for (int k = 0; k < tiltDirections; ++k)
        all.push_back({.tilt = measuredTilt * towards((float(k) + 0.5f) / tiltDirections)});
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
        btVector3 first, second;
        btPlaneSpace1(toBullet(normal), first, second);
        const glm::vec3 x = toGlm(first), y = toGlm(second);
        std::fill(column(gap) + count_, column(gap) + padded_, std::numeric_limits<float>::max());
        for (std::size_t k = 0; k < count_; ++k) {
            const Contact& contact = contacts[group[k]];
            const glm::vec3 turn = glm::cross(contact.position - centre, contact.normal);
            column(gap)[k] = contact.remaining();
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

    /// Of some contacts, the least gap after the last motion, and whose it is.
    std::pair<float, std::uint32_t> leastOf(const std::vector<std::uint32_t>& some) const {
        std::pair<float, std::uint32_t> best{std::numeric_limits<float>::max(), 0};
        for (const std::uint32_t k : some)
            if (const float now = numbers_[moved * padded_ + k]; now < best.first) best = {now, k};
        return best;
    }

    /// The first contact whose gap that is after the last motion.
    std::uint32_t with(float gap) const {
        const float* now = numbers_.data() + moved * padded_;
        return std::uint32_t(std::find(now, now + count_, gap) - now);
    }

    float extent() const { return extent_; }

  private:
    static constexpr std::size_t lanes = 8;
    enum Column { gap, tiltX, tiltY, shiftX, shiftY, twist, moved, columns };
    float* column(Column which) { return numbers_.data() + which * padded_; }

    std::size_t count_, padded_;
    std::vector<float> numbers_;  ///< column by column
    float extent_ = 0;
};

/// The contacts of a group that some small motion of the bodies meets first.
/// @param lost  is raised to what other motions meet before them [m]
std::vector<std::uint32_t> firstMet(const std::vector<Contact>& contacts, const Group& group, const Memory& memory,
                                    float& lost) {
    static const std::vector<Nudge> chosenFor = nudges(), between = nudgesBetween();
    Gaps gaps(contacts, group);
    std::vector<std::uint32_t> before, kept;
    for (std::uint32_t k = 0; k < group.size(); ++k)
        if (memory.kept(contacts[group[k]])) before.push_back(k);
    const auto keep = [&](const Nudge& nudge, float within) {
        const float least = gaps.least(nudge);
        if (kept.size() >= mostOfPatch || gaps.leastOf(kept).first <= least + within * gaps.extent()) return;
        const auto [gap, loyal] = gaps.leastOf(before);
        kept.push_back(gap <= least + within * gaps.extent() ? loyal : gaps.with(least));
    };
    for (const Nudge& nudge : chosenFor) keep(nudge, tolerance);
    keep({}, toleranceOfPress);
    for (const Nudge& nudge : between) {
        const float least = gaps.least(nudge);
        lost = std::max(lost, gaps.leastOf(kept).first - least);
    }
    return kept;
}

/// Bullet's callbacks for the start of contact would run each time a manifold is filled anew.
class StartSilenced {
  public:
    explicit StartSilenced(bool silence) : callback_(gContactStartedCallback) {
        if (silence) gContactStartedCallback = nullptr;
    }
    ~StartSilenced() { gContactStartedCallback = callback_; }

  private:
    ContactStartedCallback callback_;
};

btVector3 along(const btVector3& way, const btVector3& normal) {
    return way - normal.dot(way) * normal;
}

/// How far the two places that once touched have moved apart along the surface, as far as friction is to pull them
/// back. Where it did not hold them, that is no more than before.
btVector3 driftOf(const btManifoldPoint& point, const btPersistentManifold& manifold, float most) {
    const btVector3 drift = along(manifold.getBody0()->getWorldTransform() * point.m_localPointA -
                                      manifold.getBody1()->getWorldTransform() * point.m_localPointB,
                                  point.m_normalWorldOnB);
    // Bullet bounds friction in each of its directions by itself
    const float friction = std::max(std::abs(point.m_appliedImpulseLateral1), std::abs(point.m_appliedImpulseLateral2));
    if (friction >= held * point.m_combinedFriction * point.m_appliedImpulse) {
        const btVector3 before = point.m_positionWorldOnA - point.m_positionWorldOnB;
        most = std::min(most, float(along(before, point.m_normalWorldOnB).length()));
    }
    const float length = drift.length();
    return length > most ? most / length * drift : drift;
}

}  // namespace

Reduced reduce(std::vector<Contact>& contacts, std::span<const Patch> last) {
    std::stable_sort(contacts.begin(), contacts.end(),
                     [](const Contact& a, const Contact& b) { return a.remaining() < b.remaining(); });
    if (!isStill(contacts, last)) last = {};
    Reduced result;
    const Memory memory(last);
    for (const Group& group : groupByNormal(contacts, seedsOf(contacts, last))) {
        std::vector<std::uint32_t> kept(group.size());
        std::iota(kept.begin(), kept.end(), 0u);
        if (group.size() > MANIFOLD_CACHE_SIZE) kept = firstMet(contacts, group, memory, result.lost);
        for (std::size_t k = 0; k < kept.size(); ++k) {
            if (k % MANIFOLD_CACHE_SIZE == 0) result.patches.emplace_back();
            Patch& patch = result.patches.back();
            patch.contacts[std::size_t(patch.count++)] = contacts[group[kept[k]]];
        }
    }
    return result;
}

Manifolds::~Manifolds() {
    for (btPersistentManifold* manifold : manifolds_) dispatcher_.releaseManifold(manifold);
}

void Manifolds::write(std::span<const Patch> patches, const btCollisionObject& a, const btCollisionObject& b,
                      float sameWithin, btManifoldResult& result) {
    // One manifold at least: users expect a pair that overlaps to have one.
    while (manifolds_.size() < std::max<std::size_t>(patches.size(), 1))
        manifolds_.push_back(dispatcher_.getNewManifold(&a, &b));

    const bool aIsFirst = result.getBody0Internal() == &a;
    old_.clear();
    for (btPersistentManifold* manifold : manifolds_)
        for (int i = 0; i < manifold->getNumContacts(); ++i) old_.push_back(manifold->getContactPoint(i));

    for (std::size_t m = 0; m < manifolds_.size(); ++m) {
        btPersistentManifold* manifold = manifolds_[m];
        const bool touched = manifold->getNumContacts() > 0;
        const StartSilenced silence(touched);
        manifold->setNumContacts(0);
        result.setPersistentManifold(manifold);
        if (m < patches.size())
            for (int i = 0; i < patches[m].count; ++i) emit(patches[m].contacts[i], aIsFirst, sameWithin, result);
        for (int i = 0; i < manifold->getNumContacts(); ++i) inherit(*manifold, i, sameWithin);
        manifold->setContactBreakingThreshold(sameWithin);
        if (touched && manifold->getNumContacts() == 0 && gContactEndedCallback) gContactEndedCallback(manifold);
    }

    for (const btManifoldPoint& point : old_)
        if (point.m_userPersistentData && gContactDestroyedCallback)
            gContactDestroyedCallback(point.m_userPersistentData);
}

void Manifolds::emit(const Contact& contact, bool aIsFirst, float sameWithin, btManifoldResult& result) {
    const bool ofFirst = aIsFirst != static_cast<bool>(contact.feature & featureOfB);
    const int index = static_cast<int>(contact.feature & ~featureOfB);
    result.setShapeIdentifiersA(0, ofFirst ? index : -1);
    result.setShapeIdentifiersB(0, ofFirst ? -1 : index);

    // Bullet drops points beyond the threshold and merges those within it: open it as far as this point needs. One that
    // comes from afar goes in as if it touched, and is put right afterwards.
    btPersistentManifold& manifold = *result.getPersistentManifold();
    const bool fromAfar = contact.approach > 0 && contact.distance > sameWithin;
    manifold.setContactBreakingThreshold(fromAfar ? 0 : std::max(contact.distance, 0.f));
    const int before = manifold.getNumContacts();
    result.addContactPoint(toBullet(contact.normal), toBullet(contact.position), fromAfar ? 0 : contact.distance);
    if (!fromAfar || manifold.getNumContacts() == before) return;
    btManifoldPoint& point = manifold.getContactPoint(before);
    point.m_distance1 = contact.distance;
    point.m_positionWorldOnA = point.m_positionWorldOnB + contact.distance * point.m_normalWorldOnB;
    point.m_localPointA = manifold.getBody0()->getWorldTransform().invXform(point.m_positionWorldOnA);
}

void Manifolds::inherit(btPersistentManifold& manifold, int index, float sameWithin) {
    btManifoldPoint& point = manifold.getContactPoint(index);
    point.m_contactPointFlags |= BT_CONTACT_FLAG_FRICTION_ANCHOR;
    float nearest = sameWithin * sameWithin;
    auto source = old_.end();
    for (auto it = old_.begin(); it != old_.end(); ++it) {
        const float squared = std::min((it->m_localPointA - point.m_localPointA).length2(),
                                       (it->m_localPointB - point.m_localPointB).length2());
        if (squared < nearest && it->m_normalWorldOnB.dot(point.m_normalWorldOnB) > sameDirection)
            nearest = squared, source = it;
    }
    if (source == old_.end()) return;
    point.m_appliedImpulse = source->m_appliedImpulse;
    point.m_appliedImpulseLateral1 = source->m_appliedImpulseLateral1;
    point.m_appliedImpulseLateral2 = source->m_appliedImpulseLateral2;
    point.m_prevRHS = source->m_prevRHS;
    point.m_lifeTime = source->m_lifeTime + 1;
    point.m_userPersistentData = source->m_userPersistentData;
    point.m_positionWorldOnA += along(driftOf(*source, manifold, mostDrift * sameWithin), point.m_normalWorldOnB);
    point.m_localPointA = manifold.getBody0()->getWorldTransform().invXform(point.m_positionWorldOnA);
    *source = old_.back();
    old_.pop_back();
}

}  // namespace bilayer::bullet
