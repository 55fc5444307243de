// SPDX-License-Identifier: Apache-2.0
// Collision of compounds that hold fields.
// Tested by tests/bullet/compound.cpp through bullet::Dispatcher.
#pragma once

#include <map>
#include <memory>
#include <tuple>
#include <vector>

#include "integration/bullet/detail/algorithms.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// Whether a shape is a field or a compound that holds one, at any depth.
bool holdsField(const btCollisionShape& shape);

/// Whether the shape locks. GImpact counts locks while its triangles are read, without atomics. Such pairs are collided
/// serially.
bool locks(const btCollisionShape& shape);

/// Collides a compound with another shape, which may be a compound too. Bullet's own algorithm collides the children
/// without a field. This class finds the pairs of children with a field by the children's motion in the step, since
/// Bullet visits only children whose boxes overlap already.
class CompoundAlgorithm : public FieldAlgorithm {
  public:
    /// @param rest  Bullet's algorithm for the same pair; this object takes ownership of it
    CompoundAlgorithm(const btCollisionAlgorithmConstructionInfo& info, btCollisionAlgorithm* rest, StepState& state)
        : FieldAlgorithm(info), rest_(rest), state_(state) {}
    ~CompoundAlgorithm() override;

    void gather(const btCollisionObjectWrapper& first, const btCollisionObjectWrapper& second, float seconds,
                std::vector<Task>& tasks) override;
    void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                          const btDispatcherInfo& info, btManifoldResult* result) override;
    void getAllContactManifolds(btManifoldArray& manifolds) override;

    /// A child, identified by its index in its compound and in each enclosing compound, outermost first. Empty for a
    /// shape that is not a compound.
    using Path = std::vector<int>;

    /// Two children; one of them is a field.
    struct Children {
        Path firstPath, secondPath;
        Side first, second;
    };

  private:
    /// The paths of two children, and whether the second one is the field that the first one is collided with.
    using Key = std::tuple<Path, Path, bool>;

    using Pairs = std::map<Key, std::shared_ptr<Pair>>;

    static Key keyOf(const Children& children);
    Task taskOf(const Children& children);

    btCollisionAlgorithm* rest_;
    StepState& state_;
    std::shared_ptr<Pairs> pairs_ = std::make_shared<Pairs>();
};

}  // namespace bilayer::bullet::detail
