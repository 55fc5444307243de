// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/missing_dispatcher.h"

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <LinearMath/btAabbUtil2.h>
#include <fmt/core.h>

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <map>
#include <mutex>

namespace bilayer::bullet::detail {

namespace {

std::atomic<int> knowing{0};
std::atomic<bool> isDone{false};  // the warning has been printed

// Limit of entries, which include unused transforms of bodies.
constexpr std::size_t maxEntries = 4096;

using Address = std::uintptr_t;

Address addressOf(const btTransform& transform) {
    return reinterpret_cast<Address>(&transform);
}

/// Offset from a body's transform to its predicted transform in memory.
Address predictedOffset() {
    static const btCollisionObject object;
    return addressOf(object.getInterpolationWorldTransform()) - addressOf(object.getWorldTransform());
}

/// The bounding boxes requested from fields.
class Boxes {
  public:
    /// Whether the box is that of a dynamic body and meets another body's.
    bool note(const void* field, Address transform, const btVector3& lower, const btVector3& upper) {
        if (asked_.size() >= maxEntries) asked_.clear();
        const auto body = asked_.find(transform - predictedOffset());
        const bool isPredicted = body != asked_.end() && body->second.field == field && body->second.time == time_;
        Asked& here = asked_[transform];
        const std::uint64_t before = here.field == field ? here.time : 0;
        here = {field, lower, upper, ++time_};
        return isPredicted && before > 0 && meetsAnother(transform, here, before);
    }

    void forget(const void* field) {
        std::erase_if(asked_, [&](const auto& entry) { return entry.second.field == field; });
    }

  private:
    struct Asked {
        const void* field = nullptr;
        btVector3 lower, upper;
        std::uint64_t time = 0;  ///< number of the request

        bool meets(const Asked& other) const { return TestAabbAgainstAabb2(lower, upper, other.lower, other.upper); }
        /// Whether another transform may be a copy of this one, made by a program to draw a body.
        bool isCopyOf(const Asked& other) const {
            if (field != other.field) return false;
            const btVector3 offset = (lower + upper - other.lower - other.upper).absolute(), size = upper - lower;
            return offset.x() < size.x() && offset.y() < size.y() && offset.z() < size.z();
        }
    };

    /// Whether the box meets one that was requested after the body's last request: that one is in the same world.
    bool meetsAnother(Address transform, const Asked& box, std::uint64_t since) const {
        for (const auto& [other, asked] : asked_) {
            const Address distance = other > transform ? other - transform : transform - other;
            const bool isSameBody = distance < sizeof(btCollisionObject);
            if (!isSameBody && asked.time > since && asked.meets(box) && !asked.isCopyOf(box)) return true;
        }
        return false;
    }

    std::map<Address, Asked> asked_;  ///< by the address of the transform
    std::uint64_t time_ = 0;
};

std::mutex mutex;

/// Never destroyed: fields may outlive it.
Boxes& boxes() {
    static Boxes& all = *new Boxes;
    return all;
}

}  // namespace

FieldDispatcherMark::FieldDispatcherMark() {
    ++knowing;
}

FieldDispatcherMark::~FieldDispatcherMark() {
    --knowing;
}

void noteBox(const void* field, const btTransform& transform, const btVector3& lower, const btVector3& upper) {
    if (knowing > 0 || isDone) return;
    const std::lock_guard lock(mutex);
    if (!boxes().note(field, addressOf(transform), lower, upper) || isDone.exchange(true)) return;
    fmt::print(stderr,
               "bilayer: two fields meet and pass through each other: Bullet's own dispatcher does not know fields; "
               "use bilayer::bullet::Dispatcher, or FieldAlgorithms with your dispatcher\n");
}

void forgetBoxes(const void* field) {
    const std::lock_guard lock(mutex);
    boxes().forget(field);
}

}  // namespace bilayer::bullet::detail
