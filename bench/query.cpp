// SPDX-License-Identifier: Apache-2.0
// Compares queries on the same field in one run: the field, OpenVDB, NanoVDB and Embree. All answers are compared
// first; then the peers take turns. Prints median nanoseconds per query next to the bound from the machine's memory
// bandwidth.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <limits>
#include <nlohmann/json.hpp>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "bench/bandwidth.h"
#include "bench/builders.h"
#include "bench/embree.h"
#include "bench/measure.h"
#include "bench/peers.h"
#include "bench/program.h"
#include "bench/questions.h"
#include "bench/race.h"
#include "collider/field/layout/field_layout.h"
#include "sdf/base/openvdb.h"

using namespace bilayer;
using namespace bilayer::detail;
using namespace bilayer::bench;

namespace {

const std::string ours = "bilayer";
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr double tolerance = 1e-4;  // of distances [voxels]
// With 16 bits voxels are off by half a quantum of 9.2e-5 voxels, and differences of two voxels along each axis by a
// whole one.
constexpr double gradientTolerance = 2e-4;
// Rays hit the interpolant, not the triangles. Hits may differ for grazing rays, and by the interpolation error.
constexpr double missedAlike = 0.01, hitAlike = 0.5;  // fraction of rays; median difference [voxels]

struct Options {
    std::string mesh = "bunny", json;
    std::vector<float> resolutions{192, 922};  // OpenVDB grids of about 9 and 150 MB
    float halfWidth = 3;
    std::size_t points = 1000000, others = 200000;
    std::vector<int> threads{1, 2};
    int rounds = 5;
    unsigned seed = 1;
};

Sampler singleSamples(const std::string& name, const Field& field) {
    return {name, [field](std::span<const glm::vec3> points, std::span<Sample> samples) {
                for (std::size_t i = 0; i < points.size(); ++i) samples[i] = field.sample(points[i]);
            }};
}

Sampler keptBlockSamples(const std::string& name, const Field& field) {
    return {name, [field](std::span<const glm::vec3> points, std::span<Sample> samples) {
                FieldSampler sampler(field);
                for (std::size_t i = 0; i < points.size(); ++i) samples[i] = sampler.sample(points[i]);
            }};
}

Sampler batchedSamples(const std::string& name, const Field& field) {
    return {name,
            [field](std::span<const glm::vec3> points, std::span<Sample> samples) { field.sample(points, samples); }};
}

Closest singleClosest(const Field& field) {
    return {ours + " closest", [field](std::span<const glm::vec3> points, std::span<ClosestPoint> answers) {
                for (std::size_t i = 0; i < points.size(); ++i) answers[i] = field.closest(points[i]);
            }};
}

Closest batchedClosest(const Field& field) {
    return {ours + " closest, batched", [field](std::span<const glm::vec3> points, std::span<ClosestPoint> answers) {
                field.closest(points, answers);
            }};
}

RayCaster singleRays(const std::string& name, const Field& field) {
    return {name, [field](std::span<const Ray> rays, std::span<RayHit> hits) {
                for (std::size_t i = 0; i < rays.size(); ++i) hits[i] = field.raycast(rays[i]).value_or(missed);
            }};
}

template <class Question, class Answer>
std::vector<Answer> answersOf(const Peer<Question, Answer>& peer, const std::vector<Question>& questions) {
    std::vector<Answer> answers(questions.size());
    peer.answer(questions, answers);
    return answers;
}

void require(bool alike, const std::string& peer, const std::string& reference) {
    if (!alike) throw std::runtime_error(fmt::format("{} and {} disagree", peer, reference));
}

// The first peer is the reference.
void requireAlike(const std::vector<Sampler>& peers, const Questions<glm::vec3>& questions, float voxelSize) {
    const std::vector<Sample> truth = answersOf(peers.front(), questions.all);
    double value = 0, gradient = 0;  // maximum differences
    for (const Sampler& peer : peers) {
        const std::vector<Sample> samples = answersOf(peer, questions.all);
        for (std::size_t i = 0; i < samples.size(); ++i) {
            value = std::max<double>(value, std::abs(samples[i].distance - truth[i].distance) / voxelSize);
            gradient = std::max<double>(gradient, glm::distance(samples[i].gradient, truth[i].gradient));
        }
        require(value <= tolerance && gradient <= gradientTolerance, peer.name, peers.front().name);
    }
    fmt::print("{} samples agree to {:.1e} voxel, their gradients to {:.1e}\n", questions.order, value, gradient);
}

void requireAlike(const std::vector<Closest>& peers, const Questions<glm::vec3>& questions, float voxelSize) {
    const std::vector<ClosestPoint> truth = answersOf(peers.front(), questions.all);
    double worst = 0;  // of distances, and of positions that must be at that distance
    for (const Closest& peer : peers) {
        const std::vector<ClosestPoint> answers = answersOf(peer, questions.all);
        for (std::size_t i = 0; i < answers.size(); ++i) {
            const float distance = std::abs(answers[i].distance),
                        away = glm::distance(answers[i].position, questions.all[i]);
            worst = std::max<double>(worst, std::abs(distance - truth[i].distance) / voxelSize);
            worst = std::max<double>(worst, std::abs(away - distance) / voxelSize);
        }
        require(worst <= tolerance, peer.name, peers.front().name);
    }
    fmt::print("{} closest points agree to {:.1e} voxel\n", questions.order, worst);
}

void requireAlike(const std::vector<RayCaster>& peers, const Questions<Ray>& questions, float voxelSize) {
    const std::vector<RayHit> truth = answersOf(peers.front(), questions.all);
    for (const RayCaster& peer : peers) {
        const std::vector<RayHit> hits = answersOf(peer, questions.all);
        std::size_t unlike = 0, met = 0;
        std::vector<double> apart;
        for (std::size_t i = 0; i < hits.size(); ++i) {
            const bool hit = std::isfinite(hits[i].distance), hitInTruth = std::isfinite(truth[i].distance);
            met += hitInTruth;
            unlike += hit != hitInTruth;
            if (hit && hitInTruth) apart.push_back(std::abs(hits[i].distance - truth[i].distance) / voxelSize);
        }
        fmt::print("{} rays of {}: {:.0f} % hit, {} of {} unlike, half of all hits within {:.1e} voxel\n",
                   questions.order, peer.name, 100. * double(met) / double(hits.size()), unlike, hits.size(),
                   median(apart));
        require(double(unlike) <= missedAlike * double(hits.size()) && median(apart) <= hitAlike, peer.name,
                peers.front().name);
    }
}

// Labels of one comparison.
struct Subject {
    std::string name;
    float voxelSize;  // [m]
};

// Compares the answers, times the peers in turns, and prints.
template <class Question, class Answer>
std::vector<Time> contest(const std::string& title, const std::vector<Peer<Question, Answer>>& peers,
                          const std::vector<Questions<Question>>& orders, const Subject& subject,
                          const Options& options, Ratios& ratios) {
    fmt::print("\n### {}\n\n", title);
    for (const auto& questions : orders) requireAlike(peers, questions, subject.voxelSize);
    const std::vector<Time> times = race(peers, orders, options.threads, options.rounds);
    addRatios(times, subject.name + ", " + title, ours, ratios);
    fmt::print("\n{}", table(times, ours));
    std::fflush(stdout);
    return times;
}

// Lower bound by memory. Random points fetch their cache lines one by one, many in flight; coherent points fetch each
// line once. Both add the stream of points, and of samples that are fetched and written back.
nlohmann::json floors(const LevelSet& levelSet, std::size_t fieldBytes, const std::vector<Questions<glm::vec3>>& orders,
                      const Options& options) {
    const Touched touched = linesTouched(FieldLayout(levelSet), orders.front().all);
    const double streamed = sizeof(glm::vec3) + 2 * sizeof(Sample);
    fmt::print(
        "\n### The floor\n\nA sample touches {:.2f} lines of {} bytes, and streams {:g}; coherent samples share "
        "lines: {:.2f} for each.\n\n",
        touched.linesEach, cacheLine, streamed, touched.linesShared);
    nlohmann::json result;
    for (const int threads : options.threads) {
        const double stream = streamBandwidth(threads), lines = randomLines(fieldBytes, threads);
        const double random = 1e9 * (touched.linesEach / lines + streamed / stream);
        const double coherent = 1e9 * (touched.linesShared * cacheLine + streamed) / stream;
        fmt::print(
            "{} thread{}: {:.1f} GB/s one after the other, {:.0f} million random lines/s within the field's "
            "bytes: at least {:.1f} ns a random sample, {:.1f} ns a coherent one\n",
            threads, threads > 1 ? "s" : "", stream / 1e9, lines / 1e6, random, coherent);
        result.push_back({{"threads", threads},
                          {"streamBytesPerSecond", stream},
                          {"randomLinesPerSecond", lines},
                          {"linesPerSample", touched.linesEach},
                          {"linesPerCoherentSample", touched.linesShared},
                          {"randomNanoseconds", random},
                          {"coherentNanoseconds", coherent}});
    }
    return result;
}

template <class Work>
double medianSeconds(int rounds, const Work& work) {
    std::vector<double> seconds;
    for (int round = 0; round < rounds; ++round) {
        const Stopwatch watch;
        work();
        seconds.push_back(watch.seconds());
    }
    return median(seconds);
}

nlohmann::json compare(const Source& source, float resolution, const Options& options, Ratios& ratios) {
    const Scene scene = bench::scene(source, resolution);
    const BuildOptions how{.voxelSize = scene.voxelSize,
                           .exteriorWidthVoxels = options.halfWidth,
                           .interiorWidthVoxels = options.halfWidth,
                           .triangles = true};
    const LevelSet levelSet = build(scene.mesh, how);
    const Field field(levelSet), small(levelSet, {.storage = Storage::fixed16}), withMesh(levelSet, scene.mesh);
    const auto grid = levelSet.grids().distance;
    const Nanovdb nanovdb(*grid);
    const Embree embree(scene.mesh, false), robust(scene.mesh, true);
    const double buildSeconds = medianSeconds(options.rounds, [&] { build(scene.mesh, how); });
    const double layoutSeconds = medianSeconds(options.rounds, [&] { Field again(levelSet); });
    const double meshSeconds = medianSeconds(options.rounds, [&] { Field again(levelSet, scene.mesh); });
    fmt::print("\n## {}, {:g} voxels, half width {:g}\n\n", scene.name, resolution, options.halfWidth);
    const auto part = [&](const Field& some) { return double(some.memoryBytes()) / double(nanovdb.bytes()); };
    fmt::print("Bytes: OpenVDB {}, NanoVDB {}, bilayer {} ({:.2f} of NanoVDB's), in 16 bits {} ({:.2f})\n",
               grid->memUsage(), nanovdb.bytes(), field.memoryBytes(), part(field), small.memoryBytes(), part(small));
    fmt::print(
        "Milliseconds: the level set {:.1f}, the field from it {:.1f} ({:.0f} %), with its mesh {:.1f} ({:.0f} %)\n",
        1e3 * buildSeconds, 1e3 * layoutSeconds, 100 * layoutSeconds / buildSeconds, 1e3 * meshSeconds,
        100 * meshSeconds / buildSeconds);

    const float voxelSize = levelSet.voxelSize();
    const Subject subject{fmt::format("{}, {:g} voxels", scene.name, resolution), voxelSize};
    const auto points = pointsInBand(field, levelSet, options.points, options.seed);
    const auto samples = contest<glm::vec3, Sample>(
        "Value and gradient",
        {openvdbSampler(grid), openvdbStencil(grid), openvdbCell(grid), nanovdb.sampler(),
         singleSamples(ours + " sample", field), keptBlockSamples(ours + " FieldSampler", field),
         batchedSamples(ours + " sample, batched", field), singleSamples(ours + " sample, 16 bits", small),
         keptBlockSamples(ours + " FieldSampler, 16 bits", small),
         batchedSamples(ours + " sample, 16 bits, batched", small)},
        points, subject, options, ratios);
    const nlohmann::json floor = floors(levelSet, field.memoryBytes(), points, options);
    const auto nearest = contest<glm::vec3, ClosestPoint>(
        "Closest point",
        {embree.closest("Embree rtcPointQuery", infinity),
         embree.closest("Embree rtcPointQuery, no farther than the band", options.halfWidth * voxelSize),
         singleClosest(withMesh), batchedClosest(withMesh)},
        pointsInBand(field, levelSet, options.others, options.seed), subject, options, ratios);
    const auto rays =
        contest<Ray, RayHit>("Rays",
                             {robust.rays(), openvdbRays(grid), singleRays(ours + " raycast, without the mesh", field),
                              singleRays(ours + " raycast", withMesh)},
                             raysOnto(field, options.others, options.seed), subject, options, ratios);
    return {{"mesh", scene.name},
            {"resolution", resolution},
            {"bytes",
             {{"openvdb", grid->memUsage()},
              {"nanovdb", nanovdb.bytes()},
              {"bilayer", field.memoryBytes()},
              {"bilayer16", small.memoryBytes()}}},
            {"seconds", {{"levelSet", buildSeconds}, {"field", layoutSeconds}, {"withMesh", meshSeconds}}},
            {"sample", toJson(samples)},
            {"floor", floor},
            {"closest", toJson(nearest)},
            {"raycast", toJson(rays)}};
}

int run(int argc, char** argv) {
    CLI::App app("Times queries of the field compared with OpenVDB's, NanoVDB's and Embree's.");
    Options options;
    app.add_option("--mesh", options.mesh, "mesh name or file")->capture_default_str();
    app.add_option("--resolution", options.resolutions, "voxels along the longest side")->capture_default_str();
    app.add_option("--half-width", options.halfWidth, "half width of the band [voxels]")->capture_default_str();
    app.add_option("--points", options.points, "count of samples")->capture_default_str()->check(CLI::PositiveNumber);
    app.add_option("--others", options.others, "count of closest points, and of rays")
        ->capture_default_str()
        ->check(CLI::PositiveNumber);
    app.add_option("--threads", options.threads)->capture_default_str();
    app.add_option("--rounds", options.rounds, "rounds, in each of which all peers take turns")
        ->capture_default_str()
        ->check(CLI::PositiveNumber);
    app.add_option("--seed", options.seed, "seed of points and rays")->capture_default_str();
    app.add_option("--json", options.json, "also write all numbers to this file");
    Ratios ratios("query");
    ratios.addOption(app);
    CLI11_PARSE(app, argc, argv);
    nlohmann::json grids;
    for (const float resolution : options.resolutions)
        grids.push_back(compare(findSource(options.mesh), resolution, options, ratios));
    if (!options.json.empty()) std::ofstream(options.json) << grids.dump(2) << "\n";
    ratios.write();
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("query", run, argc, argv);
}
