// Bunnies fall into a bowl and come to rest on each other, all of them colliding by their fields: bilayer's whole path
// from a mesh in a file to bodies in Bullet, and a start to copy from.
#include <fmt/core.h>

#include <tbb/global_control.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <glm/gtc/matrix_transform.hpp>
#include <numeric>
#include <optional>
#include <random>

#include "collider/collider.h"
#include "demos/shared/exact_distance.h"
#include "demos/shared/recording.h"
#include "demos/shared/shapes.h"
#include "demos/shared/world.h"
#include "sdf/build.h"
#include "sdf/inspect.h"
#include "sdf/mesh_io.h"
#include "sdf/vdb_io.h"

namespace {

using namespace bilayer;

constexpr const char* bunnyFile = "/usr/share/glmark2/models/bunny.obj";  // Debian's package glmark2-data
constexpr float bunnySize = 0.2f;                                         // its longest side [m]
constexpr float bowlRadius = 0.66f, bowlWall = 0.035f;                    // of the sphere that the bowl is cut from [m]
constexpr float bowlOpening = 1.05f;                                      // from the bottom to the rim [rad]
constexpr float bowlFoot = 0.2f;                                          // radius of its foot [m]
constexpr float bowlVoxels = 3;                                           // edge of its voxels [voxels of the bunny]

constexpr float stepsPerSecond = 240;
constexpr int stepsPerFrame = 4;    // 60 frames a second are recorded
constexpr int measuredFrames = 15;  // penetrations in motion are measured every so many frames
constexpr float restShown = 0.5f;   // how long the recording goes on when all is at rest [s]
constexpr int bodiesPerLayer = 5;
constexpr float layerHeight = 0.26f;  // between layers at the start: more than any bunny is long [m]
// at 6 m/s a bunny moves 16 of its voxels in one step: the bands must still hold it then [voxels]
constexpr float bunnyInteriorWidth = 20, bowlInteriorWidth = 6;

constexpr std::uint32_t bowlColour = 0xf1ebe1;
constexpr std::uint32_t bunnyColours[] = {0xc9694c, 0xdca94a, 0x7f9f80, 0x3f7f8c,
                                          0x6d8db8, 0xdba79b, 0xe9dcc3, 0x7a5a78};

struct Options {
    int bodies = 30, resolution = 128, threads = 0;
    float seconds = 15;
    std::filesystem::path out = "out";
};

// A thing that bodies are made of: what Bullet collides, and what measures whether it did.
struct Thing {
    std::string name;
    Mesh mesh;
    LevelSet field;
    std::shared_ptr<bullet::Shape> shape;
};

struct Simulation {
    std::vector<std::vector<Pose>> frames;  // the bowl first
    std::vector<double> stepSeconds;
    long contactsFound = 0, contactsKept = 0, beyondBand = 0;
    int pairs = 0, asleep = 0;
};

double secondsOf(const std::function<void()>& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// The bunny, upright along z; a knot where Debian's bunny is not installed.
std::pair<std::string, Mesh> readBunny() {
    if (!std::filesystem::exists(bunnyFile)) return {"knot", shapes::torusKnot(2, 3, 0.06f, 0.02f)};
    const Mesh mesh = readMesh(bunnyFile);
    const glm::mat4 smaller = glm::scale(glm::mat4(1), glm::vec3(bunnySize / bounds(mesh).longestSide()));
    return {"bunny", transformed(mesh, glm::rotate(smaller, glm::radians(90.f), glm::vec3(1, 0, 0)))};
}

// From a mesh to a shape for Bullet: this is all there is to it.
Thing makeThing(std::string name, Mesh mesh, float voxelSize, float interiorWidth) {
    BuildOptions options;
    options.voxelSize = voxelSize;
    options.interiorWidth = interiorWidth;
    LevelSet field = build(mesh, options);
    auto collider = std::make_shared<Collider>(mesh, field);
    auto shape =
        std::make_shared<bullet::Shape>(collider, bullet::ShapeOptions{.frame = bullet::centreOfMassFrame(*collider)});
    return {std::move(name), std::move(mesh), std::move(field), std::move(shape)};
}

// Layers above the bowl, each a ring turned against the one below, every bunny turned at random.
std::vector<Pose> startPoses(int count) {
    std::mt19937 random(7);
    std::normal_distribution<float> normal;
    std::vector<Pose> poses;
    for (int i = 0; i < count; ++i) {
        const int layer = i / bodiesPerLayer;
        const float turn = 6.2832f * float(i % bodiesPerLayer) / bodiesPerLayer + 0.6f * float(layer);
        const float x = normal(random), y = normal(random), z = normal(random), w = normal(random);
        poses.push_back({{0.26f * std::cos(turn), 0.26f * std::sin(turn), layerHeight * float(layer)},
                         glm::normalize(glm::quat(w, x, y, z))});
    }
    return poses;
}

Simulation simulate(const Thing& bowl, const Thing& bunny, const Options& options) {
    demo::World world;
    world.add(bowl.shape, {}, {});
    for (const Pose& pose : startPoses(options.bodies)) world.add(bunny.shape, {.mass = 1}, pose);

    Simulation result;
    result.frames.push_back(world.poses());
    int stepsLeft = int(options.seconds * stepsPerSecond), stepsOfRest = 0;
    while (stepsLeft-- > 0 && float(stepsOfRest) < restShown * stepsPerSecond) {
        result.stepSeconds.push_back(secondsOf([&] { world.step(1 / stepsPerSecond); }));
        const auto& statistics = world.statistics();
        result.pairs = std::max(result.pairs, statistics.pairs);
        result.contactsFound += statistics.contactsFound;
        result.contactsKept += statistics.contactsKept;
        result.beyondBand += statistics.beyondBand;
        if (result.stepSeconds.size() % stepsPerFrame == 0) result.frames.push_back(world.poses());
        stepsOfRest = world.asleep() == world.moving() ? stepsOfRest + 1 : 0;
    }
    result.asleep = world.asleep();
    return result;
}

// The deepest overlap of any two bodies, against the meshes themselves [m].
double deepestPenetration(const demo::Specimen& bowl, const demo::Specimen& bunny, const std::vector<Pose>& poses) {
    double deepest = 0;
    for (std::size_t i = 1; i < poses.size(); ++i) {
        deepest = std::max(deepest, demo::penetration(bowl, poses[0], bunny, poses[i]));
        for (std::size_t j = 1; j < i; ++j)
            deepest = std::max(deepest, demo::penetration(bunny, poses[i], bunny, poses[j]));
    }
    return deepest;
}

int inBowl(const std::vector<Pose>& poses) {
    return int(std::count_if(poses.begin() + 1, poses.end(),
                             [](const Pose& pose) { return glm::length(pose.position) < bowlRadius; }));
}

std::string grouped(std::uint64_t count) {
    std::string text = std::to_string(count);
    for (int i = int(text.size()) - 3; i > 0; i -= 3) text.insert(std::size_t(i), " ");
    return text;
}

void record(const Thing& bowl, const Thing& bunny, const Simulation& simulation, double meanMs,
            const Options& options) {
    demo::Recording recording(
        fmt::format("{} {} fall into a bowl", options.bodies, bunny.name + (options.bodies > 1 ? "s" : "")));
    recording.note("bodies", fmt::format("{} + bowl", options.bodies));
    recording.note("triangles", fmt::format("{} each", grouped(bunny.mesh.triangles.size())));
    recording.note("voxels", fmt::format("{} each", grouped(bunny.field.activeVoxels())));
    recording.note("time per step", fmt::format("{:.1f} ms", meanMs));
    recording.view = {.target = {0, 0, -0.42f},
                      .distance = 3.1f,
                      .azimuth = -1.35f,
                      .elevation = 0.7f,
                      .groundHeight = bounds(bowl.mesh).lower.z};

    recording.addBody(recording.addMesh(bowl.mesh), {.colour = bowlColour, .roughness = 0.4f, .clearcoat = 0.6f});
    const int mesh = recording.addMesh(bunny.mesh);
    for (int i = 0; i < options.bodies; ++i)
        recording.addBody(
            mesh,
            {.colour = bunnyColours[std::size_t(i) % std::size(bunnyColours)], .roughness = 0.5f, .clearcoat = 0.2f});
    for (std::size_t i = 0; i < simulation.frames.size(); ++i)
        recording.frame(double(i) * stepsPerFrame / stepsPerSecond, simulation.frames[i]);
    recording.write(options.out / "bowl.html");
}

void run(const Options& options) {
    std::filesystem::create_directories(options.out);
    std::optional<tbb::global_control> limit;
    if (options.threads > 0) limit.emplace(tbb::global_control::max_allowed_parallelism, std::size_t(options.threads));

    std::pair<std::string, Mesh> read;
    const double readSeconds = secondsOf([&] { read = readBunny(); });

    const float voxel = voxelSizeFor(read.second, float(options.resolution));
    std::optional<Thing> bunny, bowl;
    const double buildSeconds = secondsOf([&] {
        bunny = makeThing(read.first, read.second, voxel, bunnyInteriorWidth);
        bowl = makeThing("bowl", shapes::bowl(bowlRadius, bowlWall, 192, bowlOpening, bowlFoot), bowlVoxels * voxel,
                         bowlInteriorWidth);
    });
    writeVdb(options.out / (bunny->name + ".vdb"), bunny->field);

    Simulation simulation;
    const double simulateSeconds = secondsOf([&] { simulation = simulate(*bowl, *bunny, options); });
    const double steps = double(simulation.stepSeconds.size());
    const double meanMs =
        1e3 * std::accumulate(simulation.stepSeconds.begin(), simulation.stepSeconds.end(), 0.0) / steps;
    const double maxMs = 1e3 * *std::max_element(simulation.stepSeconds.begin(), simulation.stepSeconds.end());

    double atRest = 0, inMotion = 0;
    const double measureSeconds = secondsOf([&] {
        const demo::Specimen bowlSpecimen(bowl->mesh, voxel), bunnySpecimen(bunny->mesh, voxel);
        for (std::size_t i = 0; i < simulation.frames.size(); i += measuredFrames)
            inMotion = std::max(inMotion, deepestPenetration(bowlSpecimen, bunnySpecimen, simulation.frames[i]));
        atRest = deepestPenetration(bowlSpecimen, bunnySpecimen, simulation.frames.back());
    });
    const double recordSeconds = secondsOf([&] { record(*bowl, *bunny, simulation, meanMs, options); });

    const MeshReport report = inspect(bunny->mesh);
    const double recorded = double(simulation.frames.size() - 1) * stepsPerFrame / stepsPerSecond;
    const auto row = [](const char* label, const std::string& value) { fmt::print("  {:<34}{}\n", label, value); };
    const auto depth = [&](double d) { return fmt::format("{:.2f} mm = {:.2f} voxels", 1e3 * d, d / voxel); };
    fmt::print("{} {} fall into a bowl\n", options.bodies, bunny->name);
    row("mesh", fmt::format("{} triangles, {}", grouped(report.triangles),
                            report.closed() && report.oriented() ? "closed" : "not closed"));
    row("field", fmt::format("{} voxels of {:.2f} mm, {:.1f} MB", grouped(bunny->field.activeVoxels()), 1e3 * voxel,
                             1e-6 * double(bunny->field.memoryBytes())));
    row("field of the bowl",
        fmt::format("{} voxels of {:.2f} mm", grouped(bowl->field.activeVoxels()), 1e3 * bowl->field.voxelSize()));
    fmt::print("phase\n");
    row("read", fmt::format("{:.2f} s", readSeconds));
    row("build two fields", fmt::format("{:.2f} s", buildSeconds));
    row("simulate", fmt::format("{:.2f} s for {:.2f} s", simulateSeconds, recorded));
    row("measure", fmt::format("{:.2f} s", measureSeconds));
    row("record", fmt::format("{:.2f} s", recordSeconds));
    fmt::print("step of {:.2f} ms\n", 1e3 / stepsPerSecond);
    row("time", fmt::format("{:.2f} ms mean, {:.2f} ms at most", meanMs, maxMs));
    row("contacts", fmt::format("{:.0f} found, {:.0f} kept, mean", double(simulation.contactsFound) / steps,
                                double(simulation.contactsKept) / steps));
    row("points beyond the band", grouped(std::uint64_t(simulation.beyondBand)));
    fmt::print("at the end\n");
    row("asleep", fmt::format("{} of {}", simulation.asleep, options.bodies));
    row("in the bowl", fmt::format("{} of {}", inBowl(simulation.frames.back()), options.bodies));
    row("deepest penetration", depth(atRest));
    row("deepest penetration in motion", depth(inMotion));
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    CLI::App app("Bunnies fall into a bowl, colliding by their fields");
    app.add_option("--bodies", options.bodies, "how many bunnies")->check(CLI::Range(1, 1000))->capture_default_str();
    app.add_option("--seconds", options.seconds, "most seconds to simulate")
        ->check(CLI::Range(0.1, 1000.0))
        ->capture_default_str();
    app.add_option("--resolution", options.resolution, "voxels along a bunny")
        ->check(CLI::Range(16, 1024))
        ->capture_default_str();
    app.add_option("--threads", options.threads, "most threads to use; 0: all")
        ->check(CLI::Range(0, 1024))
        ->capture_default_str();
    app.add_option("--out", options.out, "folder for the results")->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        run(options);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bowl: {}\n", error.what());
        return 1;
    }
    return 0;
}
