#include "demos/scenes/pegs.h"

#include <fmt/core.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <limits>

#include "collider/mass.h"
#include "demos/shared/machines.h"
#include "demos/shared/stage.h"

namespace bilayer::demo {
namespace {

constexpr float density = 7850;    // of steel [kg/m^3]
constexpr float lane = 40e-3f;     // between blocks [m]
constexpr float above = 0.5e-3f;   // the block's mouth, at the start [m]
constexpr float margin = 0.1e-3f;  // of contacts [m]
constexpr float down = 0.1f;       // above the floor at most [voxels]
constexpr int framesPerMeasuring = 4;

constexpr Look blockLook{.colour = 0x9db4d6, .roughness = 0.3f, .opacity = 0.5f};
constexpr Look pegLook{.colour = 0xe07a5f, .roughness = 0.35f, .metalness = 0.3f};

// A peg and the block that it belongs into.
struct Lane {
    float clearance;
    std::shared_ptr<const Thing> block, peg;
    std::size_t blockIndex, pegIndex;  // in a frame
};

// With its lower end above the mouth, aside of the hole's axis, and turned about that end.
Pose startOf(const shapes::Peg& part, float mouth, const PegsOptions& options) {
    const glm::quat turn = glm::angleAxis(glm::radians(options.tilt), glm::normalize(glm::vec3(1, 2, 0)));
    const glm::vec3 end(part.clearance / 2 + options.aside, 0, mouth + above);
    return {end + turn * glm::vec3(0, 0, part.length / 2), turn};
}

// The height of the lowest point of its lower end: where there is play, pegs lean.
float lowestOf(const Lane& lane, const Pose& pose) {
    const shapes::Peg part{.clearance = lane.clearance};
    const glm::vec3 axis = pose.rotation * glm::vec3(0, 0, 1);
    const float radius = (part.diameter - part.clearance) / 2 - part.chamfer;
    return pose.position.z - axis.z * part.length / 2 - radius * glm::length(glm::vec2(axis));
}

// In parts of half the clearance, in any frame that is measured.
double deepestOf(const Lane& lane, const std::vector<std::vector<Pose>>& frames) {
    double deepest = 0;
    for (std::size_t i = 0; i < frames.size(); i += framesPerMeasuring)
        deepest = penetration(lane.peg->specimen, frames[i][lane.pegIndex], lane.block->specimen,
                              frames[i][lane.blockIndex], deepest);
    return 2 * deepest / double(lane.clearance);
}

}  // namespace

Outcome pegs(const PegsOptions& options) {
    Stage stage("Pegs in holes", {.stepsPerSecond = options.stepsPerSecond, .framesPerMeasuring = framesPerMeasuring});
    stage.world().bullet().getSolverInfo().m_numIterations = options.iterations;
    const ThingOptions things{.voxelSize = options.voxelSize, .margin = margin, .exact = true};
    const shapes::HoledBlock blockPart;
    const auto block = makeThing(shapes::holedBlock(blockPart), things);
    const float mouth = blockPart.height / 2, floor = blockPart.floor - mouth;

    std::vector<Lane> lanes;
    for (std::size_t i = 0; i < options.clearances.size(); ++i) {
        const shapes::Peg part{.clearance = options.clearances[i]};
        const auto peg = makeThing(shapes::peg(part), things);
        const glm::vec3 place(lane * (float(i) - 0.5f * float(options.clearances.size() - 1)), 0, 0);
        Pose pose = startOf(part, mouth, options);
        pose.position += place;
        stage.add(block, {.friction = 1}, {place}, blockLook);
        const float mass = density * float(massProperties(peg->mesh).volume);
        btRigidBody& body = stage.add(
            peg, {.mass = mass, .friction = options.friction, .linearDamping = 0, .angularDamping = 0}, pose, pegLook);
        body.setActivationState(DISABLE_DEACTIVATION);
        lanes.push_back({part.clearance, block, peg, 2 * i, 2 * i + 1});
    }
    const auto isDown = [&](const Lane& each) {
        return lowestOf(each, stage.world().poses()[each.pegIndex]) < floor + down * options.voxelSize;
    };
    std::vector<double> times(lanes.size(), std::numeric_limits<double>::infinity());
    stage.run(options.seconds, [&] {
        for (std::size_t i = 0; i < lanes.size(); ++i)
            if (isDown(lanes[i])) times[i] = std::min(times[i], stage.time());
        return false;
    });

    const auto missing = std::count_if(lanes.begin(), lanes.end(), [&](const Lane& each) { return !isDown(each); });
    double deepest = 0;
    std::string depths, arrivals;
    for (std::size_t i = 0; i < lanes.size(); ++i) {
        const double depth = deepestOf(lanes[i], stage.frames());
        deepest = worse(deepest, depth);
        const float gap = 1e3f * lanes[i].clearance;
        depths += fmt::format("{}{:.3f} at {:g} mm", i > 0 ? ", " : "", depth, gap);
        arrivals += fmt::format("{}{:.2f} at {:g} mm", i > 0 ? ", " : "", times[i], gap);
    }
    Outcome outcome = stage.finish({.target = {0, 0, mouth},
                                    .distance = lane * float(lanes.size() + 1),
                                    .elevation = 0.35f,
                                    .groundHeight = -mouth});
    outcome.facts = {{"down after [s]", arrivals}, {"deepest [half clearances]", depths}};
    outcome.criteria = {{"pegs that are not down", double(missing), 0},
                        {"deepest penetration", deepest, 1, "half clearances"}};
    return outcome;
}

}  // namespace bilayer::demo
