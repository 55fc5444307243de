// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/stage.h"

#include <fmt/core.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <set>

#include <bilayer/sdf/build.h>

namespace bilayer::demo {
namespace {

constexpr double specimenSpacing = 2;  // between the sample points for penetration [voxels]

// FNV-1a, 64 bits: www.isthe.com/chongo/tech/comp/fnv.
constexpr std::uint64_t fnvStart = 0xcbf29ce484222325u, fnvPrime = 0x100000001b3u;

void mix(std::uint64_t& fingerprint, const std::vector<Pose>& poses) {
    for (const auto& [p, q] : poses)
        for (const float value : {p.x, p.y, p.z, q.w, q.x, q.y, q.z}) {
            std::uint32_t bits;
            std::memcpy(&bits, &value, sizeof bits);
            fingerprint = (fingerprint ^ bits) * fnvPrime;
        }
}

std::string grouped(std::uint64_t count) {
    std::string text = std::to_string(count);
    for (int i = int(text.size()) - 3; i > 0; i -= 3) text.insert(std::size_t(i), " ");
    return text;
}

}  // namespace

std::shared_ptr<const BodyPrototype> makePrototype(Mesh mesh, const PrototypeOptions& options) {
    BuildOptions band;
    band.voxelSize = options.voxelSize;
    band.interiorWidthVoxels = options.interiorWidthVoxels;
    LevelSet field = build(mesh, band);
    auto collider = std::make_shared<Collider>(mesh, field, ColliderOptions{.accuracy = options.accuracy});
    const bullet::ShapeOptions centred{.frame = bullet::centreOfMassFrame(*collider),
                                       .margin = options.margin,
                                       .speculative = options.speculative,
                                       .restingFriction = options.restingFriction};
    auto shape = std::make_shared<bullet::Shape>(collider, centred);
    Specimen specimen(mesh, specimenSpacing * options.voxelSize);
    return std::make_shared<BodyPrototype>(
        BodyPrototype{std::move(mesh), std::move(field), std::move(shape), std::move(specimen)});
}

std::shared_ptr<const BodyPrototype> makePrototype(Mesh mesh, std::shared_ptr<btCollisionShape> shape,
                                                   float voxelSize) {
    LevelSet field = build(mesh, {.voxelSize = voxelSize});
    Specimen specimen(mesh, specimenSpacing * voxelSize);
    return std::make_shared<BodyPrototype>(
        BodyPrototype{std::move(mesh), std::move(field), std::move(shape), std::move(specimen)});
}

Stage::Stage(std::string title, const StageOptions& options)
    : options_(options), outcome_{Recording(title)}, world_({.smoothGround = options.smoothGround}) {
    outcome_.title = std::move(title);
    outcome_.stepsPerSecond = options.stepsPerSecond;
    outcome_.fingerprint = fnvStart;
}

btRigidBody& Stage::add(std::shared_ptr<const BodyPrototype> prototype, const Matter& matter, const Pose& pose,
                        const Look& look) {
    const double voxel = prototype->field.voxelSize();
    outcome_.voxelSize = bodies_.empty() ? voxel : std::min(outcome_.voxelSize, voxel);
    outcome_.bodies += matter.mass > 0;
    // above this penetration, 4 cm by default, Bullet converts penetration into velocity
    world_.bullet().getSolverInfo().m_splitImpulsePenetrationThreshold = -float(outcome_.voxelSize);

    btRigidBody& body = world_.add(prototype->shape, matter, pose);
    bodies_.push_back({std::move(prototype), look, matter.mass > 0});
    return body;
}

void Stage::keepEnergy() {
    outcome_.energies.kinetic.push_back(world_.kineticEnergy());
    outcome_.energies.potential.push_back(world_.potentialEnergy());
}

void Stage::step() {
    if (steps_ == 0) {
        keepEnergy();
        frames_.push_back(world_.poses());
    }
    const auto start = std::chrono::steady_clock::now();
    world_.step(1 / options_.stepsPerSecond);
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
    ++steps_;

    outcome_.stepMs.push_back(took.count());
    outcome_.contactsFound += world_.statistics().contactsFound;
    outcome_.contactsKept += world_.statistics().contactsKept;
    outcome_.beyondBand += world_.statistics().beyondBand;
    keepEnergy();
    std::vector<Pose> poses = world_.poses();
    mix(outcome_.fingerprint, poses);
    if (steps_ % options_.stepsPerFrame == 0) frames_.push_back(std::move(poses));
}

void Stage::run(double seconds, const std::function<bool()>& done) {
    while (time() < seconds) {
        step();
        if (done()) return;
    }
}

std::vector<double> Stage::penetrationsIn(const std::vector<Pose>& poses) const {
    struct Ball {
        glm::vec3 centre;
        float radius;
    };
    std::vector<Ball> balls;
    for (std::size_t i = 0; i < poses.size(); ++i) {
        const ExactDistance& mesh = bodies_[i].prototype->specimen.distance();
        const glm::vec3 centre(0.5 * (mesh.lower() + mesh.upper()));
        balls.push_back({poses[i].toWorld(centre), float(0.5 * glm::distance(mesh.lower(), mesh.upper()))});
    }
    std::vector<double> depths;
    const auto isNowhere = [](const Ball& ball) { return !std::isfinite(glm::length(ball.centre)); };
    if (std::any_of(balls.begin(), balls.end(), isNowhere)) return {std::numeric_limits<double>::infinity()};
    for (std::size_t i = 0; i < poses.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) {
            if (!bodies_[i].moves && !bodies_[j].moves) continue;
            if (glm::distance(balls[i].centre, balls[j].centre) > balls[i].radius + balls[j].radius) continue;
            const double depth =
                penetration(bodies_[i].prototype->specimen, poses[i], bodies_[j].prototype->specimen, poses[j]);
            if (depth > 0) depths.push_back(depth);
        }
    return depths;
}

Recording Stage::record(const View& view) const {
    Recording recording(outcome_.title);
    recording.view = view;
    recording.note("bodies", std::to_string(outcome_.bodies));
    recording.note("time per step", fmt::format("{:.1f} ms", outcome_.medianStep()));
    std::map<const BodyPrototype*, int> meshes;
    std::set<const BodyPrototype*> kinds;  // of dynamic bodies
    std::uint64_t triangles = 0, voxels = 0;
    for (const auto& [prototype, look, moves] : bodies_) {
        if (!meshes.contains(prototype.get())) meshes[prototype.get()] = recording.addMesh(prototype->mesh);
        if (moves && kinds.insert(prototype.get()).second) {
            triangles += prototype->mesh.triangles.size();
            voxels += prototype->field.activeVoxels();
        }
        recording.addBody(meshes[prototype.get()], look);
    }
    const std::string of = kinds.size() == 1 ? " each" : fmt::format(" in {} kinds", kinds.size());
    recording.note("triangles", grouped(triangles) + of);
    recording.note("voxels", grouped(voxels) + of);
    for (std::size_t i = 0; i < frames_.size(); ++i)
        recording.frame(double(i) * options_.stepsPerFrame / options_.stepsPerSecond, frames_[i]);
    return recording;
}

Outcome Stage::finish(const View& view) {
    std::vector<const std::vector<Pose>*> measured;
    for (std::size_t i = 0; i < frames_.size(); i += std::size_t(options_.framesPerMeasuring))
        measured.push_back(&frames_[i]);
    if (measured.back() != &frames_.back()) measured.push_back(&frames_.back());

    std::vector<std::vector<double>> depths(measured.size());
    tbb::parallel_for(std::size_t(0), measured.size(),
                      [&](std::size_t i) { depths[i] = penetrationsIn(*measured[i]); });
    for (const auto& frame : depths)
        outcome_.penetrations.insert(outcome_.penetrations.end(), frame.begin(), frame.end());
    std::sort(outcome_.penetrations.begin(), outcome_.penetrations.end());
    outcome_.recording = record(view);
    return std::move(outcome_);
}

Criterion sameBits(const Outcome& first, const std::function<Outcome()>& scene) {
    int differing = 0;
    for (const int threads : {1, 2, 8}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
        tbb::task_arena arena(threads);
        arena.execute([&] { differing += scene().fingerprint != first.fingerprint; });
    }
    return {"runs on 1, 2, 8 threads that differ", double(differing), 0};
}

}  // namespace bilayer::demo
