// SPDX-License-Identifier: Apache-2.0
// States of a world's objects at the beginning of a step.
// Tested by tests/bullet/body_sweep.cpp through WorldExtensions.
#pragma once

#include <BulletDynamics/Dynamics/btDynamicsWorld.h>

#include <cstddef>
#include <vector>

namespace bilayer::bullet::detail {

template <class State>
class RecordedStates {
  public:
    /// @param stateOf  (btCollisionObject&) -> State
    template <class StateOf>
    void record(btDynamicsWorld& world, StateOf&& stateOf) {
        clear();
        const btCollisionObjectArray& objects = world.getCollisionObjectArray();
        for (int i = 0; i < objects.size(); ++i) entries_.push_back({objects[i], stateOf(*objects[i])});
    }
    void clear() { entries_.clear(); }

    /// Null for an object that was not recorded.
    const State* find(const btCollisionObject& object) const {
        const auto index = std::size_t(object.getWorldArrayIndex());
        return index < entries_.size() && entries_[index].object == &object ? &entries_[index].state : nullptr;
    }

  private:
    struct Entry {
        const btCollisionObject* object;
        State state;
    };
    std::vector<Entry> entries_;  ///< in the order of the world's objects
};

}  // namespace bilayer::bullet::detail
