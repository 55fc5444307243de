// SPDX-License-Identifier: Apache-2.0
// Bodies are added, moved, scaled and removed at random in Bullet worlds, with and without extensions and sleeping.
#include <oneapi/tbb/global_control.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <list>
#include <memory>
#include <vector>

#include <bilayer/integration/bullet/extensions.h>
#include <bilayer/integration/bullet/shape.h>
#include "demos/shared/shapes.h"
#include "tests/bullet/world.h"
#include "tests/soak/soak.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::bodies_test {
using namespace bilayer::test;

namespace {

constexpr int steps = 240, maxBodies = 24;
constexpr float ground = 6, voxel = 0.06f;  // half the side of the ground, the edge of a voxel [m]
constexpr float deepest = -0.3f;            // of a body that has not been lost [m]

/// A world whose bodies come and go.
class Crowd {
  public:
    Crowd(unsigned seed, bool isExtended, bool sleeps) : random_(seed), sleeps_(sleeps) {
        if (isExtended)
            extensions_ = std::make_unique<bullet::WorldExtensions>(
                world_.dynamics, bullet::ExtensionOptions{.restStabilisation = true, .gyroscopicIntegration = true});
        groundShape_ = std::make_unique<bullet::Shape>(groundCollider());
        ground_ = std::make_unique<btRigidBody>(0.f, nullptr, groundShape_.get());
        world_.dynamics.addRigidBody(ground_.get());
    }
    ~Crowd() {
        while (!bodies_.empty()) remove(bodies_.begin());
        world_.dynamics.removeRigidBody(ground_.get());
    }

    void step() {
        if (random_(0, 1) < 0.3) change();
        world_.dynamics.stepSimulation(1.f / 240, 1, 1.f / 240);
        for (const Member& member : bodies_) check(*member.body);
    }

    /// A hash of all transforms.
    std::uint64_t fingerprint() const {
        std::uint64_t hash = 14695981039346656037u;  // FNV-1a
        for (const Member& member : bodies_) {
            btScalar matrix[16];
            member.body->getWorldTransform().getOpenGLMatrix(matrix);
            for (const btScalar value : matrix) {
                std::uint32_t bits = 0;
                std::memcpy(&bits, &value, sizeof bits);
                hash = (hash ^ bits) * 1099511628211u;
            }
        }
        return hash;
    }

  private:
    struct Member {
        std::unique_ptr<btCollisionShape> shape;
        std::unique_ptr<btRigidBody> body;
    };

    static std::shared_ptr<const Collider> groundCollider() {
        static const auto collider = deepCollider(shapes::box({ground, ground, 0.5f}), 0.25f);
        return collider;
    }
    static std::shared_ptr<const Collider> part(int kind) {
        static const std::shared_ptr<const Collider> parts[] = {
            deepCollider(shapes::box({0.2f, 0.15f, 0.1f}), voxel), deepCollider(shapes::sphere(0.2f, 3), voxel),
            deepCollider(shapes::torus(0.2f, 0.08f, 24, 12), voxel)};
        return parts[kind];
    }

    btVector3 place() {
        const float side = 0.5f * ground;
        return {float(random_(-side, side)), float(random_(-side, side)), float(random_(0.9, 2.5))};
    }

    void change() {
        const double kind = random_(0, 1);
        if (bodies_.empty() || (kind < 0.5 && bodies_.size() < maxBodies)) return add();
        auto chosen = bodies_.begin();
        std::advance(chosen, int(random_(0, double(bodies_.size()) - 1e-9)));
        if (kind < 0.7) return remove(chosen);
        btRigidBody& body = *chosen->body;
        if (kind < 0.85) {
            body.setWorldTransform(btTransform(btQuaternion::getIdentity(), place()));
            body.setInterpolationWorldTransform(body.getWorldTransform());
            body.setLinearVelocity({float(random_(-2, 2)), float(random_(-2, 2)), 0});
        } else {
            const auto scale = float(random_(0.7, 1.4));
            body.getCollisionShape()->setLocalScaling({scale, scale, scale});
            world_.dynamics.updateSingleAabb(&body);
        }
        body.activate(true);
    }

    void add() {
        const int kind = int(random_(0, 4.999));
        Member member;
        if (kind < 3)
            member.shape = std::make_unique<bullet::Shape>(part(kind));
        else if (kind == 3)
            member.shape = std::make_unique<btBoxShape>(btVector3(0.15f, 0.1f, 0.2f));
        else
            member.shape = std::make_unique<btSphereShape>(0.15f);
        btVector3 inertia(0, 0, 0);
        member.shape->calculateLocalInertia(1, inertia);
        member.body = std::make_unique<btRigidBody>(1.f, nullptr, member.shape.get(), inertia);
        member.body->setWorldTransform(btTransform(btQuaternion::getIdentity(), place()));
        member.body->setInterpolationWorldTransform(member.body->getWorldTransform());
        if (!sleeps_) member.body->setActivationState(DISABLE_DEACTIVATION);
        world_.dynamics.addRigidBody(member.body.get());
        bodies_.push_back(std::move(member));
    }

    void remove(std::list<Member>::iterator member) {
        world_.dynamics.removeRigidBody(member->body.get());
        bodies_.erase(member);
    }

    static void check(const btRigidBody& body) {
        const btVector3 at = body.getWorldTransform().getOrigin(), speed = body.getLinearVelocity();
        CAPTURE(at.x(), at.y(), at.z(), speed.length());
        REQUIRE((std::isfinite(at.length()) && std::isfinite(speed.length()) &&
                 std::isfinite(body.getAngularVelocity().length())));
        const bool isAbove = std::abs(at.x()) < ground && std::abs(at.y()) < ground;
        REQUIRE((!isAbove || at.z() > 0.5f + deepest));
    }

    Random random_;
    bool sleeps_;
    World world_;
    std::unique_ptr<bullet::WorldExtensions> extensions_;
    std::unique_ptr<bullet::Shape> groundShape_;
    std::unique_ptr<btRigidBody> ground_;
    std::list<Member> bodies_;
};

std::uint64_t played(unsigned seed, bool isExtended, bool sleeps, int threads) {
    tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
    Crowd crowd(seed, isExtended, sleeps);
    for (int i = 0; i < steps; ++i) crowd.step();
    return crowd.fingerprint();
}

}  // namespace

TEST_CASE("bodies come and go: none is lost, memory does not grow, and a repetition is the same to the bit") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    soak(6, [&](unsigned round) {
        const bool isExtended = round & 1, sleeps = round & 2;
        const std::uint64_t first = played(seed + round, isExtended, sleeps, 2);
        REQUIRE(played(seed + round, isExtended, sleeps, 1) == first);
    });
}
}  // namespace bilayer::bodies_test
