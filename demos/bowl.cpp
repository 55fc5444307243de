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
constexpr int measuredFrames = 30;  // penetrations in motion are measured every so many frames
constexpr float restShown = 0.5f;   // how long the recording goes on when all is at rest [s]
constexpr int bodiesPerLayer = 5;
constexpr float layerHeight = 0.26f;  // between layers at the start: more than any bunny is long [m]
// between surface points; the finest part of a bunny, its ears, is 8 of its voxels thick [voxels of the body's own]
constexpr float bunnySpacing = 4, bowlSpacing = 2;
// at 6 m/s a bunny moves 16 of its voxels in one step: the bands must still hold it then [voxels]
constexpr float bunnyInteriorWidth = 20, bowlInteriorWidth = 6;

constexpr std::uint32_t bowlColour = 0x35506b;
constexpr std::uint32_t bunnyColours[] = {0xe07a5f, 0xf2cc8f, 0x81b29a, 0xf4f1de,
                                          0x9db4d6, 0xe8a598, 0xc9b1d9, 0x7fb7be};

struct Options {
    int bodies = 30, resolution = 128, threads = 0;
    float seconds = 15;
    std::filesystem::path out = "out";
};

// A thing that bodies are made of: what Bullet collides, and what measures whether it did.
struct Thing {
    Mesh mesh;
    LevelSet field;
    std::shared_ptr<bullet::Shape> shape;
};

using Phases = std::vector<std::pair<const char*, double>>;  // what was done, and the seconds that it took

struct Run {
    std::vector<std::vector<Pose>> frames;  // the bowl first
    std::vector<double> stepMs;
    long contactsFound = 0, contactsKept = 0, beyondBand = 0;  // sums over all steps
    int asleep = 0, inBowl = 0;                                // at the end
    double penetrationAtRest = 0, penetrationInMotion = 0;     // [m]

    double meanStep() const { return std::accumulate(stepMs.begin(), stepMs.end(), 0.0) / double(stepMs.size()); }
};

double secondsOf(const std::function<void()>& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// The bunny, upright along z; a knot where Debian's bunny is not installed.
std::pair<std::string, Mesh> readBunny() {
    if (!std::filesystem::exists(bunnyFile)) return {"knots", shapes::torusKnot(2, 3, 0.06f, 0.02f)};
    const Mesh mesh = readMesh(bunnyFile);
    const glm::mat4 smaller = glm::scale(glm::mat4(1), glm::vec3(bunnySize / bounds(mesh).longestSide()));
    return {"bunnies", transformed(mesh, glm::rotate(smaller, glm::radians(90.f), glm::vec3(1, 0, 0)))};
}

// From a mesh to a shape for Bullet: this is all there is to it.
Thing makeThing(Mesh mesh, float voxelSize, float interiorWidth, float spacing) {
    BuildOptions options;
    options.voxelSize = voxelSize;
    options.interiorWidth = interiorWidth;
    LevelSet field = build(mesh, options);
    auto collider = std::make_shared<Collider>(mesh, field, ColliderOptions{spacing});
    bullet::ShapeOptions centred{.frame = bullet::centreOfMassFrame(*collider)};
    return {std::move(mesh), std::move(field), std::make_shared<bullet::Shape>(collider, centred)};
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

Run simulate(const Thing& bowl, const Thing& bunny, const Options& options) {
    demo::World world;
    world.add(bowl.shape, {}, {});
    for (const Pose& pose : startPoses(options.bodies)) world.add(bunny.shape, {.mass = 1}, pose);

    Run run;
    run.frames.push_back(world.poses());
    int stepsLeft = int(options.seconds * stepsPerSecond), stepsOfRest = 0;
    while (stepsLeft-- > 0 && float(stepsOfRest) < restShown * stepsPerSecond) {
        run.stepMs.push_back(1e3 * secondsOf([&] { world.step(1 / stepsPerSecond); }));
        run.contactsFound += world.statistics().contactsFound;
        run.contactsKept += world.statistics().contactsKept;
        run.beyondBand += world.statistics().beyondBand;
        if (run.stepMs.size() % stepsPerFrame == 0) run.frames.push_back(world.poses());
        stepsOfRest = world.asleep() == world.moving() ? stepsOfRest + 1 : 0;
    }
    run.asleep = world.asleep();
    return run;
}

// The deepest overlap of any two bodies, against the meshes themselves, if deeper than `least` [m].
double penetration(const demo::Specimen& bowl, const demo::Specimen& bunny, const std::vector<Pose>& poses,
                   double least) {
    for (std::size_t i = 1; i < poses.size(); ++i) {
        least = demo::penetration(bowl, poses[0], bunny, poses[i], least);
        for (std::size_t j = 1; j < i; ++j) least = demo::penetration(bunny, poses[i], bunny, poses[j], least);
    }
    return least;
}

void measure(const Thing& bowl, const Thing& bunny, Run& run) {
    const double spacing = 2 * bunny.field.voxelSize();
    const demo::Specimen bowlSpecimen(bowl.mesh, spacing), bunnySpecimen(bunny.mesh, spacing);
    run.penetrationAtRest = penetration(bowlSpecimen, bunnySpecimen, run.frames.back(), 0);
    run.penetrationInMotion = run.penetrationAtRest;
    for (std::size_t i = 0; i < run.frames.size(); i += measuredFrames)
        run.penetrationInMotion = penetration(bowlSpecimen, bunnySpecimen, run.frames[i], run.penetrationInMotion);
    for (std::size_t i = 1; i < run.frames.back().size(); ++i)
        run.inBowl += glm::length(run.frames.back()[i].position) < bowlRadius;
}

std::string grouped(std::uint64_t count) {
    std::string text = std::to_string(count);
    for (int i = int(text.size()) - 3; i > 0; i -= 3) text.insert(std::size_t(i), " ");
    return text;
}

void record(const Thing& bowl, const Thing& bunny, const Run& run, const std::string& title, const Options& options) {
    demo::Recording recording(title);
    recording.note("bodies", fmt::format("{} + bowl", options.bodies));
    recording.note("triangles", grouped(bunny.mesh.triangles.size()) + " each");
    recording.note("voxels", grouped(bunny.field.activeVoxels()) + " each");
    recording.note("time per step", fmt::format("{:.1f} ms", run.meanStep()));
    recording.view = {.target = {0, 0, -0.44f},
                      .distance = 2.75f,
                      .azimuth = -1.35f,
                      .elevation = 0.74f,
                      .groundHeight = bounds(bowl.mesh).lower.z};

    recording.addBody(recording.addMesh(bowl.mesh), {.colour = bowlColour, .roughness = 0.45f, .clearcoat = 0.6f});
    const int mesh = recording.addMesh(bunny.mesh);
    for (int i = 0; i < options.bodies; ++i)
        recording.addBody(
            mesh,
            {.colour = bunnyColours[std::size_t(i) % std::size(bunnyColours)], .roughness = 0.55f, .clearcoat = 0.12f});
    for (std::size_t i = 0; i < run.frames.size(); ++i)
        recording.frame(double(i) * stepsPerFrame / stepsPerSecond, run.frames[i]);
    recording.write(options.out / "bowl.html");
}

void row(const char* label, const std::string& value) {
    fmt::print("  {:<32}{}\n", label, value);
}

void printTable(const Thing& bowl, const Thing& bunny, const Run& run, const Phases& phases, const Options& options) {
    const double voxel = bunny.field.voxelSize(), steps = double(run.stepMs.size());
    const auto field = [](const LevelSet& f) {
        return fmt::format("{} voxels of {:.2f} mm, {:.1f} MB", grouped(f.activeVoxels()), 1e3 * f.voxelSize(),
                           1e-6 * double(f.memoryBytes()));
    };
    const auto depth = [&](double d) { return fmt::format("{:.2f} mm = {:.2f} voxels", 1e3 * d, d / voxel); };
    const MeshReport report = inspect(bunny.mesh);
    row("mesh", fmt::format("{} triangles, {}", grouped(report.triangles),
                            report.closed() && report.oriented() ? "closed" : "NOT closed"));
    row("field", field(bunny.field));
    row("field of the bowl", field(bowl.field));
    for (const auto& [name, seconds] : phases) row(name, fmt::format("{:.2f} s", seconds));
    row("simulated", fmt::format("{:.2f} s in {:.0f} steps", steps / stepsPerSecond, steps));
    row("a step", fmt::format("{:.2f} ms, at most {:.2f} ms", run.meanStep(),
                              *std::max_element(run.stepMs.begin(), run.stepMs.end())));
    row("contacts a step",
        fmt::format("{:.0f} found, {:.0f} kept", double(run.contactsFound) / steps, double(run.contactsKept) / steps));
    row("points too deep for the band", grouped(std::uint64_t(run.beyondBand)));
    row("asleep", fmt::format("{} of {}", run.asleep, options.bodies));
    row("in the bowl", fmt::format("{} of {}", run.inBowl, options.bodies));
    row("deepest penetration", depth(run.penetrationAtRest) + ", by the meshes");
    row("deepest while moving", depth(run.penetrationInMotion) + ", by the meshes");
}

void runDemo(const Options& options) {
    std::filesystem::create_directories(options.out);
    std::optional<tbb::global_control> limit;
    if (options.threads > 0) limit.emplace(tbb::global_control::max_allowed_parallelism, std::size_t(options.threads));

    Phases phases;
    const auto phase = [&](const char* name, const std::function<void()>& work) {
        phases.emplace_back(name, secondsOf(work));
    };
    std::pair<std::string, Mesh> read;
    std::optional<Thing> bunny, bowl;
    Run run;
    phase("read the mesh", [&] { read = readBunny(); });
    const auto& [name, mesh] = read;
    const std::string title = fmt::format("{} {} in a bowl", options.bodies, name);
    fmt::print("{}\n", title);

    const float voxel = voxelSizeFor(mesh, float(options.resolution));
    phase("build both fields", [&] {
        bunny = makeThing(mesh, voxel, bunnyInteriorWidth, bunnySpacing);
        bowl = makeThing(shapes::bowl(bowlRadius, bowlWall, 192, bowlOpening, bowlFoot), bowlVoxels * voxel,
                         bowlInteriorWidth, bowlSpacing);
    });
    phase("simulate", [&] { run = simulate(*bowl, *bunny, options); });
    phase("measure", [&] { measure(*bowl, *bunny, run); });
    phase("write", [&] {
        writeVdb(options.out / (name == "bunnies" ? "bunny.vdb" : "knot.vdb"), bunny->field);
        record(*bowl, *bunny, run, title, options);
    });
    printTable(*bowl, *bunny, run, phases, options);
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
    try {
        app.parse(argc, argv);
        runDemo(options);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 2;
    } catch (const std::exception& error) {
        fmt::print(stderr, "bowl: {}\n", error.what());
        return 1;
    }
    return 0;
}
