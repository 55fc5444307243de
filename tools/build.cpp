// SPDX-License-Identifier: Apache-2.0
// `bilayer build`: a mesh file becomes a .vdb file.
#include <fmt/format.h>
#include <tbb/global_control.h>

#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include <bilayer/cl/device.h>
#include <bilayer/cl/filler.h>
#include <bilayer/collider/collider.h>
#include <bilayer/integration/fluid/extend.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>
#include "collider/contact/body/accuracy_names.h"
#include "sdf/base/method_names.h"
#include "sdf/fill/double_layer.h"
#include "sdf/sign/sign_choice.h"
#include "tools/build.h"
#include "tools/commands.h"
#include "tools/output.h"
#include "tools/tiles/tile_run.h"

namespace bilayer::tools {

using namespace bilayer::detail;
namespace {

// The words are part of the command line's contract.
const std::map<std::string, Method> methods(methodNames.begin(), methodNames.end());
const std::map<std::string, Sign> signs(signNames.begin(), signNames.end());
const std::map<std::string, ContactAccuracy> contactAccuracies(accuracyNames.begin(), accuracyNames.end());
const std::map<std::string, KernelMapping> mappings{{"auto", KernelMapping::automatic},
                                                    {"block", KernelMapping::blockPerItem},
                                                    {"group", KernelMapping::groupPerBlock}};
constexpr double minBandVoxels = 1e-3, maxBandVoxels = 1e3;

void requireUsage(const BuildArguments& a) {
    if (a.backend != "opencl" && (a.deviceGiven->count() || a.memoryGiven->count() || a.mappingGiven->count()))
        throw CLI::ValidationError("--device, --device-memory and --mapping", "need --backend opencl");
    if (a.backend == "opencl" && a.options.method == Method::pseudonormal)
        throw CLI::ValidationError("--method pseudonormal", "needs --backend tbb");
    const bool layers = a.options.method == Method::doubleLayer, prism = a.options.method == Method::prism;
    const Sign sign = a.options.sign;
    if (prism && a.backend != "opencl") throw CLI::ValidationError("--method prism", "needs --backend opencl");
    for (const CLI::Option* option : a.layerOptions)
        if (!layers && option->count()) throw CLI::ValidationError(option->get_name(), "needs --method double-layer");
    if (layers && sign != Sign::automatic)
        throw CLI::ValidationError("--sign", "is not for --method double-layer: the layers determine the signs");
    if (prism && sign != Sign::automatic)
        throw CLI::ValidationError("--sign", "is not for --method prism: the triangles determine the signs");
    if (a.gapGiven->count() && (layers || prism || (sign != Sign::automatic && sign != Sign::flood)))
        throw CLI::ValidationError("--gap", "needs --sign flood or auto, and --method exact or pseudonormal");
    if (a.options.unite && (layers || prism || sign == Sign::flood))
        throw CLI::ValidationError("--union", "needs --method exact or pseudonormal, and no --sign flood");
    if (a.isBandInWorldUnits() && !a.halfGiven->count() && !a.exteriorGiven->count())
        throw CLI::ValidationError("--band-unit", "world needs --half-width, or --exterior-width and --interior-width");
    for (const CLI::Option* option : a.bodyOptions)
        if (!a.body && option->count()) throw CLI::ValidationError(option->get_name(), "needs --body");
}

// The API's range is (0, 1000] voxels too, but this message names the option.
void requireWidth(const CLI::Option* option, float width, const BuildArguments& a) {
    const bool world = a.isBandInWorldUnits();
    const double voxels = double(width) / (world ? double(a.options.voxelSize) : 1);
    if (option->count() && !(voxels >= minBandVoxels && voxels <= maxBandVoxels))
        throw CLI::ValidationError(
            option->get_name(),
            fmt::format("{:g}{} must be {:g} to {:g} voxels", width,
                        world ? fmt::format(" is {:g} voxels of {:g}; it", voxels, a.options.voxelSize) : "",
                        minBandVoxels, maxBandVoxels));
}

void requireBand(const BuildArguments& a) {
    requireWidth(a.halfGiven, a.halfWidth, a);
    requireWidth(a.exteriorGiven, a.exteriorWidth, a);
    requireWidth(a.interiorGiven, a.interiorWidth, a);
}

// Returns nothing for the CPU backend.
std::optional<BlockFiller> makeFiller(const BuildArguments& a) {
    if (a.backend == "tbb") return std::nullopt;
    return openclFiller(openDevice(a.device), {.memoryMiB = a.deviceMemory, .mapping = mappings.at(a.mapping)});
}

LevelSet timedBuild(const Mesh& mesh, const BuildArguments& a, BuildOutcome& outcome) {
    const std::optional<BlockFiller> filler = makeFiller(a);
    outcome.device = filler ? filler->device() : fmt::format("processor ({})", simdName());
    ProgressBar bar("building");
    BuildOptions options = a.options;
    options.progress = bar.callback();
    const Stopwatch watch;
    LevelSet field = [&] {
        try {
            return build(mesh, options, filler ? &*filler : nullptr);
        } catch (const std::invalid_argument& error) {
            throw std::invalid_argument(fmt::format("{}: {}", a.mesh.string(), error.what()));
        }
    }();
    outcome.build = watch.seconds();
    outcome.times = field.buildTimes();
    return field;
}

// Builds a field with the additional data that bodies need.
LevelSet timedBody(const Mesh& mesh, const LevelSet& field, const BuildArguments& a, BuildOutcome& outcome) {
    const Stopwatch watch;
    LevelSet stored = withBody(field, mesh, a.collider, !a.noMesh);
    outcome.body = watch.seconds();
    return stored;
}

CLI::Option_group* addBand(CLI::App& command, BuildArguments& a) {
    auto* size = command.add_option_group("voxel size", "one of these options gives it");
    size->add_option("--voxel-size", a.options.voxelSize, "edge of a voxel in the mesh's unit")->check(positive());
    a.resolutionGiven = size->add_option("--resolution", a.resolution, "voxels along the longest side of the bounds")
                            ->check(positive());
    a.halfGiven =
        command
            .add_option("--half-width", a.halfWidth, "width of the band on each side of the surface, default 3 voxels")
            ->check(positive());
    a.exteriorGiven =
        command.add_option("--exterior-width", a.exteriorWidth, "width of the band outside")->check(positive());
    a.interiorGiven =
        command.add_option("--interior-width", a.interiorWidth, "width of the band inside")->check(positive());
    a.exteriorGiven->needs(a.interiorGiven)->excludes(a.halfGiven);
    a.interiorGiven->needs(a.exteriorGiven)->excludes(a.halfGiven);
    command
        .add_option("--band-unit", a.bandUnit,
                    "unit of the three widths: voxels (default) or world, the mesh's unit; each 0.001 to 1000 voxels")
        ->check(CLI::IsMember({"voxels", "world"}));
    return size;
}

void addMethod(CLI::App& command, BuildArguments& a) {
    command
        .add_option("--method", a.method,
                    "exact (default), double-layer, pseudonormal or prism (with --backend opencl)")
        ->check(CLI::IsMember(methods));
    command.add_option("--sign", a.sign, "auto (default), normals, winding or flood")->check(CLI::IsMember(signs));
    command.add_flag("--union", a.options.unite, "build the union of overlapping solids, without the walls inside it");
    a.gapGiven = command
                     .add_option("--gap", a.options.gapVoxels,
                                 "maximum width of gaps that --sign flood closes [voxels], default 2")
                     ->check(within(0, 100));
}

void addLayers(CLI::App& command, BuildArguments& a) {
    DoubleLayerOptions& layers = a.options.doubleLayer;
    auto* group = command.add_option_group("layers", "only for --method double-layer");
    a.layerOptions = {
        group->add_option("--delta", layers.delta, "distance of each layer from the surface [voxels], default 0.5")
            ->check(within(0.1, 4)),
        group->add_option("--epsilon", layers.epsilon, "area per sample [voxels^2], default 1")
            ->check(within(1e-4, 1e4)),
        group->add_option("--neighbourhood", layers.neighbourhood, "minimum reach of a sample [voxels], default 2")
            ->check(CLI::Range(1, 64)),
        group
            ->add_option("--max-subdivision", layers.maxSubdivision,
                         "maximum rows of samples in a piece of a triangle, default 32")
            ->check(CLI::Range(1, 1024))};
}

void addBody(CLI::App& command, BuildArguments& a) {
    auto* group = command.add_option_group("body", "what rigid bodies need in addition to the field");
    group->add_flag("--body", a.body,
                    "also store surface points, mass, margin and the mesh: all that a collider needs");
    auto* contacts = group
                         ->add_option("--contacts", a.contacts,
                                      "contact accuracy: by samples, by triangles near edges and vertices, or by "
                                      "triangles everywhere; default exact-near-features")
                         ->check(CLI::IsMember(contactAccuracies));
    auto* noMesh =
        group->add_flag("--no-mesh", a.noMesh, "store no mesh: the file is smaller, and sharp edges are rounded");
    a.bodyOptions = {
        group->add_option("--margin", a.collider.margin, "collision margin in the mesh's unit, default a voxel")
            ->check(positive()),
        group
            ->add_option("--point-spacing", a.collider.pointSpacingVoxels,
                         "spacing of surface points [voxels], default 2")
            ->check(within(0.1, 100)),
        contacts, noMesh->excludes(contacts)};
}

void addMachine(CLI::App& command, BuildArguments& a) {
    command.add_option("--backend", a.backend, "tbb (default) or opencl")->check(CLI::IsMember({"tbb", "opencl"}));
    a.deviceGiven = command.add_option("--device", a.device, "part of an OpenCL device's or platform's name");
    a.memoryGiven = command.add_option("--device-memory", a.deviceMemory, "maximum device memory to use [MiB]")
                        ->check(CLI::Range(std::uint64_t(1), std::uint64_t(1) << 30));
    a.mappingGiven =
        command
            .add_option(
                "--mapping", a.mapping,
                "how blocks are mapped: auto (default), block (one per work-item) or group (one per work-group)")
            ->check(CLI::IsMember(mappings));
    command.add_option("--threads", a.options.threads, "maximum thread count, default all")->check(CLI::Range(1, 4096));
}

}  // namespace

void checkBuildOptions(BuildArguments& a) {
    a.options.method = methods.at(a.method);
    a.options.sign = signs.at(a.sign);
    requireUsage(a);
    // widths in the mesh's unit are checked once the voxel size is known
    if (!a.isBandInWorldUnits() || !a.resolutionGiven->count()) requireBand(a);
    a.collider.accuracy = a.noMesh ? ContactAccuracy::samples : contactAccuracies.at(a.contacts);
}

void setSizes(BuildArguments& a, const Mesh& mesh) {
    setSizes(a, a.resolutionGiven->count() ? voxelSizeFor(mesh, a.resolution) : a.options.voxelSize);
}

void setSizes(BuildArguments& a, float voxelSize) {
    a.options.voxelSize = voxelSize;
    if (a.resolutionGiven->count()) requireBand(a);
    if (!a.exteriorGiven->count()) a.exteriorWidth = a.interiorWidth = a.halfWidth;
    const float unit = a.isBandInWorldUnits() ? a.options.voxelSize : 1;
    a.options.exteriorWidthVoxels = a.exteriorWidth / unit;
    a.options.interiorWidthVoxels = a.interiorWidth / unit;
}

LevelSet buildField(BuildArguments& a, const Mesh& mesh, BuildOutcome& outcome) {
    const Stopwatch inspecting;
    if (a.report)
        outcome.report = inspect(mesh, a.options.voxelSize);
    else
        outcome.balanced = balanced(mesh);
    outcome.inspect = inspecting.seconds();
    a.options.inspected = outcome.report ? &*outcome.report : nullptr;
    LevelSet field = timedBuild(mesh, a, outcome);
    if (a.extend) {
        const Stopwatch extending;
        field = fluid::extend(field);
        outcome.extend = extending.seconds();
    }
    return a.body ? timedBody(mesh, field, a, outcome) : field;
}

Json toJson(const BuildArguments& a, const BuildOutcome& o, const Mesh& mesh, const LevelSet& field) {
    Json json{{"file", toJson(o.file)},
              {"mesh", o.report ? toJson(*o.report, a.options.voxelSize) : toJson(mesh, o.balanced)},
              {"output", a.output.string()},
              {"triangles", mesh.triangles.size()},
              {"voxelSize", number(field.voxelSize())},
              {"bandUnit", a.bandUnit},
              {"exteriorWidth", number(a.exteriorWidth)},
              {"interiorWidth", number(a.interiorWidth)},
              {"activeVoxels", field.activeVoxels()},
              {"leaves", field.leaves()},
              {"memoryBytes", field.memoryBytes()},
              {"hasInside", o.hasInside},
              {"backend", a.backend},
              {"device", o.device},
              {"seconds",
               {{"read", o.read},
                {"inspect", o.inspect},
                {"build", o.build},
                {"parts", {{"prepare", o.times.prepare}, {"fill", o.times.fill}, {"assemble", o.times.assemble}}},
                {"extend", o.extend},
                {"body", o.body},
                {"write", o.write}}},
              {"peakRssBytes", peakMemory()}};
    json.update(provenance(field, a.stored));
    if (a.body) json["body"] = toJson(bodyOf(field), field.origin());
    return json;
}

CLI::Option_group* addBuildOptions(CLI::App& command, BuildArguments& a) {
    CLI::Option_group* size = addBand(command, a);
    addMethod(command, a);
    addLayers(command, a);
    addMachine(command, a);
    addBody(command, a);
    command.add_flag("--triangles", a.options.triangles, "also store the nearest triangle of each voxel");
    command.add_flag("--extend", a.extend, "extend the distances to all voxels of the field's bounding box");
    command.add_flag("--half-float", a.stored.halfFloat, "store 16-bit distances");
    return size;
}

namespace {

// Ends at the first voxel that is inside.
bool hasInside(const LevelSet& field) {
    for (auto value = field.grids().distance->tree().cbeginValueAll(); value; ++value)
        if (*value < 0) return true;
    return false;
}

void printTable(const BuildArguments& a, const BuildOutcome& o, const Mesh& mesh, const LevelSet& field) {
    Table input(a.mesh.string());
    addRows(input, o.file);
    if (o.report)
        addRows(input, *o.report, a.options.voxelSize);
    else
        addRows(input, mesh, o.balanced);
    input.print();
    Table table(a.output.string());
    addRows(table, field, a.stored);
    if (!o.hasInside)
        table.row("note", "the field has no inside: every voxel is outside; try another --sign, or close the mesh");
    if (a.body) addRows(table, bodyOf(field));
    table.row("filled by", fmt::format("{} on {}", a.backend, o.device));
    table.row("build", fmt::format("{:.3f} s: prepare {:.3f}, fill {:.3f}, assemble {:.3f}", o.build, o.times.prepare,
                                   o.times.fill, o.times.assemble));
    table.row("files", fmt::format("{:.3f} s to read, {:.3f} s to write", o.read, o.write));
    table.row("peak memory", bytes(peakMemory()));
    table.print();
}

void run(BuildArguments a) {
    checkBuildOptions(a);
    requireOther(a.output, a.mesh);
    std::optional<tbb::global_control> threads;
    if (a.options.threads > 0)
        threads.emplace(tbb::global_control::max_allowed_parallelism, std::size_t(a.options.threads));

    BuildOutcome outcome;
    const Stopwatch reading;
    const auto [mesh, contents] = readMeshFile(a.mesh);
    outcome.file = contents;
    outcome.read = reading.seconds();
    requireWritable(a.output);
    setSizes(a, mesh);
    const LevelSet field = buildField(a, mesh, outcome);
    outcome.hasInside = hasInside(field);
    const Stopwatch writing;
    writeVdb(a.output, field, a.stored);
    outcome.write = writing.seconds();
    a.json ? print(toJson(a, outcome, mesh, field)) : printTable(a, outcome, mesh, field);
}

}  // namespace

void addBuild(CLI::App& app, const Ranks& ranks) {
    auto* command = app.add_subcommand("build", "Build the field of a mesh");
    const auto a = std::make_shared<BuildArguments>();
    const auto tiles = std::make_shared<TileArguments>();
    command->add_option("mesh", a->mesh, "OBJ, PLY, STL, OFF, glTF, ...")->required();
    command->add_option("-o,--output", a->output, "the .vdb file, or the folder of tiles")->required();
    addBuildOptions(*command, *a)->require_option(1);
    command->add_flag("--report", a->report,
                      "also inspect the mesh, as the command inspect does, and count walls thinner than a voxel");
    CLI::Option* tiled = addTileOptions(*command, *tiles);
    if (ranks.count > 1) tiled->required();
    command->add_flag("--json", a->json, "print one JSON object");
    command->callback([a, tiles, tiled, ranks] {
        if (!tiled->count()) return run(*a);
        checkBuildOptions(*a);
        buildTiles(*a, *tiles, ranks);
    });
}

}  // namespace bilayer::tools
