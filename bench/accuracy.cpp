// SPDX-License-Identifier: Apache-2.0
// Compares the accuracy of the builders. The fields are of all closed, oriented public meshes without
// self-intersection. Hundreds of thousands of voxels each are compared with distances in double precision and winding
// numbers that share no code with the library. Exit status 1 if the method under test is not exact.
#include <fmt/format.h>
#include <openvdb/tools/MeshToVolume.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include <bilayer/cl/filler.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "bench/program.h"
#include "sdf/base/method_names.h"
#include "sdf/base/openvdb.h"
#include "tests/support/clean.h"
#include "tests/support/truth.h"
#include "tests/support/verdict.h"

using namespace bilayer;

namespace {

/// A voxel grid to build, and whether the peers build it too.
struct Case {
    float resolution;  // voxels along the longest side
    test::Band band;
    bool peers;

    std::string name() const { return fmt::format("{:g}, {:g}/{:g}", resolution, band.exterior, band.interior); }
};

// spans all resolutions and widths for which exactness is guaranteed; the many shapes of the corpus vary their
// combinations
const std::vector<Case> defaultCases = {{32, {3, 3}, false},    {60, {5, 2}, false},  {128, {3, 3}, true},
                                        {128, {10, 10}, false}, {251, {1, 1}, false}, {400, {1, 4}, false},
                                        {700, {3, 3}, false}};

/// One way to build a field.
struct Builder {
    std::string name;
    std::function<openvdb::FloatGrid::ConstPtr(const Mesh&, float voxelSize, const test::Band&)> grid;
};

/// Result of one builder for one mesh in one case.
struct Row {
    std::string mesh, grid, builder;
    std::size_t triangles;
    test::Verdict verdict;
};

const std::map<std::string, Method> methods(detail::methodNames.begin(), detail::methodNames.end());

// The prism method runs on the first OpenCL device.
Builder ours(const std::string& name) {
    const Method method = methods.at(name);
    std::optional<BlockFiller> filler;
    if (method == Method::prism) filler = openclFiller(openDevice());
    return {name, [method, filler](const Mesh& mesh, float voxelSize, const test::Band& band) {
                const BuildOptions options{.voxelSize = voxelSize,
                                           .exteriorWidthVoxels = float(band.exterior),
                                           .interiorWidthVoxels = float(band.interior),
                                           .method = method};
                return build(mesh, options, filler ? &*filler : nullptr).grids().distance;
            }};
}

Builder openvdbs(const std::string& name, int flags) {
    return {name, [flags](const Mesh& mesh, float voxelSize, const test::Band& band) {
                std::vector<openvdb::Vec3s> points;  // in voxels
                std::vector<openvdb::Vec3I> triangles;
                for (const auto& p : mesh.points) points.push_back(openvdb::Vec3s(p.x, p.y, p.z) / voxelSize);
                for (const auto& t : mesh.triangles) triangles.push_back({t.x, t.y, t.z});
                const openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, openvdb::Vec3I> adapter(points,
                                                                                                         triangles);
                return openvdb::tools::meshToVolume<openvdb::FloatGrid>(
                    adapter, *openvdb::math::Transform::createLinearTransform(voxelSize), float(band.exterior),
                    float(band.interior), flags);
            }};
}

// The method under test comes first: its field determines the voxels.
std::vector<Builder> allBuilders(const std::string& method) {
    std::vector<Builder> builders = {ours(method)};
    builders.push_back(openvdbs("meshToVolume 0x4", openvdb::tools::DISABLE_RENORMALIZATION));
    builders.push_back(openvdbs("meshToVolume", 0));
    std::vector<std::string> others = {detail::nameOf(Method::pseudonormal), detail::nameOf(Method::doubleLayer)};
    if (!devices().empty()) others.push_back(detail::nameOf(Method::prism));
    for (const std::string& other : others)
        if (other != method) builders.push_back(ours(other));
    return builders;
}

void print(const Row& row) {
    const test::Verdict& v = row.verdict;
    fmt::print("{:<36} {:<14} {:<17} {:>9} {:>9} {:>9.1e} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7}\n", row.mesh, row.grid,
               row.builder, v.checked, v.active, v.worst, v.inexact, v.wrong, v.wrongFar, v.wrongBackground, v.missing,
               v.extra);
    std::fflush(stdout);
}

void printHeader() {
    fmt::print("{:<36} {:<14} {:<17} {:>9} {:>9} {:>9} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7}\n", "mesh", "voxels, band",
               "builder", "checked", "active", "worst", "inexact", "wrong", "> 0.1", "backgr.", "missing", "extra");
}

// Sums over meshes, by case and builder, in the order of the run.
std::vector<Row> totals(const std::vector<Row>& rows) {
    std::vector<Row> sums;
    for (const Row& row : rows) {
        auto sum = std::find_if(sums.begin(), sums.end(),
                                [&](const Row& s) { return s.grid == row.grid && s.builder == row.builder; });
        if (sum == sums.end()) sum = sums.insert(sums.end(), {"", row.grid, row.builder, 0, {}});
        sum->triangles += row.triangles;
        sum->verdict += row.verdict;
    }
    for (Row& sum : sums) {
        const auto among = [&](auto condition) {
            return std::count_if(rows.begin(), rows.end(), [&](const Row& row) {
                return row.grid == sum.grid && row.builder == sum.builder && condition(row);
            });
        };
        sum.mesh = fmt::format("{} of {} meshes exact", among([](const Row& row) { return row.verdict.exact(); }),
                               among([](const Row&) { return true; }));
    }
    return sums;
}

std::string totalsTable(const std::vector<Row>& sums) {
    std::string text =
        "| voxels along the longest side, band | builder | exact meshes | voxels checked | active | worst error "
        "[voxels] | off by > 1e-4 | wrong sign | of these > 0.1 voxel away | wrong background | missing | extra |\n"
        "|---|---|---|---|---|---|---|---|---|---|---|---|\n";
    for (const Row& sum : sums) {
        const test::Verdict& v = sum.verdict;
        text += fmt::format("| {} | {} | {} | {} | {} | {:.1e} | {} | {} | {} | {} | {} | {} |\n", sum.grid,
                            sum.builder, sum.mesh, v.checked, v.active, v.worst, v.inexact, v.wrong, v.wrongFar,
                            v.wrongBackground, v.missing, v.extra);
    }
    return text;
}

// Compares the builders, a row per mesh, in the cases that all of them ran.
std::string meshTable(const std::vector<Row>& rows, const std::vector<Builder>& builders) {
    std::string text = "| mesh | triangles | voxels, band |", rule = "|---|---|---|";
    for (const Builder& builder : builders) {
        text += fmt::format(" {} |", builder.name);
        rule += "---|";
    }
    text += "\n" + rule + "\n";
    for (std::size_t i = 0; i + builders.size() <= rows.size(); ++i) {
        // a case that all builders ran is one contiguous run of rows
        const Row &first = rows[i], &last = rows[i + builders.size() - 1];
        if (first.builder != builders.front().name || last.mesh != first.mesh || last.grid != first.grid) continue;
        text += fmt::format("| {} | {} | {} |", first.mesh, first.triangles, first.grid);
        for (std::size_t b = 0; b < builders.size(); ++b) {
            const test::Verdict& v = rows[i + b].verdict;
            text += fmt::format(" {:.1e}; {} ({}); {}; {}, {} |", v.worst, v.wrong, v.wrongFar, v.wrongBackground,
                                v.missing, v.extra);
        }
        text += "\n";
    }
    return text;
}

std::string markdown(const std::vector<Row>& rows, const std::vector<Builder>& builders) {
    return totalsTable(totals(rows)) +
           "\nFor each builder: worst error [voxels]; wrong signs in the band (of these more than 0.1 voxel from the "
           "surface); wrong signs in the background; voxels missing, voxels too many.\n\n" +
           meshTable(rows, builders);
}

nlohmann::json json(const std::vector<Row>& rows) {
    nlohmann::json result = nlohmann::json::array();
    for (const Row& row : rows) {
        const test::Verdict& v = row.verdict;
        result.push_back({{"mesh", row.mesh},
                          {"triangles", row.triangles},
                          {"grid", row.grid},
                          {"builder", row.builder},
                          {"checked", v.checked},
                          {"active", v.active},
                          {"worst", v.worst},
                          {"inexact", v.inexact},
                          {"wrong", v.wrong},
                          {"wrongFar", v.wrongFar},
                          {"wrongBackground", v.wrongBackground},
                          {"missing", v.missing},
                          {"extra", v.extra}});
    }
    return result;
}

std::string meshPath(const std::string& name) {
    if (std::filesystem::exists(name)) return name;
    const std::filesystem::path path = std::filesystem::path(BILAYER_MESHES) / name;
    if (!std::filesystem::exists(path)) throw std::invalid_argument(fmt::format("no mesh {}", name));
    return path.string();
}

test::Band parseBand(const std::string& text) {
    const std::size_t slash = text.find('/');
    const double exterior = std::stod(text),
                 interior = slash < text.size() ? std::stod(text.substr(slash + 1)) : exterior;
    return {exterior, interior};
}

struct Options {
    std::vector<std::string> meshes, bands;
    std::vector<float> resolutions;
    std::string method = detail::nameOf(Method::exact), markdownFile;
    std::size_t samples = 200000;
    unsigned seed = 1;
    bool json = false, alone = false, unsignedOnly = false;
};

std::vector<Case> cases(const Options& options) {
    std::vector<Case> result;
    const bool byDefault = options.resolutions.empty() && options.bands.empty();
    if (byDefault) result = defaultCases;
    const auto resolutions = options.resolutions.empty() ? std::vector<float>{128} : options.resolutions;
    const auto bands = options.bands.empty() ? std::vector<std::string>{"3"} : options.bands;
    for (const float resolution : resolutions)
        for (const std::string& band : bands)
            if (!byDefault) result.push_back({resolution, parseBand(band), true});
    for (Case& c : result) c.peers = c.peers && !options.alone;
    return result;
}

class Run {
  public:
    explicit Run(const Options& options) : options_(options), builders_(allBuilders(options.method)) {}

    void judge(const std::string& name) {
        const Mesh mesh = readMesh(meshPath(name));
        const test::Truth truth(mesh);
        for (const Case& c : cases(options_)) judge(name, mesh, truth, c);
    }

    const std::vector<Builder>& builders() const { return builders_; }
    const std::vector<Row>& rows() const { return rows_; }
    bool exact() const { return exact_; }

  private:
    void judge(const std::string& name, const Mesh& mesh, const test::Truth& truth, const Case& c) {
        const float voxelSize = voxelSizeFor(mesh, c.resolution);
        const auto signs = options_.unsignedOnly ? test::Signs::ignored : test::Signs::judged;
        std::vector<test::TrueVoxel> voxels;
        for (const Builder& builder : builders_) {
            const bool tested = &builder == &builders_.front();
            if (!tested && !c.peers) break;
            const auto grid = builder.grid(mesh, voxelSize, c.band);
            if (tested)
                voxels = test::trueVoxels(
                    truth, test::chooseVoxels(*grid, mesh, c.band, options_.samples, options_.seed), voxelSize);
            rows_.push_back(
                {name, c.name(), builder.name, mesh.triangles.size(), test::judge(*grid, c.band, voxels, signs)});
            report(rows_.back(), tested);
        }
    }

    void report(const Row& row, bool tested) {
        if (!options_.json) print(row);
        if (!tested || row.verdict.exact()) return;
        exact_ = false;
        for (const test::Witness& witness : row.verdict.witnesses)
            fmt::print(stderr, "{} {}: {}\n", row.mesh, row.grid, witness.text());
    }

    Options options_;
    std::vector<Builder> builders_;
    std::vector<Row> rows_;
    bool exact_ = true;
};

int run(int argc, char** argv) {
    CLI::App app("Judges fields of bilayer and OpenVDB voxel by voxel against exact distances and winding numbers.");
    Options options;
    app.add_option("--mesh", options.meshes, "mesh files or names in the corpus; by default all clean ones");
    app.add_option("--resolution", options.resolutions, "voxels along the longest side");
    app.add_option("--half-width", options.bands, "half width of the band [voxels]: W, or EXTERIOR/INTERIOR");
    app.add_option("--method", options.method, "the method under test")
        ->check(CLI::IsMember(methods))
        ->capture_default_str();
    app.add_option("--samples", options.samples, "active voxels to check; smaller grids are checked whole")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app.add_option("--seed", options.seed, "seed of the choice of voxels")->capture_default_str();
    app.add_option("--markdown", options.markdownFile, "also write the tables to this file");
    app.add_flag("--json", options.json, "print one JSON array and nothing else");
    app.add_flag("--unsigned", options.unsignedOnly,
                 "judge distances and the band only: for meshes that bound no solid, with equal widths");
    app.add_flag("--alone", options.alone, "leave out the peers");
    CLI11_PARSE(app, argc, argv);

    openvdb::initialize();
    if (!options.json) {
        fmt::print("seed {}\n", options.seed);
        printHeader();
    }
    Run run(options);
    for (const std::string& name : options.meshes.empty() ? test::cleanMeshes() : options.meshes) run.judge(name);
    const std::vector<Row> sums = totals(run.rows());
    if (options.json) {
        fmt::print("{}\n", json(run.rows()).dump());
    } else {
        fmt::print("\n");
        printHeader();
        for (const Row& row : sums) print(row);
    }
    if (!options.markdownFile.empty()) std::ofstream(options.markdownFile) << markdown(run.rows(), run.builders());
    return run.exact() ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("accuracy", run, argc, argv);
}
