// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/pegs.h"

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <fmt/core.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <limits>

#include <bilayer/collider/mass.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/machines.h"
#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"

namespace bilayer::demo {
namespace {

constexpr float density = 7850;    // of steel [kg/m^3]
constexpr float lane = 40e-3f;     // between blocks [m]
constexpr float above = 0.5e-3f;   // initial height above the block's mouth [m]
constexpr float margin = 0.1e-3f;  // contact margin [m]
constexpr float down = 0.1f;       // max height above the floor [voxels]
constexpr int framesPerMeasuring = 4;

constexpr const char *factoryPeg = "factory_round_peg_8mm_tight.obj",
                     *factoryPlate = "factory_round_hole_8mm_subdiv_3x.obj";
constexpr float factoryClearance = 0.1e-3f;  // radius of 4.048 mm between the plate's corners, and 3.9975 mm of the peg
// The plate's hole has no chamfer, so the initial tilt is smaller.
constexpr float factoryTilt = 0.1f;      // [degrees]
constexpr float tableThickness = 5e-3f;  // [m]

constexpr Look blockLook{.colour = 0x9db4d6, .roughness = 0.3f, .opacity = 0.5f};
constexpr Look pegLook{.colour = 0xe07a5f, .roughness = 0.35f, .metalness = 0.3f};

// A peg and its block.
struct Lane {
    std::string name;
    float clearance;
    std::shared_ptr<const BodyPrototype> block, peg;
    float mouth;                           // z of the hole's opening [m]
    float offset, tilt;                    // initial, see PegsOptions
    std::size_t blockIndex{}, pegIndex{};  // index in a frame
};

// Returns a pose with the lower end above the opening, offset from the hole's axis, and tilted about that end.
Pose startOf(const shapes::Peg& part, float mouth, float offset, float tilt) {
    const glm::quat rotation = glm::angleAxis(glm::radians(tilt), glm::normalize(glm::vec3(1, 2, 0)));
    const glm::vec3 end(part.clearance / 2 + offset, 0, mouth + above);
    return {end + rotation * glm::vec3(0, 0, part.length / 2), rotation};
}

// Returns the height of the lowest point of its lower end: pegs lean within their play.
float lowestOf(const Lane& lane, const Pose& pose) {
    const shapes::Peg part{.clearance = lane.clearance};
    const glm::vec3 axis = pose.rotation * glm::vec3(0, 0, 1);
    const float radius = (part.diameter - part.clearance) / 2 - part.chamfer;
    return pose.position.z - axis.z * part.length / 2 - radius * glm::length(glm::vec2(axis));
}

// Returns the max penetration in any measured frame, relative to half the clearance.
double deepestOf(const Lane& lane, const std::vector<std::vector<Pose>>& frames) {
    double deepest = 0;
    for (std::size_t i = 0; i < frames.size(); i += framesPerMeasuring)
        deepest = penetration(lane.peg->specimen, frames[i][lane.pegIndex], lane.block->specimen,
                              frames[i][lane.blockIndex], deepest);
    return 2 * deepest / double(lane.clearance);
}

}  // namespace

bool hasFactoryPeg(const std::filesystem::path& folder) {
    return std::filesystem::exists(folder / factoryPeg) && std::filesystem::exists(folder / factoryPlate);
}

Outcome pegs(const PegsOptions& options) {
    Stage stage("Pegs in holes", {.stepsPerSecond = options.stepsPerSecond, .framesPerMeasuring = framesPerMeasuring});
    stage.world().bullet().getSolverInfo().m_numIterations = options.iterations;
    const PrototypeOptions prototypeOptions{
        .voxelSize = options.voxelSize, .margin = margin, .accuracy = ContactAccuracy::exact};
    const shapes::HoledBlock blockPart;
    const auto block = makePrototype(shapes::holedBlock(blockPart), prototypeOptions);
    const float mouth = blockPart.height / 2, floor = blockPart.floor - mouth;

    std::vector<Lane> lanes;
    for (const float clearance : options.clearances)
        lanes.push_back({fmt::format("{:g} mm", 1e3f * clearance), clearance, block,
                         makePrototype(shapes::peg({.clearance = clearance}), prototypeOptions), mouth, options.offset,
                         options.tilt});
    std::shared_ptr<const BodyPrototype> table;
    if (!options.factory.empty()) {
        const Mesh plate = shapes::moved(readMesh(options.factory / factoryPlate), {0, 0, floor});
        const Mesh peg = shapes::moved(readMesh(options.factory / factoryPeg), {0, 0, -shapes::Peg{}.length / 2});
        lanes.push_back({"Factory", factoryClearance, makePrototype(plate, prototypeOptions),
                         makePrototype(peg, prototypeOptions), bounds(plate).upper.z, 0, factoryTilt});
        const glm::vec3 half(blockPart.width / 2, blockPart.width / 2, tableThickness / 2);
        table = makePrototype(shapes::box(half), std::make_shared<btBoxShape>(btVector3(half.x, half.y, half.z)),
                              options.voxelSize);
    }
    for (std::size_t i = 0; i < lanes.size(); ++i) {
        Lane& each = lanes[i];
        const glm::vec3 place(lane * (float(i) - 0.5f * float(lanes.size() - 1)), 0, 0);
        Pose pose = startOf({.clearance = each.clearance}, each.mouth, each.offset, each.tilt);
        pose.position += place;
        each.blockIndex = 2 * i;
        each.pegIndex = 2 * i + 1;
        stage.add(each.block, {.friction = 1}, {place}, blockLook);
        const float mass = density * float(massProperties(each.peg->mesh).volume);
        btRigidBody& body =
            stage.add(each.peg, {.mass = mass, .friction = options.friction, .linearDamping = 0, .angularDamping = 0},
                      pose, pegLook);
        body.setActivationState(DISABLE_DEACTIVATION);
        if (i + 1 == lanes.size() && table)
            stage.add(table, {.friction = 1}, {place + glm::vec3(0, 0, floor - tableThickness / 2)}, blockLook);
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
        depths += fmt::format("{}{:.3f} at {}", i > 0 ? ", " : "", depth, lanes[i].name);
        arrivals += fmt::format("{}{:.2f} at {}", i > 0 ? ", " : "", times[i], lanes[i].name);
    }
    Outcome outcome = stage.finish({.target = {0, 0, mouth},
                                    .distance = lane * float(lanes.size() + 2),
                                    .elevation = 0.35f,
                                    .groundHeight = -mouth});
    outcome.facts = {{"down after [s]", arrivals}, {"deepest [half clearances]", depths}};
    outcome.criteria = {{"pegs that are not down", double(missing), 0},
                        {"deepest penetration", deepest, 1, "half clearances"}};
    return outcome;
}

}  // namespace bilayer::demo
