// SPDX-License-Identifier: Apache-2.0
#include <bilayer/collider/contact.h>
#include <bilayer/integration/bullet/dispatcher.h>

#include <BulletCollision/BroadphaseCollision/btOverlappingPairCache.h>
#include <BulletCollision/CollisionDispatch/btGhostObject.h>
#include <tbb/parallel_for_each.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>
#include <vector>

#include "integration/bullet/detail/algorithms.h"
#include "integration/bullet/detail/compound.h"
#include "integration/bullet/detail/continuous_collision.h"
#include "integration/bullet/detail/sampled_pairs.h"

namespace bilayer::bullet {

using namespace detail;
using namespace bilayer::detail;

namespace {

/// Whether the pairs belong to a ghost object: character controllers dispatch them again within a step.
bool isOfGhost(btOverlappingPairCache& cache) {
    if (cache.getNumOverlappingPairs() == 0) return false;
    const btBroadphasePair& pair = *cache.getOverlappingPairArrayPtr();
    const auto owns = [&](const btBroadphaseProxy* proxy) {
        auto* ghost = dynamic_cast<btPairCachingGhostObject*>(static_cast<btCollisionObject*>(proxy->m_clientObject));
        return ghost && ghost->getOverlappingPairCache() == &cache;
    };
    return owns(pair.m_pProxy0) || owns(pair.m_pProxy1);
}

/// The tasks of all pairs of shapes with a field, of overlapping pairs whose algorithm is ours.
std::vector<Task> tasksOf(btOverlappingPairCache& cache, btDispatcher& dispatcher, float seconds) {
    std::vector<Task> tasks;
    for (int i = 0; i < cache.getNumOverlappingPairs(); ++i) {
        btBroadphasePair& overlap = cache.getOverlappingPairArrayPtr()[i];
        auto* first = static_cast<btCollisionObject*>(overlap.m_pProxy0->m_clientObject);
        auto* second = static_cast<btCollisionObject*>(overlap.m_pProxy1->m_clientObject);
        if (!holdsField(*first->getCollisionShape()) && !holdsField(*second->getCollisionShape())) continue;
        if (!dispatcher.needsCollision(first, second)) continue;
        const btCollisionObjectWrapper one(nullptr, first->getCollisionShape(), first, first->getWorldTransform(), -1,
                                           -1);
        const btCollisionObjectWrapper two(nullptr, second->getCollisionShape(), second, second->getWorldTransform(),
                                           -1, -1);
        if (!overlap.m_algorithm)
            overlap.m_algorithm = dispatcher.findAlgorithm(&one, &two, nullptr, BT_CONTACT_POINT_ALGORITHMS);
        // else it is GImpact's, which calls us for its parts, or one that the user has registered
        if (auto* algorithm = dynamic_cast<FieldAlgorithm*>(overlap.m_algorithm))
            algorithm->gather(one, two, seconds, tasks);
    }
    return tasks;
}

/// Finds the contacts of all tasks, in parallel except for shapes that lock. Samples all pairs first, if the sampler
/// works.
void collideAll(const std::vector<Task>& tasks, SampledPairs& sampled) {
    std::vector<std::optional<std::size_t>> samples(tasks.size());  // numbers of the sampled pairs
    sampled.clear();
    if (sampled.works())
        for (std::size_t i = 0; i < tasks.size(); ++i)
            if (const auto& [pair, a, b] = tasks[i]; isField(*a.shape))
                samples[i] = sampled.add(a.placed(), b.placed(), marginOf(a, b));
    const bool areSampled = sampled.sample();
    const auto collide = [&](std::size_t i) {
        const auto& [pair, a, b] = tasks[i];
        if (areSampled && samples[i])
            pair->collide(a, b, sampled, *samples[i]);
        else
            pair->collide(a, b);
    };
    std::vector<std::size_t> parallel, serial;
    for (std::size_t i = 0; i < tasks.size(); ++i) (locks(*tasks[i].a.shape) ? serial : parallel).push_back(i);
    tbb::parallel_invoke([&] { std::for_each(serial.begin(), serial.end(), collide); },
                         [&] { tbb::parallel_for_each(parallel, collide); });
}

}  // namespace

struct Dispatcher::Functions : FieldAlgorithmFunctions {
    Functions(btCollisionConfiguration& configuration, PointSampler sampler)
        : FieldAlgorithmFunctions(configuration), sampledPairs(std::move(sampler)) {}

    SampledPairs sampledPairs;
    DispatchStatistics last;
};

struct FieldAlgorithms::Functions : FieldAlgorithmFunctions {
    using FieldAlgorithmFunctions::FieldAlgorithmFunctions;
};

Dispatcher::Dispatcher(btCollisionConfiguration* configuration, PointSampler sampler)
    : btCollisionDispatcher(configuration),
      functions_(std::make_unique<Functions>(*configuration, std::move(sampler))) {
    registerFields();
}

Dispatcher::~Dispatcher() = default;

void Dispatcher::registerFields() {
    functions_->registerWith(*this);
}

void Dispatcher::dispatchAllCollisionPairs(btOverlappingPairCache* cache, const btDispatcherInfo& info,
                                           btDispatcher* dispatcher) {
    const auto start = std::chrono::steady_clock::now();
    const bool isStep = !isOfGhost(*cache);
    functions_->state = {
        .running = {}, .seconds = isStep ? info.m_timeStep : 0, .speculatesOnAll = !ContinuousCollision::serves(*this)};

    const std::vector<Task> tasks = tasksOf(*cache, *this, functions_->state.seconds);
    collideAll(tasks, functions_->sampledPairs);
    btCollisionDispatcher::dispatchAllCollisionPairs(cache, info, dispatcher);

    for (const Task& task : tasks) task.pair->forget();
    functions_->state.seconds = 0;
    if (!isStep) return;
    functions_->last = functions_->state.running;
    functions_->last.device = functions_->sampledPairs.times();
    functions_->last.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

const DispatchStatistics& Dispatcher::statistics() const {
    return functions_->last;
}

FieldAlgorithms::FieldAlgorithms(btCollisionDispatcher& dispatcher)
    : dispatcher_(dispatcher), functions_(std::make_unique<Functions>(*dispatcher.getCollisionConfiguration())) {
    functions_->state.hasOtherDispatcher = true;
    registerFields();
}

FieldAlgorithms::~FieldAlgorithms() = default;

void FieldAlgorithms::registerFields() {
    functions_->registerWith(dispatcher_);
}

}  // namespace bilayer::bullet
