// SPDX-License-Identifier: Apache-2.0
// A library of small meshes: `bilayer batch` on one core and on several, compared with a loop of single builds and with
// GNU parallel.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh_io.h>
#include "bench/command.h"
#include "bench/measure.h"
#include "bench/program.h"
#include "demos/shared/shapes.h"

using namespace bilayer;
using namespace bilayer::bench;

namespace {

namespace fs = std::filesystem;

struct BatchBenchOptions {
    int meshes = 500, resolution = 48, threads = 2, rounds = 3;
    fs::path bilayer;  // path of the command line program
};

using Words = std::vector<std::string>;

// What one way to convert the library took.
struct Conversion {
    std::string name;
    std::vector<double> seconds;  // one entry a round
    // Time of a mesh in addition to reading, building and writing [s]; for the batch on one core.
    std::vector<double> overhead;
};

// The seconds that a command takes; throws with its first line of errors if it fails.
double timed(const Words& words, const fs::path& scratch) {
    const CommandResult run = runCommand(words, scratch);
    if (run.succeeded) return run.seconds;
    throw std::runtime_error(fmt::format("{} failed: {}", words[0], run.errors.substr(0, run.errors.find('\n'))));
}

// Closed bodies of 200 to 20,000 triangles.
Mesh bodyOf(int index) {
    const float size = 0.5f + 0.001f * float(index);
    switch (index % 4) {
        case 0:
            return shapes::box({size, 0.7f * size, 0.4f * size}, 4 + index % 37);
        case 1:
            return shapes::sphere(size, 3 + index % 3);
        case 2:
            return shapes::torus(size, 0.3f * size, 24 + index % 120, 12 + index % 60);
        default:
            return shapes::cylinder(0.6f * size, size, 50 + index % 900);
    }
}

std::vector<fs::path> makeLibrary(const fs::path& folder, int count) {
    fs::create_directories(folder);
    std::vector<fs::path> files;
    for (int i = 0; i < count; ++i) {
        files.push_back(folder / fmt::format("{:04}.ply", i));
        writeMesh(files.back(), bodyOf(i));
    }
    return files;
}

// The seconds of reading, building and writing in the records of a batch, summed.
double buildSeconds(const fs::path& output) {
    double sum = 0;
    for (const auto& entry : fs::directory_iterator(output / ".bilayer/records")) {
        std::ifstream stream(entry.path());
        for (std::string line; std::getline(stream, line);) {
            const nlohmann::json seconds = nlohmann::json::parse(line).at("seconds");
            for (const char* part : {"read", "inspect", "build", "write"}) sum += seconds.at(part).get<double>();
        }
    }
    return sum;
}

class BatchBench {
  public:
    BatchBench(const BatchBenchOptions& options, const fs::path& scratch)
        : options_(options), scratch_(scratch), files_(makeLibrary(scratch / "library", options.meshes)) {}

    void round() {
        batch("batch, 1 core", 1);
        batch(fmt::format("batch, {} cores", options_.threads), options_.threads);
        separate(fmt::format("{} batches at once, each a shard on 1 core", options_.threads));
        batch(fmt::format("batch, {} cores, all up to date", options_.threads), options_.threads, /*isAgain=*/true);
        loop("loop of build, all threads", options_.threads);
        loop("loop of build, 1 thread", 1);
        parallel(fmt::format("GNU parallel -j{} of build, 1 thread", options_.threads));
    }

    void print() const {
        const double one = median(conversions_.front().seconds);
        fmt::print("| {} meshes, {} voxels | seconds, median | min | max | ms a mesh | times as fast as 1 core |\n",
                   options_.meshes, options_.resolution);
        fmt::print("|---|---|---|---|---|---|\n");
        for (const Conversion& c : conversions_) {
            const double seconds = median(c.seconds);
            const auto [low, high] = std::minmax_element(c.seconds.begin(), c.seconds.end());
            fmt::print("| {} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} |\n", c.name, seconds, *low, *high,
                       1e3 * seconds / options_.meshes, one / seconds);
        }
        fmt::print("\nOverhead of a mesh in addition to reading, building and writing, batch on 1 core: {:.2f} ms\n",
                   1e3 * median(conversions_.front().overhead));
    }

  private:
    Conversion& of(const std::string& name) {
        const auto found =
            std::find_if(conversions_.begin(), conversions_.end(), [&](const Conversion& c) { return c.name == name; });
        return found != conversions_.end() ? *found : conversions_.emplace_back(Conversion{name, {}, {}});
    }

    Words batchCommand(const fs::path& output, int threads) const {
        return {options_.bilayer,        "batch",        "--tree",    scratch_ / "library", "-o", output, "--threads",
                std::to_string(threads), "--resolution", resolution()};
    }

    std::string resolution() const { return std::to_string(options_.resolution); }

    void batch(const std::string& name, int threads, bool isAgain = false) {
        if (!isAgain) fields_ = newFolder();
        const double seconds = timed(batchCommand(fields_, threads), scratch_);
        Conversion& conversion = of(name);
        conversion.seconds.push_back(seconds);
        if (threads == 1) conversion.overhead.push_back((seconds - buildSeconds(fields_)) / options_.meshes);
    }

    // Programs that share nothing: the bound that this machine sets to a batch on as many cores.
    void separate(const std::string& name) {
        const fs::path output = newFolder();
        std::vector<std::future<double>> shards;
        for (int i = 1; i <= options_.threads; ++i) {
            const fs::path own = output / std::to_string(i);
            fs::create_directories(own);
            Words words = batchCommand(own / "fields", 1);
            words.insert(words.end(), {"--shard", fmt::format("{}/{}", i, options_.threads)});
            shards.push_back(std::async(std::launch::async, [=] { return timed(words, own); }));
        }
        double longest = 0;
        for (auto& shard : shards) longest = std::max(longest, shard.get());
        of(name).seconds.push_back(longest);
    }

    void loop(const std::string& name, int threads) {
        const fs::path output = newFolder();
        double seconds = 0;
        for (const fs::path& file : files_)
            seconds += timed({options_.bilayer, "build", file, "-o", output / (file.filename().string() + ".vdb"),
                              "--threads", std::to_string(threads), "--resolution", resolution()},
                             scratch_);
        of(name).seconds.push_back(seconds);
    }

    void parallel(const std::string& name) {
        if (std::system("command -v parallel >/dev/null 2>&1") != 0) {
            fmt::print(stderr, "GNU parallel is not installed (package parallel): left out\n");
            return;
        }
        const fs::path output = newFolder(), list = scratch_ / "list.txt";
        std::ofstream stream(list);
        for (const fs::path& file : files_) stream << file.string() << "\n";
        stream.close();
        of(name).seconds.push_back(
            timed({"parallel", "--will-cite", "-j", std::to_string(options_.threads), "-a", list, options_.bilayer,
                   "build", "{}", "-o", (output / "{/}.vdb").string(), "--threads", "1", "--resolution", resolution()},
                  scratch_));
    }

    // All are removed at the end: for some seconds after files were removed, ext4 takes longer to create others.
    fs::path newFolder() {
        const fs::path folder = scratch_ / fmt::format("fields-{}", folders_++);
        fs::create_directories(folder);
        return folder;
    }

    const BatchBenchOptions& options_;
    const fs::path& scratch_;
    std::vector<fs::path> files_;
    std::vector<Conversion> conversions_;
    int folders_ = 0;  // that were made
    fs::path fields_;  // of the last batch
};

int run(int argc, char** argv) {
    BatchBenchOptions options;
    options.bilayer = fs::read_symlink("/proc/self/exe").parent_path() / "bilayer";
    CLI::App app("A library of small meshes by bilayer batch, by single builds and by GNU parallel.", "bench_batch");
    app.add_option("--meshes", options.meshes, "count of meshes, default 500")->check(CLI::Range(1, 100000));
    app.add_option("--resolution", options.resolution, "voxels along the longest side, default 48")
        ->check(CLI::Range(8, 4096));
    app.add_option("--threads", options.threads, "cores, default 2")->check(CLI::Range(2, 1024));
    app.add_option("--rounds", options.rounds,
                   "runs of each, which take turns, default 3; a round leaves 0.7 GB until the end")
        ->check(CLI::Range(1, 100));
    app.add_option("--bilayer", options.bilayer, "the command line, default in this program's folder")
        ->check(CLI::ExistingFile);
    CLI11_PARSE(app, argc, argv);
    const fs::path scratch = fs::temp_directory_path() / fmt::format("bilayer-bench-batch-{}", ::getpid());
    BatchBench bench(options, scratch);
    for (int i = 0; i < options.rounds; ++i) bench.round();
    bench.print();
    fs::remove_all(scratch);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return program("batch", run, argc, argv);
}
