#include "integration/bullet/manifolds.h"

#include <algorithm>
#include <glm/geometric.hpp>

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

/// Adds the contact of the group that scores highest, if any scores above zero.
template <class Score>
void addBest(Patch& patch, const std::vector<Contact>& contacts, const Group& group, Score score) {
    float best = 0;
    const Contact* choice = nullptr;
    const float deepest = patch.contacts[0].distance;
    for (std::uint32_t i : group) {
        const float value = score(contacts[i].position) - depthWeight * (contacts[i].distance - deepest);
        if (value > best) best = value, choice = &contacts[i];
    }
    if (choice) patch.contacts[patch.count++] = *choice;
}

Patch spread(const std::vector<Contact>& contacts, const Group& group) {
    Patch patch;
    patch.contacts[patch.count++] = contacts[group.front()];
    const glm::vec3 first = patch.contacts[0].position, normal = patch.contacts[0].normal;
    addBest(patch, contacts, group, [&](const glm::vec3& p) { return glm::distance(p, first); });
    if (patch.count < 2) return patch;

    // The farthest to either side of the line through the first two.
    const glm::vec3 across = glm::cross(normal, patch.contacts[1].position - first);
    const float length = glm::length(across);
    if (!(length > 0)) return patch;
    const glm::vec3 side = across / length;
    addBest(patch, contacts, group, [&](const glm::vec3& p) { return glm::dot(p - first, side); });
    addBest(patch, contacts, group, [&](const glm::vec3& p) { return glm::dot(first - p, side); });
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
