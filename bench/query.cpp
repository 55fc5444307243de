// Queries side by side: the same field and the same questions, in one run, for the field, OpenVDB, NanoVDB and Embree.
// First all answers are compared; only then the peers take turns, and medians are printed, nanoseconds a query, beside
// what the memory of the machine would allow.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>
#include <random>
#include <unordered_set>

#include "bench/bandwidth.h"
#include "bench/builders.h"
#include "bench/measure.h"
#include "bench/peers.h"
#include "sdf/field_layout.h"
#include "sdf/grids.h"

using namespace bilayer;
using namespace bilayer::bench;

namespace {

constexpr double valueTolerance = 1e-4;     // [voxels]
constexpr double gradientTolerance = 1e-4;  // [1]
// Gradients jump where cells meet, and peers that reckon in single precision may see a point on the other side.
constexpr double fromCellFaces = 1e-3;  // [voxels]

struct Options {
    std::string mesh = "bunny", json;
    std::vector<float> resolutions{128, 523};  // of about 9 and 150 MB for OpenVDB
    float halfWidth = 3;
    std::size_t points = 1000000;
    std::vector<int> threads{1, 2};
    int repetitions = 7;
    unsigned seed = 1;
};

/// The same questions in two orders.
template <class Question>
struct Questions {
    std::string order;
    std::vector<Question> all;
};

/// What one peer took for questions in one order on some threads.
struct Time {
    std::string question, peer, order;
    int threads;
    double nanoseconds;  // a query
};

// Each thread takes a stretch.
template <class Question, class Answer>
double secondsOf(const Peer<Question, Answer>& peer, std::span<const Question> questions, std::span<Answer> answers,
                 int threads) {
    const std::size_t share = (questions.size() + std::size_t(threads) - 1) / std::size_t(threads);
    const Stopwatch watch;
    onThreads(threads, [&](int thread) {
        const std::size_t begin = std::min(questions.size(), share * std::size_t(thread));
        const std::size_t count = std::min(questions.size() - begin, share);
        peer.answer(questions.subspan(begin, count), answers.subspan(begin, count));
    });
    return watch.seconds();
}

// Peers take turns, so that a slow minute hits all alike.
template <class Question, class Answer>
std::vector<Time> race(const std::string& question, const std::vector<Peer<Question, Answer>>& peers,
                       const std::vector<Questions<Question>>& orders, const Options& options) {
    std::vector<Time> times;
    for (const auto& [order, questions] : orders)
        for (const int threads : options.threads) {
            std::vector<std::vector<double>> seconds(peers.size());
            std::vector<Answer> answers(questions.size());
            for (int round = 0; round < options.repetitions; ++round)
                for (std::size_t i = 0; i < peers.size(); ++i)
                    seconds[i].push_back(secondsOf(peers[i], std::span(questions), std::span(answers), threads));
            for (std::size_t i = 0; i < peers.size(); ++i)
                times.push_back(
                    {question, peers[i].name, order, threads, 1e9 * median(seconds[i]) / double(questions.size())});
        }
    return times;
}

// Evenly over the cells all of whose voxels are active, and within the band less a voxel.
std::vector<glm::vec3> pointsInBand(const Field& field, const LevelSet& levelSet, const Options& options) {
    std::vector<openvdb::Coord> leaves;
    for (auto leaf = levelSet.grids().distance->tree().cbeginLeaf(); leaf; ++leaf) leaves.push_back(leaf->origin());
    std::mt19937 engine(options.seed);
    std::uniform_int_distribution<std::size_t> anyLeaf(0, leaves.size() - 1);
    std::uniform_real_distribution<double> anyPlace(0, 8);
    const double voxel = levelSet.grids().distance->voxelSize()[0];
    const float reach = (options.halfWidth - 1) * levelSet.voxelSize();
    const auto offFaces = [&](float x) { return std::abs(x / voxel - std::round(x / voxel)) > fromCellFaces; };
    std::vector<glm::vec3> points;
    while (points.size() < options.points) {
        const openvdb::Coord& leaf = leaves[anyLeaf(engine)];
        const double x = anyPlace(engine), y = anyPlace(engine), z = anyPlace(engine);
        const glm::vec3 point(voxel * (leaf.x() + x), voxel * (leaf.y() + y), voxel * (leaf.z() + z));
        const Sample sample = field.sample(point);
        if (sample.inBand && std::abs(sample.distance) < reach && offFaces(point.x) && offFaces(point.y) &&
            offFaces(point.z))
            points.push_back(point);
    }
    return points;
}

// The place of a voxel along Morton's curve: bits of the three coordinates in turn.
std::uint64_t mortonCode(const glm::uvec3& voxel) {
    std::uint64_t code = 0;
    for (int bit = 0; bit < 21; ++bit)
        for (int axis = 0; axis < 3; ++axis) code |= std::uint64_t(voxel[axis] >> bit & 1) << (3 * bit + 2 - axis);
    return code;
}

std::vector<glm::vec3> alongCurve(const std::vector<glm::vec3>& points, const Field& field) {
    std::vector<std::pair<std::uint64_t, glm::vec3>> keyed;
    for (const glm::vec3& p : points)
        keyed.emplace_back(mortonCode(glm::uvec3((glm::dvec3(p) - field.origin()) / double(field.voxelSize()))), p);
    std::sort(keyed.begin(), keyed.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<glm::vec3> sorted;
    for (const auto& [code, point] : keyed) sorted.push_back(point);
    return sorted;
}

Sampler single(const Field& field) {
    return {"bilayer single", [field](std::span<const glm::vec3> points, std::span<Sample> samples) {
                for (std::size_t i = 0; i < points.size(); ++i) samples[i] = field.sample(points[i]);
            }};
}

/// The largest differences between two peers' samples.
struct Disagreement {
    double value = 0;     // [voxels]
    double gradient = 0;  // [1]
};

Disagreement disagreement(std::span<const Sample> a, std::span<const Sample> b, float voxelSize) {
    Disagreement result;
    for (std::size_t i = 0; i < a.size(); ++i) {
        result.value = std::max<double>(result.value, std::abs(a[i].distance - b[i].distance) / voxelSize);
        result.gradient = std::max<double>(result.gradient, glm::distance(a[i].gradient, b[i].gradient));
    }
    return result;
}

// Throws where a peer's answers differ from the first one's.
void requireEqualSamples(const std::vector<Sampler>& peers, const Questions<glm::vec3>& questions, float voxelSize) {
    std::vector<Sample> first(questions.all.size()), other(first.size());
    peers.front().answer(questions.all, first);
    for (const Sampler& peer : peers) {
        std::fill(other.begin(), other.end(), Sample{.distance = NAN});
        peer.answer(questions.all, other);
        const auto [value, gradient] = disagreement(first, other, voxelSize);
        fmt::print("{} points: {} agrees with {} to {:.1e} voxel, gradients to {:.1e}\n", questions.order, peer.name,
                   peers.front().name, value, gradient);
        if (!(value <= valueTolerance && gradient <= gradientTolerance))
            throw std::runtime_error(fmt::format("{} and {} disagree", peer.name, peers.front().name));
    }
}

std::string table(const std::vector<Time>& times, const std::vector<std::string>& peers,
                  const std::vector<std::string>& orders, const std::vector<int>& threads) {
    std::string text = "| ns a query |", rule = "|---|";
    for (const auto& order : orders)
        for (const int t : threads) {
            text += fmt::format(" {}, {} thread{} |", order, t, t > 1 ? "s" : "");
            rule += "---|";
        }
    text += "\n" + rule + "\n";
    for (const std::string& peer : peers) {
        text += fmt::format("| {} |", peer);
        for (const auto& order : orders)
            for (const int t : threads)
                for (const Time& time : times)
                    if (time.peer == peer && time.order == order && time.threads == t)
                        text += fmt::format(" {:.1f} |", time.nanoseconds);
        text += "\n";
    }
    return text;
}

void compare(const Source& source, float resolution, const Options& options) {
    const Scene scene = bench::scene(source, resolution);
    const LevelSet levelSet = fieldOf(scene, {.halfWidth = options.halfWidth, .threads = options.threads.back()});
    const Field field(levelSet);
    const auto grid = levelSet.grids().distance;
    const Nanovdb nanovdb(*grid);
    fmt::print("\n## {}, {:g} voxels\n\nbytes: OpenVDB {}, NanoVDB {}, bilayer {} ({:.2f} of NanoVDB's)\n", scene.name,
               resolution, grid->memUsage(), nanovdb.bytes(), field.memoryBytes(),
               double(field.memoryBytes()) / double(nanovdb.bytes()));

    std::vector<Questions<glm::vec3>> points{{"random", pointsInBand(field, levelSet, options)}};
    points.push_back({"coherent", alongCurve(points[0].all, field)});
    const std::vector<Sampler> samplers{openvdbSampler(grid), openvdbStencil(grid), nanovdb.sampler(), single(field)};
    for (const auto& questions : points) requireEqualSamples(samplers, questions, levelSet.voxelSize());
    const auto times = race("sample", samplers, points, options);
    std::vector<std::string> names;
    for (const auto& s : samplers) names.push_back(s.name);
    fmt::print("\n{}", table(times, names, {"random", "coherent"}, options.threads));
    for (int t : options.threads)
        fmt::print("{} threads: stream {:.1f} GB/s, random lines in the field's bytes {:.1f} ns a line\n", t,
                   streamBandwidth(t) / 1e9, 1e9 / randomLines(field.memoryBytes(), t));
}

int run(int argc, char** argv) {
    CLI::App app("Times queries of the field beside OpenVDB's, NanoVDB's and Embree's.");
    Options options;
    app.add_option("--mesh", options.mesh, "a name or a file")->capture_default_str();
    app.add_option("--resolution", options.resolutions, "voxels along the longest side")->capture_default_str();
    app.add_option("--points", options.points)->capture_default_str()->check(CLI::PositiveNumber);
    app.add_option("--threads", options.threads)->capture_default_str();
    app.add_option("--repetitions", options.repetitions)->capture_default_str()->check(CLI::PositiveNumber);
    app.add_option("--seed", options.seed)->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    for (const float resolution : options.resolutions) compare(findSource(options.mesh), resolution, options);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    try {
        return run(argc, argv);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench query: {}\n", error.what());
        return 1;
    }
}
