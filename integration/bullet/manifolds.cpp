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
// Of two contacts, the one that is deeper by d is preferred up to this many times d nearer to the others: overlap that
// is left out of a patch is not resolved.
constexpr float depthWeight = 8;
// A patch of the last step goes on until its normal is within about 15 degrees of another's.
constexpr float mergedDirection = 0.966f;
// A contact that was kept in the last step is preferred up to this part of its patch's extent farther in: which of two
// that are nearly as good is the better one is a matter of rounding, and bodies would tremble with each change.
constexpr float loyalty = 0.1f;
// All this holds for bodies about at rest: when the deepest overlap has changed by less than this part of the contacts'
// extent in one step. In an impact every contact is judged anew.
constexpr float stillness = 3e-3f;
// Where a patch is flatter than this part of its extent, the deepest contact is a matter of rounding.
constexpr float flatness = 1e-3f;
// Four sides of a patch, askew to everything one models: a rectangle's corners are then each alone on their side.
constexpr glm::vec2 sides[] = {{0.87f, 0.49f}, {-0.49f, 0.87f}, {-0.87f, -0.49f}, {0.49f, -0.87f}};

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

/// The contact of the group that lies farthest in a direction, depth and a bonus weighing in.
std::uint32_t farthest(const std::vector<Contact>& contacts, const Group& group, const std::vector<float>& bonus,
                       const glm::vec3& direction) {
    std::uint32_t best = group.front();
    float bestScore = -std::numeric_limits<float>::max();
    for (std::size_t k = 0; k < group.size(); ++k) {
        const Contact& contact = contacts[group[k]];
        const float score = glm::dot(contact.position, direction) - depthWeight * contact.remaining() + bonus[k];
        if (score > bestScore) best = group[k], bestScore = score;
    }
    return best;
}

/// The contacts farthest to four sides. Of many that are equally deep but for rounding, as under a flat face, these
/// stay the same from step to step, while the deepest does not; so the deepest only goes in if it is so by more than
/// that.
Patch spread(const std::vector<Contact>& contacts, const Group& group, const Memory& memory) {
    glm::vec3 normal(0);
    for (std::uint32_t i : group) normal += contacts[i].normal;
    btVector3 first, second;
    btPlaneSpace1(toBullet(glm::normalize(normal)), first, second);

    const float whole = extentOf(contacts, group);
    std::vector<float> bonus;
    for (std::uint32_t i : group) bonus.push_back(memory.kept(contacts[i]) ? loyalty * whole : 0);

    std::vector<std::uint32_t> chosen;
    for (const glm::vec2& side : sides) {
        const std::uint32_t i = farthest(contacts, group, bonus, side.x * toGlm(first) + side.y * toGlm(second));
        if (std::find(chosen.begin(), chosen.end(), i) == chosen.end()) chosen.push_back(i);
    }
    const std::uint32_t deepest = group.front();
    const auto place = [&](std::uint32_t i) { return contacts[i].position; };
    float extent = 0, depth = std::numeric_limits<float>::max();
    for (std::uint32_t i : chosen) {
        extent = std::max(extent, glm::distance(place(i), place(chosen.front())));
        depth = std::min(depth, contacts[i].remaining());
    }
    if (depth - contacts[deepest].remaining() > flatness * extent) {
        const auto nearer = [&](std::uint32_t i, std::uint32_t j) {
            return glm::distance(place(i), place(deepest)) < glm::distance(place(j), place(deepest));
        };
        if (chosen.size() < MANIFOLD_CACHE_SIZE)
            chosen.push_back(deepest);
        else
            *std::min_element(chosen.begin(), chosen.end(), nearer) = deepest;
    }

    Patch patch;
    for (std::uint32_t i : chosen) patch.contacts[patch.count++] = contacts[i];
    return patch;
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

}  // namespace

std::vector<Patch> reduce(std::vector<Contact>& contacts, std::span<const Patch> last) {
    std::stable_sort(contacts.begin(), contacts.end(),
                     [](const Contact& a, const Contact& b) { return a.remaining() < b.remaining(); });
    if (!isStill(contacts, last)) last = {};
    std::vector<Patch> patches;
    const Memory memory(last);
    for (const Group& group : groupByNormal(contacts, seedsOf(contacts, last)))
        patches.push_back(spread(contacts, group, memory));
    return patches;
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
        for (int i = 0; i < manifold->getNumContacts(); ++i) inherit(manifold->getContactPoint(i), sameWithin);
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

void Manifolds::inherit(btManifoldPoint& point, float sameWithin) {
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
    *source = old_.back();
    old_.pop_back();
}

}  // namespace bilayer::bullet
