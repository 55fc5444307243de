// Where scenes are played: a world whose every step is timed, whose frames are recorded, and whose bodies are measured
// against their meshes afterwards.
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

struct ThingOptions {
    float voxelSize;          ///< [m]
    float interiorWidth = 6;  ///< of the band: bodies that sink in deeper are lost [voxels]
    float margin = -1;        ///< up to which contacts are made [m]; negative: a voxel
    bool speculative = true;  ///< what moves farther is followed (see bullet::ShapeOptions)
    ContactAccuracy accuracy = ContactAccuracy::exactNearFeatures;  ///< of contacts
    float restingFriction = 1;                                      ///< see bullet::ShapeOptions
};

/// What bodies are made of: what Bullet collides, and what measures whether it did.
struct Thing {
    Mesh mesh;
    LevelSet field;
    std::shared_ptr<btCollisionShape> shape;
    Specimen specimen;
};

/// From a mesh to a shape for Bullet. Throws as build() does.
std::shared_ptr<const Thing> makeThing(Mesh mesh, const ThingOptions& options);
/// A shape of Bullet's own, and the mesh that it is like: Bullet makes no use of the field. Throws as build() does.
std::shared_ptr<const Thing> makeThing(Mesh mesh, std::shared_ptr<btCollisionShape> shape, float voxelSize);

struct StageOptions {
    float stepsPerSecond = 240;
    int stepsPerFrame = 4;       ///< a frame is recorded after so many steps
    int framesPerMeasuring = 1;  ///< penetrations are measured in every so many frames, and in the last
};

class Stage {
  public:
    explicit Stage(std::string title, const StageOptions& options = {});

    /// Adds a body that stands at a pose. Valid as long as the stage. Call it before the first step.
    btRigidBody& add(std::shared_ptr<const Thing> thing, const Matter& matter, const Pose& pose, const Look& look);

    void step();
    /// Steps until so many seconds have passed since the start, or until `done`, which is asked after each step.
    void run(
        double seconds, const std::function<bool()>& done = [] { return false; });

    World& world() { return world_; }
    double time() const { return double(steps_) / options_.stepsPerSecond; }  ///< [s]
    bool allAsleep() const { return world_.asleep() == world_.moving(); }
    /// The poses of all bodies in each recorded frame, in the order in which they were added.
    const std::vector<std::vector<Pose>>& frames() const { return frames_; }

    /// Measures, and hands everything over but the criteria; the stage is of no more use.
    Outcome finish(const View& view);

  private:
    struct Body {
        std::shared_ptr<const Thing> thing;
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

/// Plays a scene again on 1, 2 and 8 threads: of these runs, those that differ from the first in any bit.
Criterion sameBits(const Outcome& first, const std::function<Outcome()>& scene);

}  // namespace bilayer::demo
