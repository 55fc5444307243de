// SPDX-License-Identifier: Apache-2.0
// From mesh file to field file: compares whole commands in cold processes with the same by OpenVDB, and reading alone
// with Assimp.
#include <fmt/format.h>
#include <openvdb/io/File.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/Importer.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh_io.h>
#include "bench/builders.h"
#include "bench/command.h"
#include "bench/measure.h"
#include "bench/program.h"
#include "bench/ratios.h"
#include "sdf/base/openvdb.h"

using namespace bilayer;
using namespace bilayer::bench;

namespace {

namespace fs = std::filesystem;

struct Options {
    std::vector<std::string> meshes{"bunny", "dragon", "armadillo", "screwdriver", "fandisk", "carved box"};
    std::vector<std::string> formats{"ply", "ascii-ply", "obj", "stl"};
    int resolution = 251, threads = 2, rounds = 5;
    fs::path bilayer;  // path of the command line program
    // one task that this program runs in its own process
    std::string work, mesh, output;
};

using Words = std::vector<std::string>;

// Writes text PLY, which the project itself does not.
void writeText(const fs::path& path, const Mesh& mesh) {
    std::ofstream file(path);
    file << fmt::format(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
        "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.points.size(), mesh.triangles.size());
    for (const glm::vec3& p : mesh.points) file << fmt::format("{} {} {}\n", p.x, p.y, p.z);
    for (const glm::uvec3& t : mesh.triangles) file << fmt::format("3 {} {} {}\n", t.x, t.y, t.z);
}

fs::path writeAs(const std::string& format, const std::string& name, const Mesh& mesh, const fs::path& scratch) {
    std::string plain = name;
    std::replace(plain.begin(), plain.end(), ' ', '_');
    const bool isText = format == "ascii-ply";
    const fs::path path = scratch / fmt::format("{}{}.{}", plain, isText ? "-text" : "", isText ? "ply" : format);
    if (isText)
        writeText(path, mesh);
    else
        writeMesh(path, mesh);
    return path;
}

/// The steps of a program on top of OpenVDB: read by Assimp, fill by meshToVolume, write.
const aiScene* readByAssimp(Assimp::Importer& importer, const std::string& path) {
    const aiScene* scene = importer.ReadFile(path, aiProcess_Triangulate | aiProcess_JoinIdenticalVertices);
    if (!scene) throw std::runtime_error(importer.GetErrorString());
    return scene;
}

void buildByOpenVdb(const Options& options) {
    openvdb::initialize();
    Assimp::Importer importer;
    const aiScene* scene = readByAssimp(importer, options.mesh);
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    openvdb::Vec3s lower(1e30f), upper(-1e30f);
    for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
        const aiMesh& part = *scene->mMeshes[m];
        const auto base = openvdb::Index32(points.size());
        for (unsigned i = 0; i < part.mNumVertices; ++i) {
            points.emplace_back(part.mVertices[i].x, part.mVertices[i].y, part.mVertices[i].z);
            lower = openvdb::math::minComponent(lower, points.back());
            upper = openvdb::math::maxComponent(upper, points.back());
        }
        for (unsigned i = 0; i < part.mNumFaces; ++i) {
            const unsigned* corners = part.mFaces[i].mIndices;
            triangles.emplace_back(base + corners[0], base + corners[1], base + corners[2]);
        }
    }
    const openvdb::Vec3s size = upper - lower;
    const double voxel = double(std::max({size.x(), size.y(), size.z()})) / options.resolution;
    const auto grid = openvdb::tools::meshToLevelSet<openvdb::FloatGrid>(
        *openvdb::math::Transform::createLinearTransform(voxel), points, triangles, 3);
    openvdb::io::File(options.output).write({grid});
}

// Prints the seconds of reading, without the start of the program.
void readOnly(const Options& options, bool byAssimp) {
    const Stopwatch watch;
    if (byAssimp) {
        Assimp::Importer importer;
        readByAssimp(importer, options.mesh);
        fmt::print("{}\n", watch.seconds());
    } else {
        const Mesh mesh = readMesh(options.mesh);
        fmt::print("{}\n", watch.seconds());
    }
    std::fflush(stdout);
    std::_Exit(0);
}

/// The alternatives for file to file and for reading, and their times.
struct Contest {
    std::map<std::string, std::vector<double>> seconds;
    std::map<std::string, std::vector<double>> parts;  // of our command
};

Contest contest(const Options& options, const fs::path& mesh, const fs::path& scratch) {
    const std::string self = fs::read_symlink("/proc/self/exe"), out = scratch / "field.vdb";
    const std::string resolution = std::to_string(options.resolution), threads = std::to_string(options.threads);
    const auto itself = [&](const char* work) {
        return Words{self, "--work",       work,       "--mesh",    mesh,   "--output",
                     out,  "--resolution", resolution, "--threads", threads};
    };
    const std::map<std::string, Words> readers{
        {"bilayer",
         {options.bilayer, "build", mesh, "-o", out, "--resolution", resolution, "--threads", threads, "--json"}},
        {"vdb_tool", {"vdb_tool", "-read", mesh, "-mesh2ls", "dim=" + resolution, "-write", out}},
        {"Assimp + OpenVDB", itself("build")},
        {"read, bilayer", itself("read")},
        {"read, Assimp", itself("read-assimp")}};
    Contest result;
    for (int round = 0; round < options.rounds; ++round)
        for (const auto& [name, words] : readers) {
            std::error_code ignored;
            fs::remove(out, ignored);
            const CommandResult run = runCommand(words, scratch);
            if (!run.succeeded) continue;
            const bool isRead = name.starts_with("read");
            result.seconds[name].push_back(isRead ? std::stod(run.output) : run.seconds);
            if (name != "bilayer") continue;
            const auto json = nlohmann::json::parse(run.output);
            double rest = run.seconds;
            for (const char* part : {"read", "build", "inspect", "write"}) {
                result.parts[part].push_back(json["seconds"][part]);
                rest -= json["seconds"][part].get<double>();
            }
            result.parts["start and end"].push_back(rest);
        }
    return result;
}

double ratio(const Contest& c, const std::string& rival, const std::string& ours) {
    const auto a = c.seconds.find(rival), b = c.seconds.find(ours);
    return a == c.seconds.end() || b == c.seconds.end() ? std::nan("") : median(a->second) / median(b->second);
}

std::string cell(double value, int digits) {
    return std::isnan(value) ? "fails" : fmt::format("{:.{}f}", value, digits);
}

double medianOf(const Contest& c, const std::string& reader) {
    const auto found = c.seconds.find(reader);
    return found == c.seconds.end() ? std::nan("") : median(found->second);
}

/// Ratios over all meshes and formats, to be averaged.
struct Means {
    std::vector<double> vdbTool, assimpVdb;
    std::map<std::string, std::vector<double>> reading;  // by format

    static void add(std::vector<double>& to, double ratio) {
        if (!std::isnan(ratio)) to.push_back(ratio);
    }
};

void addRatio(const Contest& c, const std::string& what, const std::string& rival, const std::string& ours,
              Ratios& ratios) {
    const auto a = c.seconds.find(rival), b = c.seconds.find(ours);
    if (a != c.seconds.end() && b != c.seconds.end()) ratios.add(what + ours + " / " + rival, a->second, b->second);
}

void measure(const Options& options, const fs::path& scratch, Ratios& ratios) {
    Means means;
    fmt::print(
        "Medians of {} runs of whole commands on {} threads, the page cache warm; {} voxels along the longest "
        "side.\n\n",
        options.rounds, options.threads, options.resolution);
    fmt::print(
        "| mesh | format | MB | bilayer build [s] | read | build | glance | write | rest [%] | vdb_tool "
        "[s] | ratio "
        "| Assimp + OpenVDB [s] | ratio | read [ms] | Assimp [ms] | ratio |\n"
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (const std::string& name : options.meshes) {
        const Mesh mesh = scene(findSource(name), float(options.resolution)).mesh;
        for (const std::string& format : options.formats) {
            const fs::path path = writeAs(format, name, mesh, scratch);
            const Contest c = contest(options, path, scratch);
            const double whole = medianOf(c, "bilayer");
            fmt::print("| {} | {} | {:.1f} | {} |", name, format, double(fs::file_size(path)) / 1e6, cell(whole, 3));
            for (const char* part : {"read", "build", "inspect", "write", "start and end"}) {
                const auto found = c.parts.find(part);
                fmt::print(" {} |", found == c.parts.end()
                                        ? "fails"
                                        : fmt::format("{:.0f}", 100 * median(found->second) / whole));
            }
            fmt::print(" {} | {} | {} | {} | {} | {} | {} |\n", cell(medianOf(c, "vdb_tool"), 3),
                       cell(ratio(c, "vdb_tool", "bilayer"), 1), cell(medianOf(c, "Assimp + OpenVDB"), 3),
                       cell(ratio(c, "Assimp + OpenVDB", "bilayer"), 1), cell(1e3 * medianOf(c, "read, bilayer"), 1),
                       cell(1e3 * medianOf(c, "read, Assimp"), 1), cell(ratio(c, "read, Assimp", "read, bilayer"), 1));
            std::fflush(stdout);
            const std::string what = fmt::format("{}, {}: ", name, format);
            addRatio(c, what, "vdb_tool", "bilayer", ratios);
            addRatio(c, what, "Assimp + OpenVDB", "bilayer", ratios);
            addRatio(c, what, "read, Assimp", "read, bilayer", ratios);
            Means::add(means.vdbTool, ratio(c, "vdb_tool", "bilayer"));
            Means::add(means.assimpVdb, ratio(c, "Assimp + OpenVDB", "bilayer"));
            Means::add(means.reading[format], ratio(c, "read, Assimp", "read, bilayer"));
            fs::remove(path);
        }
    }
    fmt::print("\nGeometric means of the ratios: vdb_tool {:.1f}, Assimp with OpenVDB {:.1f}",
               geometricMean(means.vdbTool), geometricMean(means.assimpVdb));
    for (const auto& [format, ratios] : means.reading)
        fmt::print(", reading {} compared with Assimp {:.1f}", format, geometricMean(ratios));
    fmt::print("\n");
}

int run(int argc, char** argv) {
    Options options;
    options.bilayer = fs::read_symlink("/proc/self/exe").parent_path() / "bilayer";
    CLI::App app("From mesh file to field file, compared with vdb_tool, Assimp with OpenVDB, and Assimp alone.",
                 "bench_files");
    app.add_option("--meshes", options.meshes, "mesh names or files");
    app.add_option("--formats", options.formats, "ply, ascii-ply, obj, stl")
        ->check(CLI::IsMember({"ply", "ascii-ply", "obj", "stl"}));
    app.add_option("--resolution", options.resolution, "voxels along the longest side, default 251")
        ->check(CLI::Range(8, 4096));
    app.add_option("--threads", options.threads, "default 2; vdb_tool uses all")->check(CLI::Range(1, 1024));
    app.add_option("--rounds", options.rounds, "runs of each command, default 5")->check(CLI::Range(1, 1000));
    app.add_option("--bilayer", options.bilayer, "the command line, default in this program's folder")
        ->check(CLI::ExistingFile);
    auto* work = app.add_option("--work", options.work, "used by this program itself: build, read or read-assimp")
                     ->check(CLI::IsMember({"build", "read", "read-assimp"}));
    app.add_option("--mesh", options.mesh)->needs(work);
    app.add_option("--output", options.output)->needs(work);
    Ratios ratios("files");
    ratios.addOption(app);
    CLI11_PARSE(app, argc, argv);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(options.threads));
    if (options.work == "build") return buildByOpenVdb(options), 0;
    if (!options.work.empty()) return readOnly(options, options.work == "read-assimp"), 0;
    const fs::path scratch = fs::temp_directory_path() / fmt::format("bilayer-bench-files-{}", ::getpid());
    fs::create_directories(scratch);
    measure(options, scratch, ratios);
    fs::remove_all(scratch);
    ratios.write();
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return program("files", run, argc, argv);
}
