// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/rings.h"

#include <fmt/core.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"

namespace bilayer::demo {
namespace {

constexpr float major = 0.12f, minor = 0.03f;  // of a ring's circle and tube [m]
constexpr float poleRadius = 0.05f;            // [m]
constexpr float spacing = 0.36f;               // between poles: rings on neighbouring poles can touch [m]
constexpr float apart = 0.1f;                  // initial separation of rings [m]
constexpr float maxTilt = 0.1f;                // initial tilt of rings: neighbours do not touch [rad]
constexpr float maxShift = 0.02f;              // initial horizontal offset of rings [m]
constexpr float halfFloor = 0.06f;             // thickness [m]
constexpr float coarse = 2;                    // edge of the floor's voxels [voxels of the rings]
constexpr int framesPerMeasuring = 10;         // because a thousand rings have thousands of pairs

constexpr Look poleLook{.colour = 0x35506b, .roughness = 0.4f, .clearcoat = 0.4f}, floorLook{.colour = 0xcfd6dd};
constexpr std::uint32_t ringColours[] = {0xe07a5f, 0xf2cc8f, 0x81b29a, 0xf4f1de, 0x9db4d6, 0xc9b1d9};

glm::vec2 placeOf(int pole, int rows) {
    return spacing * (glm::vec2(pole % rows, pole / rows) - 0.5f * float(rows - 1));
}

// Where a ring is: around its pole, around the pole's axis above its top, or off the pole.
enum class Place { on, over, off };

Place placeOf(const Pose& ring, const glm::vec2& pole, float top) {
    const glm::vec3 axis = ring.rotation * glm::vec3(0, 0, 1), aside = glm::vec3(pole, ring.position.z) - ring.position;
    // intersection of the pole's axis with the ring's plane; none if they are parallel
    if (std::abs(axis.z) < 1e-3f) return ring.position.z + major > top ? Place::over : Place::off;
    const float rise = -glm::dot(aside, axis) / axis.z;
    const float crossing = ring.position.z + rise;
    if (crossing > top && ring.position.z + major > top) return Place::over;
    return crossing > 0 && crossing < top && glm::length(aside + glm::vec3(0, 0, rise)) < major ? Place::on
                                                                                                : Place::off;
}

struct Threading {
    int lost = 0, over = 0;  // rings that came off below the top; rings that left over the top
};

Threading threading(const std::vector<std::vector<Pose>>& frames, std::size_t firstRing, const RingsOptions& options,
                    float top) {
    Threading result;
    for (std::size_t i = firstRing; i < frames.front().size(); ++i) {
        const glm::vec2 pole = placeOf(int(i - firstRing) / options.ringsPerPole, options.rows);
        Place place = Place::on;
        for (const auto& poses : frames) {
            const Place now = placeOf(poses[i], pole, top);
            if (place == Place::on || now == Place::on) place = now;
            if (place == Place::off) break;
        }
        result.lost += place == Place::off;
        result.over += place == Place::over;
    }
    return result;
}

Pose startOf(int index, const glm::vec2& pole, std::mt19937& random) {
    std::uniform_real_distribution<float> side(-1, 1);
    const float shiftX = side(random), shiftY = side(random), tiltX = side(random), tiltY = side(random);
    const glm::vec3 tilt = 0.7f * maxTilt * glm::vec3(tiltX, tiltY, 0);
    const glm::vec3 position(pole + 0.7f * maxShift * glm::vec2(shiftX, shiftY), apart * (float(index) + 1));
    return {position, glm::normalize(glm::quat(1, 0.5f * tilt.x, 0.5f * tilt.y, 0))};
}

}  // namespace

Outcome rings(const RingsOptions& options) {
    const int poles = options.rows * options.rows;
    const float top = apart * float(options.ringsPerPole + 2);
    const float halfSide = 0.5f * spacing * float(options.rows) + major;
    Stage stage(
        fmt::format("{} rings on {} poles", poles * options.ringsPerPole, poles),
        {.stepsPerSecond = options.stepsPerSecond, .stepsPerFrame = 8, .framesPerMeasuring = framesPerMeasuring});
    stage.world().bullet().getSolverInfo().m_numIterations = options.iterations;
    const auto ground = makePrototype(shapes::box({halfSide, halfSide, halfFloor}), {coarse * options.voxelSize});
    const auto pole = makePrototype(shapes::cylinder(poleRadius, top, 48), {options.voxelSize});
    const auto ring = makePrototype(shapes::torus(major, minor, 48, 20), {options.voxelSize});

    stage.add(ground, {}, {{0, 0, -halfFloor}}, floorLook);
    for (int i = 0; i < poles; ++i) stage.add(pole, {}, {{placeOf(i, options.rows), top / 2}}, poleLook);
    std::mt19937 random(options.seed);
    for (int i = 0; i < poles; ++i)
        for (int k = 0; k < options.ringsPerPole; ++k)
            stage.add(
                ring, {.mass = 1}, startOf(k, placeOf(i, options.rows), random),
                {.colour = ringColours[std::size_t(k) % std::size(ringColours)], .roughness = 0.4f, .clearcoat = 0.3f});

    stage.run(options.seconds, [&] { return stage.allAsleep(); });
    const int awake = stage.world().moving() - stage.world().asleep();
    const Threading threaded = threading(stage.frames(), std::size_t(poles) + 1, options, top);
    const double time = stage.time();

    Outcome outcome =
        stage.finish({.target = {0, 0, 0.3f * top}, .distance = 1.5f * top + 2 * halfSide, .elevation = 0.4f});
    outcome.facts = {
        {"left over the top", std::to_string(threaded.over)},
        {"all asleep after", awake > 0 ? fmt::format("not in {:.0f} s", time) : fmt::format("{:.1f} s", time)}};
    outcome.criteria = {{"rings off their poles", double(threaded.lost), 0},
                        {"rings still awake", double(awake), 0},
                        {"deepest penetration", outcome.deepest() / options.voxelSize, 1, "voxels"}};
    return outcome;
}

}  // namespace bilayer::demo
