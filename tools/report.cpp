// SPDX-License-Identifier: Apache-2.0
// `bilayer inspect`, `info` and `devices`: the read-only commands.
// Tested by tests/tools/report.cpp through the program.
#include <fmt/format.h>
#include <openvdb/io/File.h>
#include <openvdb/tools/Diagnostics.h>
#include <cmath>

#include <memory>
#include <optional>
#include <stdexcept>

#include <bilayer/cl/device.h>
#include <bilayer/collider/field.h>
#include <bilayer/collider/mass.h>
#include <bilayer/integration/bullet/settings.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "collider/contact/body/body.h"
#include "sdf/base/openvdb.h"
#include "sdf/tiles/tile_manifest.h"
#include "tools/commands.h"
#include "tools/output.h"
#include "tools/tiles/tile_folder.h"
#include "tools/tiles/tile_plan.h"

namespace bilayer::tools {

using namespace bilayer::detail;
namespace {

struct ReportArguments {
    std::filesystem::path input;
    bool json = false;
};

struct InspectArguments : ReportArguments {
    bullet::SceneRequirements scene;
    CLI::Option* stepGiven = nullptr;
};

template <class Arguments = ReportArguments>
std::shared_ptr<Arguments> addArguments(CLI::App& command, const char* name, const char* help) {
    auto arguments = std::make_shared<Arguments>();
    if (name) command.add_option(name, arguments->input, help)->required();
    command.add_flag("--json", arguments->json, "print one JSON object");
    return arguments;
}

/// The narrowest band that OpenVDB's check of level sets accepts [voxels], and the rounding of a width.
constexpr double minCheckedWidth = 3, rounding = 1e-5;

// Returns nothing for a mesh that encloses no volume.
template <class Solid>
std::optional<MassProperties> massOf(const Solid& solid) {
    try {
        return massProperties(solid);
    } catch (const std::invalid_argument&) {
        return std::nullopt;
    }
}

Json settingsJson(const bullet::Settings& settings) {
    return {{"voxelSize", number(settings.voxelSize)},
            {"margin", number(settings.margin)},
            {"exteriorWidth", settings.exteriorWidthVoxels},
            {"interiorWidth", settings.interiorWidthVoxels},
            {"substeps", settings.substeps},
            {"substepsWithoutSweeps", settings.substepsWithoutSpeculation},
            {"wallVoxels", number(settings.wallVoxels)},
            {"splitImpulsePenetrationThreshold", number(settings.splitImpulse)},
            {"activeVoxels", settings.voxels},
            {"fieldBytes", settings.fieldBytes},
            {"buildSeconds", settings.buildSeconds},
            {"warnings", settings.warnings}};
}

void printSettings(const InspectArguments& a, const bullet::Settings& settings) {
    Table table(fmt::format("recommended settings: impact speeds up to {:g} m/s, steps of {:.4g} s", a.scene.speed,
                            a.scene.step));
    table.row("build", fmt::format("--voxel-size {:.4g} --exterior-width {} --interior-width {} --body --margin {:.4g}",
                                   settings.voxelSize, settings.exteriorWidthVoxels, settings.interiorWidthVoxels,
                                   settings.margin));
    if (settings.wallVoxels > 0) table.row("walls", fmt::format("{:.3g} voxels", settings.wallVoxels));
    const auto text = [](int substeps) {
        return fmt::format("{}{}", substeps, substeps < bullet::maxSubsteps ? "" : " or more");
    };
    table.row("substeps", fmt::format("{} with speculative contacts, {} without", text(settings.substeps),
                                      text(settings.substepsWithoutSpeculation)));
    table.row("field", fmt::format("about {} active voxels, {}, built in {:.1g} s on two cores",
                                   grouped(settings.voxels), bytes(settings.fieldBytes), settings.buildSeconds));
    table.row("solver", fmt::format("m_splitImpulsePenetrationThreshold = {:.4g}", settings.splitImpulse));
    for (const std::string& warning : settings.warnings) table.row("warning", warning);
    table.print();
}

void runInspect(const InspectArguments& a) {
    const auto [mesh, read] = readMeshFile(a.input);
    const MeshReport report = inspect(mesh);
    const auto settings =
        a.stepGiven->count() ? std::optional(bullet::recommendSettings(report, a.scene)) : std::nullopt;
    const std::optional<MassProperties> mass = report.closed() ? massOf(mesh) : std::nullopt;
    if (a.json) {
        Json json = toJson(report, 0);
        json["file"] = toJson(read);
        json["mass"] = toJson(mass, mesh.origin);
        if (settings) json["advice"] = settingsJson(*settings);
        return print(json);
    }
    Table table(a.input.string());
    addRows(table, read);
    addRows(table, report, 0);
    addRows(table, mass, mesh.origin);
    table.print();
    if (settings) printSettings(a, *settings);
}

// Returns OpenVDB's verdict on the grid as a level set. It is only a remark, since a field may have two different
// widths. A width of three voxels up to rounding is as wide as OpenVDB wants it.
std::string remark(const LevelSet& field) {
    const openvdb::FloatGrid& grid = *field.grids().distance;
    const double voxels = double(grid.background()) / grid.voxelSize()[0];
    std::string text;
    if (voxels < minCheckedWidth && voxels >= (1 - rounding) * minCheckedWidth) {
        openvdb::tools::CheckLevelSet<openvdb::FloatGrid> check(grid);
        text = check.checkTiles();
        if (text.empty()) text = check.checkFinite();
        if (text.empty()) text = check.checkRange();
        if (text.empty()) text = check.checkInactiveValues();
        if (text.empty()) text = check.checkEikonal();
    } else {
        text = openvdb::tools::checkLevelSet(grid);
    }
    return text.substr(0, text.find('\n'));
}

// Returns why a field has no mass.
std::string whyMassless(const LevelSet& field) {
    try {
        massProperties(field);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "its body is stored without mass properties";
}

Bounds activeBounds(const LevelSet& field) {
    const openvdb::FloatGrid& grid = *field.grids().distance;
    const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
    const openvdb::Vec3d lower = grid.indexToWorld(box.min()), upper = grid.indexToWorld(box.max());
    Bounds bounds;
    bounds.add({float(lower.x()), float(lower.y()), float(lower.z())});
    bounds.add({float(upper.x()), float(upper.y()), float(upper.z())});
    return bounds;
}

Json gridList(const std::filesystem::path& path) {
    openvdb::io::File file(path.string());
    file.open(/*delayLoad=*/false);
    Json list = Json::array();
    const openvdb::GridPtrVecPtr grids = file.readAllGridMetadata();
    for (const auto& grid : *grids)
        list.push_back({{"name", grid->getName()},
                        {"type", grid->valueType()},
                        {"class", openvdb::GridBase::gridClassToString(grid->getGridClass())},
                        {"halfFloat", grid->saveFloatAsHalf()}});
    return list;
}

void printInfo(const ReportArguments& a, const LevelSet& field, const Json& grids, const std::optional<Body>& body,
               const std::optional<MassProperties>& mass) {
    Table table(a.input.string());
    for (const Json& grid : grids)
        table.row("grid",
                  fmt::format("'{}': {}, {}{}", grid["name"].get<std::string>(), grid["type"].get<std::string>(),
                              grid["class"].get<std::string>(), grid["halfFloat"] ? ", 16 bits" : ""));
    addRows(table, field);
    if (body) addRows(table, *body);
    table.row("bounds", boxText(activeBounds(field), field.origin()));
    table.row("volume", mass ? fmt::format("{:.6g} m^3", mass->volume) : "none: " + whyMassless(field));
    addRows(table, mass, field.origin());
    if (field.meshHash()) table.row("mesh hash", hex(field.meshHash()));
    const std::string text = remark(field);
    table.row("level-set check", text.empty() ? "passed" : text);
    table.print();
}

// Rounds to five digits: a width in metres divided by the voxel size is a whole number up to rounding.
Json inVoxels(float width, const LevelSet& field) {
    return std::round(1e5 * double(width) / double(field.voxelSize())) / 1e5;
}

// Opening the folder checks what all queries need.
void runInfoOfTiles(const ReportArguments& a) {
    const TiledField field(a.input, 0);
    const Json manifest = readJson(a.input / "manifest.json");
    if (a.json) return print(manifest);
    Table table(a.input.string());
    table.row("voxel size", metres(field.voxelSize()));
    table.row("band", fmt::format("{:.6g} voxels outside, {:.6g} inside", field.exteriorWidth() / field.voxelSize(),
                                  field.interiorWidth() / field.voxelSize()));
    table.row("bounds", boxText(field.bounds(), readTileManifest(a.input).origin));
    try {
        table.row("method", manifest.at("field").at("method"));
        addTileRows(table, manifest);
        if (const Json& hash = manifest.at("mesh").at("hash"); !hash.is_null()) table.row("mesh hash", hash);
    } catch (const Json::exception& error) {
        throw std::runtime_error(fmt::format("{}/manifest.json: is damaged ({})", a.input.string(), error.what()));
    }
    table.print();
}

void runInfo(const ReportArguments& a) {
    if (std::filesystem::is_directory(a.input)) return runInfoOfTiles(a);
    const auto [field, body] = readStored(a.input);
    const Json grids = gridList(a.input);
    const std::optional<MassProperties> mass = body ? body->mass : massOf(field);
    if (!a.json) return printInfo(a, field, grids, body, mass);
    Json json{{"grids", grids},
              {"voxelSize", number(field.voxelSize())},
              {"exteriorWidth", inVoxels(field.exteriorWidth(), field)},
              {"interiorWidth", inVoxels(field.interiorWidth(), field)},
              {"activeVoxels", field.activeVoxels()},
              {"leaves", field.leaves()},
              {"bounds", box(activeBounds(field), field.origin())},
              {"origin", vector(field.origin())},
              {"mass", toJson(mass, field.origin())},
              {"meshHash", hex(field.meshHash())},
              {"memoryBytes", field.memoryBytes()},
              {"levelSetCheck", remark(field)}};
    json.update(provenance(field));
    if (body) json["body"] = toJson(*body, field.origin());
    print(json);
}

Json deviceJson(const DeviceInfo& device) {
    return {{"platform", device.platform},
            {"name", device.name},
            {"version", device.version},
            {"driver", device.driver},
            {"gpu", device.gpu},
            {"computeUnits", device.computeUnits},
            {"doublePrecision", device.doubles},
            {"memoryBytes", device.memoryBytes},
            {"maxAllocationBytes", device.maxAllocationBytes}};
}

void runDevices(const ReportArguments& a) {
    const std::vector<DeviceInfo> found = devices();
    if (a.json) {
        Json list = Json::array();
        for (const DeviceInfo& device : found) list.push_back(deviceJson(device));
        return print({{"devices", list}});
    }
    if (found.empty()) fmt::print("no OpenCL device\n");
    for (const DeviceInfo& device : found) {
        Table table(device.name);
        table.row("platform", fmt::format("{} ({})", device.platform, device.version));
        table.row("driver", device.driver);
        table.row("kind", fmt::format("{}, {} compute units, {}", device.gpu ? "GPU" : "no GPU", device.computeUnits,
                                      device.doubles ? "double precision" : "single precision only: prism alone"));
        table.row("memory", fmt::format("{}, at most {} in one allocation", bytes(device.memoryBytes),
                                        bytes(device.maxAllocationBytes)));
        table.print();
    }
}

// "0.02" or "1/60".
std::string asSeconds(std::string& word) {
    const auto slash = word.find('/');
    if (slash == std::string::npos) return "";
    double over = 0, under = 0;
    if (!CLI::detail::lexical_cast(word.substr(0, slash), over) ||
        !CLI::detail::lexical_cast(word.substr(slash + 1), under))
        return "must be a number or a fraction";
    word = fmt::format("{}", over / under);
    return "";
}

void addScene(CLI::App& command, InspectArguments& a) {
    bullet::SceneRequirements& scene = a.scene;
    auto* group =
        command.add_option_group("scene", "recommend settings for a body's field, and warn of what they cannot solve");
    auto* step = group->add_option("--dt", scene.step, "time step of the simulation [s], as 0.01 or 1/60")
                     ->check(positive())
                     ->transform(CLI::Validator(asSeconds, "SECONDS"));
    auto* speed =
        group->add_option("--speed", scene.speed, "maximum relative speed of bodies [m/s]")->check(nonNegative());
    step->needs(speed);
    speed->needs(step);
    const auto also = [&](const char* name, float& value, const char* help, const CLI::Validator& check) {
        group->add_option(name, value, help)->check(check)->needs(step);
    };
    also("--spin", scene.spin, "maximum angular speed [rad/s], default what an impact can cause", nonNegative());
    also("--thickness", scene.thickness, "thinnest wall that it collides with [m], in addition to its own walls",
         positive());
    also("--gap", scene.gap, "narrowest gap that it must pass [m]", positive());
    also("--voxel-size", scene.voxelSize, "check this voxel size instead of choosing one [m]", positive());
    also("--margin", scene.margin, "check this collision margin [m], default a voxel", nonNegative());
    also("--mass-ratio", scene.massRatio, "mass ratio of the heaviest to the lightest body in contact, default 1",
         within(1, 1e9));
    a.stepGiven = step;
}

}  // namespace

void addInspect(CLI::App& app) {
    auto* command = app.add_subcommand("inspect", "Report the defects of a mesh");
    const auto a = addArguments<InspectArguments>(*command, "mesh", "OBJ, PLY, STL, OFF, glTF, ...");
    addScene(*command, *a);
    command->callback([a] { runInspect(*a); });
}

void addInfo(CLI::App& app) {
    auto* command = app.add_subcommand("info", "Show the contents of a .vdb file");
    const auto a = addArguments(*command, "field", "a .vdb file, or a folder of tiles");
    command->callback([a] { runInfo(*a); });
}

void addDevices(CLI::App& app) {
    auto* command = app.add_subcommand("devices", "List the OpenCL devices");
    const auto a = addArguments(*command, nullptr, nullptr);
    command->callback([a] { runDevices(*a); });
}

}  // namespace bilayer::tools
