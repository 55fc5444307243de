// Compounds with fields in them.
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

/// GImpact counts locks while its triangles are read, without atomics: such pairs are collided one after the other.
bool locks(const btCollisionShape& shape);

/// A compound and another shape, which may be one, too. Bullet's own algorithm collides the children of other kinds.
/// Those pairs of children that hold a field are found here, by the ways that the children go in the step, since Bullet
/// asks only for those whose boxes overlap already.
class CompoundAlgorithm : public FieldAlgorithm {
  public:
    /// @param rest  Bullet's algorithm for the same pair, which this one takes over
    CompoundAlgorithm(const btCollisionAlgorithmConstructionInfo& info, btCollisionAlgorithm* rest, StepState& state)
        : FieldAlgorithm(info), rest_(rest), state_(state) {}
    ~CompoundAlgorithm() override;

    void gather(const btCollisionObjectWrapper& first, const btCollisionObjectWrapper& second, float seconds,
                std::vector<Task>& tasks) override;
    void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                          const btDispatcherInfo& info, btManifoldResult* result) override;
    void getAllContactManifolds(btManifoldArray& manifolds) override;

    /// A child by its indices in its compound and in those around that, outermost first; empty for what is no compound.
    using Path = std::vector<int>;

    /// Two children one of which is a field.
    struct Children {
        Path firstPath, secondPath;
        Side first, second;
    };

  private:
    /// Of two children, and whether the second one is the field that the other is collided with.
    using Key = std::tuple<Path, Path, bool>;

    using Pairs = std::map<Key, std::shared_ptr<Pair>>;

    static Key keyOf(const Children& children);
    Task taskOf(const Children& children);

    btCollisionAlgorithm* rest_;
    StepState& state_;
    std::shared_ptr<Pairs> pairs_ = std::make_shared<Pairs>();
};

}  // namespace bilayer::bullet::detail
