// SPDX-License-Identifier: Apache-2.0
// Prints hashes of the fields of a folder of meshes, for every method and sign option. Two versions of the library with
// the same output build the same fields.
#include <fmt/format.h>
#include <openvdb/tree/LeafManager.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "bench/builders.h"
#include "bench/program.h"
#include "sdf/base/openvdb.h"

using namespace bilayer;

namespace {

namespace fs = std::filesystem;

struct Options {
    fs::path meshes = bench::corpusFolder();
    float resolution = 64;  // voxels along the longest side
    int threads = 0;
};

struct Mode {
    const char* name;
    Method method;
    Sign sign;
    bool unite = false;
};

constexpr Mode modes[] = {{"exact auto", Method::exact, Sign::automatic},
                          {"exact normals", Method::exact, Sign::normals},
                          {"exact winding", Method::exact, Sign::winding},
                          {"exact flood", Method::exact, Sign::flood},
                          {"exact auto union", Method::exact, Sign::automatic, true},
                          {"pseudonormal auto", Method::pseudonormal, Sign::automatic},
                          {"pseudonormal normals", Method::pseudonormal, Sign::normals},
                          {"pseudonormal winding", Method::pseudonormal, Sign::winding},
                          {"pseudonormal flood", Method::pseudonormal, Sign::flood},
                          {"double-layer", Method::doubleLayer, Sign::automatic}};

// FNV-1a (G. Fowler, L. C. Noll, P. Vo).
class Hash {
  public:
    void add(const void* data, std::size_t size) {
        const auto* bytes = static_cast<const unsigned char*>(data);
        for (std::size_t i = 0; i < size; ++i) value_ = (value_ ^ bytes[i]) * 0x100000001b3u;
    }
    template <class Value>
    void add(const Value& value) {
        add(&value, sizeof value);
    }

    std::uint64_t value() const { return value_; }

  private:
    std::uint64_t value_ = 0xcbf29ce484222325u;
};

// Hashes values and states of all voxels of leaves, and of all tiles.
template <class Grid>
void add(Hash& hash, const Grid& grid) {
    hash.add(grid.background());
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) {
        hash.add(leaf->origin().asPointer(), 3 * sizeof(openvdb::Int32));
        for (auto value = leaf->cbeginValueAll(); value; ++value) {
            hash.add(*value);
            hash.add(value.isValueOn());
        }
    }
    auto tile = grid.tree().cbeginValueAll();
    tile.setMaxDepth(Grid::TreeType::ValueAllCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
        hash.add(*tile);
        hash.add(tile.isValueOn());
    }
}

std::uint64_t hashOf(const LevelSet& field) {
    Hash hash;
    add(hash, *field.grids().distance);
    add(hash, *field.grids().triangle);
    for (const std::string& word : {field.sign(), field.method()}) hash.add(word.data(), word.size());
    hash.add(field.signConflicts());
    hash.add(field.errorBound());
    hash.add(field.meshHash());
    return hash.value();
}

std::vector<fs::path> filesIn(const fs::path& folder) {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder))
        if (entry.is_regular_file()) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    return files;
}

std::string outcome(const Mesh& mesh, const Mode& mode, const Options& options) {
    try {
        const LevelSet field = build(mesh, {.voxelSize = voxelSizeFor(mesh, options.resolution),
                                            .method = mode.method,
                                            .sign = mode.sign,
                                            .unite = mode.unite,
                                            .triangles = true,
                                            .threads = options.threads});
        return fmt::format("{:016x}", hashOf(field));
    } catch (const std::invalid_argument&) {
        return "refused";
    }
}

void print(const fs::path& file, const Options& options) {
    Mesh mesh;
    try {
        mesh = readMesh(file);
    } catch (const std::exception&) {
        fmt::print("{}: not readable\n", file.filename().string());
        return;
    }
    fmt::print("{}: mesh {:016x}\n", file.filename().string(), hash(mesh));
    for (const Mode& mode : modes)
        fmt::print("{}: {} {}\n", file.filename().string(), mode.name, outcome(mesh, mode, options));
}

int run(int argc, char** argv) {
    Options options;
    CLI::App app("Hashes of the fields of all meshes of a folder, by every method and sign option.");
    app.add_option("--meshes", options.meshes, "folder of the meshes")->check(CLI::ExistingDirectory);
    app.add_option("--resolution", options.resolution, "voxels along the longest side")->capture_default_str();
    app.add_option("--threads", options.threads, "maximum count of threads; 0: all")->check(CLI::Range(0, 1024));
    CLI11_PARSE(app, argc, argv);
    for (const fs::path& file : filesIn(options.meshes)) print(file, options);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("hashes", run, argc, argv);
}
