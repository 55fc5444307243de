// SPDX-License-Identifier: Apache-2.0
// The stage of a scene: a world that times every step, records frames, and afterwards measures the penetration of
// bodies from their meshes.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <bilayer/sdf/level_set.h>
#include "demos/shared/exact_distance.h"
#include "demos/shared/outcome.h"
#include "demos/shared/recording.h"
#include "demos/shared/world.h"

namespace bilayer::demo {

struct PrototypeOptions {
    float voxelSize;                ///< [m]
    float interiorWidthVoxels = 6;  ///< of the band; bodies that penetrate deeper are not detected [voxels]
    float margin = -1;              ///< contact margin [m]; negative: one voxel
    bool speculative = true;        ///< speculative contacts for fast bodies (see bullet::ShapeOptions)
    ContactAccuracy accuracy = ContactAccuracy::exactNearFeatures;  ///< of contacts
    float restingFriction = 1;                                      ///< see bullet::ShapeOptions
};

/// The geometry that bodies share: the shape that Bullet collides, and the reference data for measurements.
struct BodyPrototype {
    Mesh mesh;
    LevelSet field;
    std::shared_ptr<btCollisionShape> shape;
    Specimen specimen;
};

/// Makes a Bullet shape from a mesh. Throws as build() does.
std::shared_ptr<const BodyPrototype> makePrototype(Mesh mesh, const PrototypeOptions& options);
/// Wraps a native Bullet shape and its mesh. Bullet does not use the field. Throws as build() does.
std::shared_ptr<const BodyPrototype> makePrototype(Mesh mesh, std::shared_ptr<btCollisionShape> shape, float voxelSize);

struct StageOptions {
    float stepsPerSecond = 240;
    int stepsPerFrame = 4;       ///< steps per recorded frame
    int framesPerMeasuring = 1;  ///< penetrations are measured once per this count of frames, and in the last frame
    bool smoothGround = true;    ///< as in bullet::ExtensionOptions
};

class Stage {
  public:
    explicit Stage(std::string title, const StageOptions& options = {});

    /// Adds a body at a pose. The reference is valid as long as the stage. Call this before the first step.
    btRigidBody& add(std::shared_ptr<const BodyPrototype> prototype, const Matter& matter, const Pose& pose,
                     const Look& look);

    void step();
    /// Steps until this time since the start has passed, or until `done` returns true. It is called after each step.
    void run(
        double seconds, const std::function<bool()>& done = [] { return false; });

    World& world() { return world_; }
    double time() const { return double(steps_) / options_.stepsPerSecond; }  ///< [s]
    bool allAsleep() const { return world_.asleep() == world_.moving(); }
    /// The poses of all bodies in each recorded frame, in the order of add().
    const std::vector<std::vector<Pose>>& frames() const { return frames_; }

    /// Measures, and returns all results except the criteria. The stage must not be used afterwards.
    Outcome finish(const View& view);

  private:
    struct Body {
        std::shared_ptr<const BodyPrototype> prototype;
        Look look;
        bool moves;
    };
    void keepEnergy();
    std::vector<double> penetrationsIn(const std::vector<Pose>& poses) const;
    Recording record(const View& view) const;

    StageOptions options_;
    Outcome outcome_;
    World world_;
    std::vector<Body> bodies_;
    std::vector<std::vector<Pose>> frames_;
    long steps_ = 0;
};

/// Repeats a scene on 1, 2 and 8 threads, and counts the runs that differ from the first in any bit.
Criterion sameBits(const Outcome& first, const std::function<Outcome()>& scene);

}  // namespace bilayer::demo
