// SPDX-License-Identifier: Apache-2.0
// `bilayer batch`: a library of meshes becomes a folder of fields.
// Tested by tests/tools/batch.cpp through the program.
#include <fmt/format.h>
#include <sched.h>
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "sdf/base/openvdb.h"
#include "sdf/base/usable_memory.h"
#include "tools/batch/batch_folder.h"
#include "tools/batch/mesh_list.h"
#include "tools/batch/report.h"
#include "tools/batch/scheduler.h"
#include "tools/batch/shard.h"
#include "tools/build.h"
#include "tools/commands.h"
#include "tools/output.h"

namespace bilayer::tools {
namespace {

// Share of the machine's memory that all small meshes together may need, by their estimates. The rest is for what the
// estimate leaves out: meshes, program, compressed files.
constexpr double memoryShare = 0.5;
// Options of a build that change no byte of the field.
const std::set<std::string> speedOptions{"--threads", "--mapping", "--device-memory"};

struct BatchArguments {
    std::vector<std::filesystem::path> meshes;
    std::filesystem::path list, tree, output, report;
    std::string shard;
    double timeLimit = 0;                            // [s]; 0: none
    std::uint64_t memoryLimit = 0, largeMemory = 0;  // [MiB]; 0: none, default
    BuildArguments build;
    CLI::Option* reportGiven = nullptr;
    std::vector<CLI::Option*> sources, buildOptions;
    bool json = false;
};

// All options of a command, those of its groups included.
std::vector<CLI::Option*> optionsOf(CLI::App& command) {
    std::vector<CLI::Option*> options = command.get_options();
    for (CLI::App* group : command.get_subcommands([](CLI::App*) { return true; }))
        for (CLI::Option* option : optionsOf(*group)) options.push_back(option);
    return options;
}

// Returns the version and the given options that determine a field, in the order of their names.
std::string optionsText(const BatchArguments& a) {
    std::set<std::string> words;
    for (const CLI::Option* option : a.buildOptions)
        if (option->count() && !speedOptions.contains(option->get_name()))
            words.insert(fmt::format("{}={}", option->get_name(), fmt::join(option->results(), " ")));
    if (a.build.report) words.insert("--inspect");
    return fmt::format("bilayer {} {}", BILAYER_VERSION, fmt::join(words, " "));
}

void requireUsage(const BatchArguments& a) {
    const auto given = [](const CLI::Option* option) { return option->count() > 0; };
    if (std::count_if(a.sources.begin(), a.sources.end(), given) != 1)
        throw CLI::ValidationError("batch", "needs meshes, or one of --list and --tree");
    if (a.output.empty()) throw CLI::ValidationError("--output", "is required: the folder of the fields");
    if (a.build.options.voxelSize == 0 && !a.build.resolutionGiven->count())
        throw CLI::ValidationError("batch", "needs one of --voxel-size and --resolution");
}

Shard chosenShard(const BatchArguments& a) {
    return a.shard.empty() ? slurmShard().value_or(Shard{}) : parseShard(a.shard, "--shard");
}

std::vector<BatchMesh> listedMeshes(const BatchArguments& a) {
    if (!a.tree.empty()) return meshesInTree(a.tree);
    return meshesOf(a.list.empty() ? a.meshes : pathsInList(a.list));
}

int threadCount(const BatchArguments& a) {
    if (a.build.options.threads > 0) return a.build.options.threads;
    cpu_set_t usable;  // of this process, which a job scheduler may have limited
    return ::sched_getaffinity(0, sizeof usable, &usable) == 0 ? CPU_COUNT(&usable) : 1;
}

std::uint64_t largeBytes(const BatchArguments& a, int threads) {
    if (a.largeMemory > 0) return a.largeMemory << 20;
    return std::uint64_t(memoryShare * detail::usableMemory() / threads);
}

void printResult(const BatchPlan& plan, const BatchResult& result, double seconds) {
    const BatchCounts& counts = result.counts;
    Table table(plan.folder.root().string());
    table.row("meshes", fmt::format("{} in shard {}", grouped(counts.total), plan.shard.text()));
    table.row("done", grouped(counts.done));
    table.row("skipped", fmt::format("{}: up to date", grouped(counts.skipped)));
    table.row("failed", grouped(counts.failed));
    table.row("time", fmt::format("{:.3f} s", seconds));
    table.row("records", plan.folder.records().string());
    table.print();
}

// Ends the process as the signal would have ended it.
void endBy(int signal) {
    ::signal(signal, SIG_DFL);
    ::raise(signal);
}

void convertAll(BatchArguments& a) {
    requireUsage(a);
    checkBuildOptions(a.build);
    const Shard shard = chosenShard(a);
    const int threads = threadCount(a);
    const BatchPlan plan{.meshes = shardOf(listedMeshes(a), shard),
                         .folder = BatchFolder(a.output),
                         .shard = shard,
                         .conversion = {a.build, optionsText(a), largeBytes(a, threads)},
                         .limits = {std::chrono::milliseconds(std::llround(1000 * a.timeLimit)), a.memoryLimit << 20},
                         .threads = threads,
                         .printsLines = a.json};
    plan.folder.create();
    openvdb::initialize();  // once, instead of in each worker
    const Stopwatch watch;
    const BatchResult result = runBatch(plan);
    if (result.signal) return endBy(result.signal);
    if (!a.json) printResult(plan, result, watch.seconds());
    if (result.counts.failed)
        throw std::runtime_error(fmt::format("{} of {} meshes failed, the first of them {} (see {} for all failures)",
                                             result.counts.failed, result.counts.total, result.firstFailure,
                                             plan.folder.records().string()));
}

void run(CLI::App& command, BatchArguments& a) {
    if (!a.reportGiven->count()) return convertAll(a);
    for (const CLI::Option* option : optionsOf(command))
        if (option->count() && option != a.reportGiven && option->get_name() != "--json")
            throw CLI::ValidationError("--report", "excludes " + option->get_name());
    reportBatch(BatchFolder(a.report), a.json);
}

void addSources(CLI::App& command, BatchArguments& a) {
    a.sources = {command.add_option("meshes", a.meshes, "mesh files: OBJ, PLY, STL, OFF, glTF, ..."),
                 command.add_option("--list", a.list, "a text file with one mesh file a line; - is standard input"),
                 command.add_option("--tree", a.tree, "a folder: all mesh files in it and in its subfolders")
                     ->check(CLI::ExistingDirectory)};
    command.add_option("-o,--output", a.output, "the folder for fields and records; a/b.obj becomes a/b.obj.vdb in it");
    command.add_option("--shard", a.shard,
                       "convert share I/N of the meshes, I in 1..N; default that of the Slurm array task, or all");
}

void addLimits(CLI::App& command, BatchArguments& a) {
    command.add_option("--time-limit", a.timeLimit, "stop the conversion of a mesh after this time [s]")
        ->check(within(1e-3, 1e6));
    const CLI::Range mebibytes(std::uint64_t(1), std::uint64_t(1) << 30);
    command
        .add_option("--memory-limit", a.memoryLimit,
                    "stop the conversion of a mesh that allocates more memory than this [MiB]")
        ->check(mebibytes);
    command
        .add_option("--large-memory", a.largeMemory,
                    "build a mesh alone, by all threads, if its build needs more memory than this by estimate [MiB]; "
                    "default half of what the process may use, divided by --threads")
        ->check(mebibytes);
}

}  // namespace

void addBatch(CLI::App& app) {
    auto* command = app.add_subcommand("batch", "Build the fields of a library of meshes, in processes of their own");
    const auto a = std::make_shared<BatchArguments>();
    addSources(*command, *a);
    addLimits(*command, *a);
    const std::vector<CLI::Option*> before = optionsOf(*command);
    addBuildOptions(*command, a->build)->require_option(0, 1);
    for (CLI::Option* option : optionsOf(*command))
        if (std::find(before.begin(), before.end(), option) == before.end()) a->buildOptions.push_back(option);
    command->add_flag("--inspect", a->build.report,
                      "also inspect each mesh, as the command inspect does; records then hold its defects");
    command->add_flag("--json", a->json, "print the records instead of a table, one JSON object a line");
    a->reportGiven = command->add_option("--report", a->report,
                                         "instead: report on the records in an output folder, as text and report.html");
    command->callback([a, command] { run(*command, *a); });
}

}  // namespace bilayer::tools
