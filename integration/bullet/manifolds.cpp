#include "integration/bullet/manifolds.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>

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
// Where a patch is flatter than this part of its extent, the deepest contact is a matter of rounding.
constexpr float flatness = 1e-3f;
// Four sides of a patch, askew to everything one models: a rectangle's corners are then each alone on their side.
constexpr glm::vec2 sides[] = {{0.87f, 0.49f}, {-0.49f, 0.87f}, {-0.87f, -0.49f}, {0.49f, -0.87f}};

/// Contacts of one patch, as indices in ascending order of distance.
using Group = std::vector<std::uint32_t>;

std::vector<Group> groupByNormal(const std::vector<Contact>& contacts) {
    std::vector<Group> groups;
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
        Group* best = nullptr;
        float bestCosine = -2;
        for (Group& group : groups) {
            const float cosine = glm::dot(contacts[i].normal, contacts[group.front()].normal);
            if (cosine > bestCosine) best = &group, bestCosine = cosine;
        }
        if (bestCosine < sameDirection && groups.size() < mostPatches)
            groups.push_back({i});
        else
            best->push_back(i);
    }
    return groups;
}

/// The contact of the group that lies farthest in a direction, depth weighing in.
std::uint32_t farthest(const std::vector<Contact>& contacts, const Group& group, const glm::vec3& direction) {
    std::uint32_t best = group.front();
    float bestScore = -std::numeric_limits<float>::max();
    for (std::uint32_t i : group) {
        const float score = glm::dot(contacts[i].position, direction) - depthWeight * contacts[i].distance;
        if (score > bestScore) best = i, bestScore = score;
    }
    return best;
}

/// The contacts farthest to four sides. Of many that are equally deep but for rounding, as under a flat face, these
/// stay the same from step to step, while the deepest does not; so the deepest only goes in if it is so by more than
/// that.
Patch spread(const std::vector<Contact>& contacts, const Group& group) {
    glm::vec3 normal(0);
    for (std::uint32_t i : group) normal += contacts[i].normal;
    btVector3 first, second;
    btPlaneSpace1(toBullet(glm::normalize(normal)), first, second);

    std::vector<std::uint32_t> chosen;
    for (const glm::vec2& side : sides) {
        const std::uint32_t i = farthest(contacts, group, side.x * toGlm(first) + side.y * toGlm(second));
        if (std::find(chosen.begin(), chosen.end(), i) == chosen.end()) chosen.push_back(i);
    }
    const std::uint32_t deepest = group.front();
    const auto place = [&](std::uint32_t i) { return contacts[i].position; };
    float extent = 0, depth = std::numeric_limits<float>::max();
    for (std::uint32_t i : chosen) {
        extent = std::max(extent, glm::distance(place(i), place(chosen.front())));
        depth = std::min(depth, contacts[i].distance);
    }
    if (depth - contacts[deepest].distance > flatness * extent) {
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

std::vector<Patch> reduce(std::vector<Contact>& contacts) {
    std::stable_sort(contacts.begin(), contacts.end(),
                     [](const Contact& a, const Contact& b) { return a.distance < b.distance; });
    std::vector<Patch> patches;
    for (const Group& group : groupByNormal(contacts)) patches.push_back(spread(contacts, group));
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
            for (int i = 0; i < patches[m].count; ++i) emit(patches[m].contacts[i], aIsFirst, result);
        for (int i = 0; i < manifold->getNumContacts(); ++i) inherit(manifold->getContactPoint(i), sameWithin);
        manifold->setContactBreakingThreshold(sameWithin);
        if (touched && manifold->getNumContacts() == 0 && gContactEndedCallback) gContactEndedCallback(manifold);
    }

    for (const btManifoldPoint& point : old_)
        if (point.m_userPersistentData && gContactDestroyedCallback)
            gContactDestroyedCallback(point.m_userPersistentData);
}

void Manifolds::emit(const Contact& contact, bool aIsFirst, btManifoldResult& result) {
    const bool ofFirst = aIsFirst != static_cast<bool>(contact.feature & featureOfB);
    const int index = static_cast<int>(contact.feature & ~featureOfB);
    result.setShapeIdentifiersA(0, ofFirst ? index : -1);
    result.setShapeIdentifiersB(0, ofFirst ? -1 : index);

    // Bullet drops points beyond the threshold and merges those within it: open it as far as this point needs.
    result.getPersistentManifold()->setContactBreakingThreshold(std::max(contact.distance, 0.f));
    result.addContactPoint(toBullet(contact.normal), toBullet(contact.position), contact.distance);
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
