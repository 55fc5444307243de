// SPDX-License-Identifier: Apache-2.0
// `bilayer seed`: combines meshes and fields into one liquid level set, optionally with marker particles.
// Tested by tests/tools/seed.cpp through the program.
#include <fmt/format.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include <bilayer/collider/mass.h>
#include <bilayer/integration/fluid/particles.h>
#include <bilayer/integration/fluid/seed.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "collider/contact/body/body.h"
#include "integration/fluid/detail/liquid_copy.h"
#include "sdf/base/openvdb.h"
#include "sdf/leaf/build_options.h"
#include "tools/commands.h"
#include "tools/output.h"

namespace bilayer::tools {
namespace {

struct SeedArguments {
    std::vector<std::filesystem::path> inputs;
    std::filesystem::path output, into;
    float voxelSize = 0, resolution = 0, halfWidth = 3;
    std::vector<double> translate{0, 0, 0};
    std::vector<float> rotate{0, 0, 1, 0}, scale{1};
    std::string mode = "unite";
    bool uniteSolids = true;
    fluid::ParticleOptions particles;
    bool json = false;
    CLI::Option* particlesGiven = nullptr;
};

using Input = std::variant<Mesh, LevelSet>;

glm::dvec3 originOf(const Input& input) {
    if (const auto* mesh = std::get_if<Mesh>(&input)) return mesh->origin;
    return std::get<LevelSet>(input).origin();
}

bool isVdb(const std::filesystem::path& path) {
    return path.extension() == ".vdb";
}

fluid::Placement makePlacement(const SeedArguments& a) {
    const glm::vec3 axis(a.rotate[0], a.rotate[1], a.rotate[2]);
    const float length = glm::length(axis);
    if (!(length > 0) || !std::isfinite(length)) throw CLI::ValidationError("--rotate", "the axis has no direction");
    if (a.scale.size() == 2) throw CLI::ValidationError("--scale", "needs one number or three");
    const glm::vec3 scale = a.scale.size() == 1 ? glm::vec3(a.scale[0]) : glm::vec3(a.scale[0], a.scale[1], a.scale[2]);
    return {{glm::vec3(glm::dvec3(a.translate[0], a.translate[1], a.translate[2])),
             glm::angleAxis(a.rotate[3], axis / length)},
            scale};
}

fluid::SeedMode makeMode(const std::string& word) {
    if (word == "intersect") return fluid::SeedMode::intersect;
    return word == "subtract" ? fluid::SeedMode::subtract : fluid::SeedMode::unite;
}

void requireUsage(const SeedArguments& a) {
    if (a.into.empty() && a.mode != "unite") throw CLI::ValidationError("--mode " + a.mode, "needs --into");
    for (const auto& input : a.inputs) requireOther(a.output, input);
    if (!a.into.empty() || a.voxelSize > 0 || a.resolution > 0) {
        if (a.resolution > 0 && isVdb(a.inputs.front()))
            throw CLI::ValidationError("--resolution", "needs a mesh as the first input");
        return;
    }
    if (!isVdb(a.inputs.front()))
        throw CLI::ValidationError("seed", "a mesh needs one of --voxel-size, --resolution and --into");
}

// Returns what a placement in floats loses of a large translation. Distant meshes absorb it before they are scaled and
// rotated.
glm::dvec3 remainder(const SeedArguments& a, const fluid::Placement& placement) {
    const glm::dvec3 left =
        glm::dvec3(a.translate[0], a.translate[1], a.translate[2]) - glm::dvec3(placement.pose.position);
    return glm::inverse(glm::dquat(placement.pose.rotation)) * left / glm::dvec3(placement.scale);
}

Input read(const std::filesystem::path& path, const glm::dvec3& moved, ReadReport& file) {
    if (isVdb(path)) return detail::readStored(path).levelSet;
    auto [mesh, contents] = readMeshFile(path);
    file = std::move(contents);
    if (mesh.origin != glm::dvec3(0)) mesh.origin += moved;
    return mesh;
}

// Returns a position rounded to whole voxels: the origin of a liquid there.
glm::dvec3 wholeVoxels(const glm::dvec3& place, double voxelSize) {
    return voxelSize * glm::round(place / voxelSize);
}

// Returns the initial liquid relative to its origin, which is in its metadata if it is not zero.
openvdb::FloatGrid::Ptr startingLiquid(const SeedArguments& a, const Input& first, const fluid::Placement& placement) {
    openvdb::initialize();
    if (!a.into.empty()) return fluid::detail::liquidCopy(detail::readStored(a.into).levelSet);
    float voxelSize = a.voxelSize;
    if (a.resolution > 0)
        voxelSize =
            voxelSizeFor(transformed(std::get<Mesh>(first), glm::scale(glm::mat4(1), placement.scale)), a.resolution);
    if (!(voxelSize > 0)) voxelSize = std::get<LevelSet>(first).voxelSize();
    detail::checkVoxelSize(voxelSize);
    const auto liquid = openvdb::createLevelSet<openvdb::FloatGrid>(voxelSize, a.halfWidth);
    const glm::dvec3 far = originOf(first);
    if (far != glm::dvec3(0)) {
        const glm::dvec3 origin = wholeVoxels(placement.toWorld(far), liquid->voxelSize()[0]);
        liquid->insertMeta(metadata::origin, openvdb::Vec3DMetadata({origin.x, origin.y, origin.z}));
    }
    return liquid;
}

// Returns the volume of the negative region, interpolated between voxels; zero if there is none. OpenVDB's
// levelSetVolume() is off by up to half a percent for a box of 25 voxels; this is off by less than a tenth of that.
double volumeOf(const openvdb::FloatGrid::Ptr& liquid) {
    if (liquid->empty()) return 0;
    auto grids = std::make_shared<Grids>();
    grids->distance = liquid;
    try {
        return massProperties(LevelSet(std::move(grids))).volume;
    } catch (const std::invalid_argument&) {
        return 0;
    }
}

// Adds the report of one seed to the sum of all.
void add(fluid::SeedReport& all, const fluid::SeedReport& next) {
    if (next.maxChangeVoxels > all.maxChangeVoxels) {
        all.maxChangeVoxels = next.maxChangeVoxels;
        all.where = next.where;
    }
    all.changedVoxels += next.changedVoxels;
}

void report(const SeedArguments& a, const openvdb::FloatGrid& liquid, const std::vector<ReadReport>& files,
            const fluid::SeedReport& changes, std::uint64_t particles, double seconds) {
    const double volume = volumeOf(liquid.deepCopy());
    const float voxelSize = float(liquid.voxelSize()[0]);
    Json read = Json::array();
    for (const ReadReport& file : files) read.push_back(toJson(file));
    if (a.json)
        return print({{"output", a.output.string()},
                      {"files", read},
                      {"voxelSize", number(voxelSize)},
                      {"halfWidth", number(liquid.background() / voxelSize)},
                      {"activeVoxels", liquid.activeVoxelCount()},
                      {"leaves", liquid.tree().leafCount()},
                      {"volume", volume},
                      {"changes",
                       {{"voxels", changes.changedVoxels},
                        {"largest", number(changes.maxChangeVoxels)},
                        {"where", vector(changes.where)}}},
                      {"particles", particles},
                      {"seconds", seconds}});
    Table table(a.output.string());
    for (std::size_t i = 0; i < files.size(); ++i)
        if (!isVdb(a.inputs[i])) addRows(table, files[i]);
    table.row("voxel size", metres(voxelSize));
    table.row("active voxels", grouped(liquid.activeVoxelCount()));
    table.row("volume", fmt::format("{:.6g} m^3", volume));
    if (changes.changedVoxels)
        table.row("changed", fmt::format("{} voxels by more than 0.1 voxel, at most {:.2f} at {:.10g} {:.10g} {:.10g}",
                                         grouped(changes.changedVoxels), changes.maxChangeVoxels, changes.where.x,
                                         changes.where.y, changes.where.z));
    if (a.particlesGiven->count()) table.row("particles", grouped(particles));
    table.row("time", fmt::format("{:.3f} s", seconds));
    table.print();
}

// Errors name the file.
fluid::SeedReport seedInput(openvdb::FloatGrid& liquid, const SeedArguments& a, std::size_t index, const Input& input,
                            const fluid::Placement& placement) {
    try {
        const fluid::SeedOptions options(makeMode(a.mode), a.uniteSolids);
        return std::visit([&](const auto& body) { return fluid::seed(liquid, body, placement, options); }, input);
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& error) {
        const std::string into = a.into.empty() ? "" : " into " + a.into.string();
        throw std::runtime_error(fmt::format("{}{}: {}", a.inputs[index].string(), into, error.what()));
    }
}

void run(const SeedArguments& a) {
    requireUsage(a);
    const fluid::Placement placement = makePlacement(a);
    const Stopwatch watch;
    std::vector<Input> inputs;
    std::vector<ReadReport> files(a.inputs.size());
    for (std::size_t i = 0; i < files.size(); ++i)
        inputs.push_back(read(a.inputs[i], remainder(a, placement), files[i]));
    requireWritable(a.output);

    const openvdb::FloatGrid::Ptr liquid = startingLiquid(a, inputs.front(), placement);
    liquid->setName("liquid");
    // bodies are placed in world coordinates; all else is relative to the origin, where floats are most accurate
    const auto entry = liquid->getMetadata<openvdb::Vec3DMetadata>(metadata::origin);
    const openvdb::math::Transform::Ptr near = liquid->transformPtr(), world = near->copy();
    world->postTranslate(entry ? entry->value() : openvdb::Vec3d(0));
    liquid->setTransform(world);
    fluid::SeedReport changes;
    for (std::size_t i = 0; i < inputs.size(); ++i) add(changes, seedInput(*liquid, a, i, inputs[i], placement));
    liquid->setTransform(near);
    openvdb::GridPtrVec grids{liquid};
    std::uint64_t count = 0;
    if (a.particlesGiven->count()) {
        const auto particles = fluid::particles(*liquid, a.particles);
        count = particles.positions.size();
        grids.push_back(fluid::particleGrid(particles, *near));
    }
    for (const auto& grid : grids) grid->setTransform(world);
    writeGrids(a.output, {grids.begin(), grids.end()});
    liquid->setTransform(near);
    report(a, *liquid, files, changes, count, watch.seconds());
}

}  // namespace

void addSeed(CLI::App& app) {
    auto* command = app.add_subcommand("seed", "Unite meshes and fields into the level set of a liquid");
    const auto a = std::make_shared<SeedArguments>();
    command->add_option("inputs", a->inputs, "meshes and .vdb fields")->required();
    command->add_option("-o,--output", a->output, "the .vdb file")->required();
    auto* into = command->add_option("--into", a->into, "a liquid to start from, instead of an empty one");
    auto* size =
        command->add_option("--voxel-size", a->voxelSize, "edge of the liquid's voxels, default the first field's")
            ->check(positive());
    auto* resolution =
        command->add_option("--resolution", a->resolution, "voxels along the longest side of the first mesh, scaled")
            ->check(positive());
    size->excludes(into)->excludes(resolution);
    resolution->excludes(into);
    command->add_option("--half-width", a->halfWidth, "width of the liquid's band [voxels], default 3")
        ->check(within(3, 1e3))
        ->excludes(into);
    command->add_option("--translate", a->translate, "translates all inputs, after --rotate: x y z")
        ->expected(3)
        ->check(finite());
    command->add_option("--rotate", a->rotate, "rotates all inputs, after --scale: axis x y z and angle [radians]")
        ->expected(4)
        ->check(finite());
    command->add_option("--scale", a->scale, "scales all inputs, first of all: one number, or x y z")
        ->expected(1, 3)
        ->check(positive());
    command->add_option("--mode", a->mode, "unite (default), intersect or subtract")
        ->check(CLI::IsMember({"unite", "intersect", "subtract"}));
    command->add_flag("--union,!--no-union", a->uniteSolids,
                      "use the union of a mesh's overlapping solids, without the walls inside it (default)");
    a->particlesGiven =
        command->add_option("--particles", a->particles.perVoxel, "also write a grid of points: particles per voxel")
            ->check(CLI::Range(1, 1000));
    command->add_option("--seed", a->particles.seed, "random seed of the particles")->needs(a->particlesGiven);
    command->add_flag("--json", a->json, "print one JSON object");
    command->callback([a] { run(*a); });
}

}  // namespace bilayer::tools
