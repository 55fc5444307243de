// SPDX-License-Identifier: Apache-2.0
// Errors of samples and closest points at random points of the band without its outermost voxel: values and directions
// against ground truth. Five shapes, from 64 to 512 voxels.
//
// The ground truth of samples of sphere, torus and box is their formula; their fields are built from it, so facets have
// no influence. All other results are compared with triangles in double precision: samples of meshes, and every closest
// point.
#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "bench/builders.h"
#include "bench/program.h"
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/support/analytic.h"
#include "tests/support/truth.h"

using namespace bilayer;
using namespace bilayer::bench;

namespace {

constexpr double differenceStep = 1e-5;  // [voxels]; keeps half the digits of doubles, far below the errors
constexpr double steepest = 0.999;       // gradients of distances have length 1 if the closest point is unique
constexpr double percentile = 0.99;

struct Options {
    std::vector<std::string> shapes{"sphere", "torus", "box", "bunny", "screwdriver"};
    std::vector<float> resolutions{64, 128, 256, 512};
    float halfWidth = 3;
    std::size_t points = 20000;
    unsigned seed = 1;
    std::string json;
};

/// A shape by its triangles and optionally by a formula.
struct Shape {
    std::string name;
    Mesh mesh;
    std::optional<test::Solid> solid;
};

using Distance = std::function<double(const glm::dvec3&)>;

// A point in the band with its ground truth.
struct Place {
    glm::vec3 point;
    double distance;      // signed [m]
    glm::dvec3 gradient;  // of unit length; zero where the closest point is not unique
};

// Errors of answers.
struct Errors {
    std::vector<double> values;  // [voxels]
    std::vector<double> angles;  // [degrees]
    std::size_t answered = 0;    // answers that have a distance
};

struct Row {
    std::string shape, query;
    float resolution;
    std::size_t asked;
    Errors errors;
};

Shape shapeNamed(const std::string& name) {
    if (name == "sphere") return {name, shapes::sphere(1, 6), test::sphereSolid(1)};
    if (name == "torus") return {name, shapes::torus(1, 0.4f, 384, 192), test::torusSolid(1, 0.4f)};
    if (name == "box") {
        const glm::vec3 half(1, 0.7f, 0.5f);
        return {name, shapes::box(half), test::boxSolid(half)};
    }
    return {name, readMesh(findSource(name).file), std::nullopt};
}

glm::dvec3 gradientOf(const Distance& distance, const glm::dvec3& point, double step) {
    glm::dvec3 gradient;
    for (int axis = 0; axis < 3; ++axis) {
        glm::dvec3 way(0);
        way[axis] = step;
        gradient[axis] = (distance(point + way) - distance(point - way)) / (2 * step);
    }
    return glm::length(gradient) > steepest ? glm::normalize(gradient) : glm::dvec3(0);
}

// Uniformly distributed in the band without its outermost voxel.
std::vector<Place> places(const LevelSet& levelSet, const Distance& distance, const Options& options) {
    const openvdb::FloatGrid& grid = *levelSet.grids().distance;
    std::vector<glm::vec3> leaves;
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf)
        leaves.emplace_back(leaf->origin().x(), leaf->origin().y(), leaf->origin().z());
    const double voxel = grid.voxelSize()[0], reach = (double(options.halfWidth) - 1) * voxel;
    // points are rounded to single precision here: GCC 12 omits the rounding of a double to a float and back
    std::vector<Place> result(options.points);
    tbb::parallel_for(std::size_t(0), result.size(), [&](std::size_t i) {
        std::seed_seq seeds{options.seed, unsigned(i)};
        std::mt19937 engine(seeds);
        std::uniform_int_distribution<std::size_t> anyLeaf(0, leaves.size() - 1);
        std::uniform_real_distribution<float> anyPlace(-0.5f, 7.5f);
        do {
            const float x = anyPlace(engine), y = anyPlace(engine), z = anyPlace(engine);
            result[i].point = levelSet.voxelSize() * (leaves[anyLeaf(engine)] + glm::vec3(x, y, z));
            result[i].distance = distance(result[i].point);
        } while (std::abs(result[i].distance) >= reach);
        result[i].gradient = gradientOf(distance, result[i].point, differenceStep * voxel);
    });
    return result;
}

// An answer to compare: the distance [m] and its direction.
struct Answer {
    double distance;
    glm::dvec3 direction;
};

Errors errorsOf(const std::vector<Place>& all, double voxel,
                const std::function<std::optional<Answer>(const glm::vec3&)>& ask) {
    Errors errors;
    for (const Place& place : all) {
        const auto answer = ask(place.point);
        if (!answer) continue;
        ++errors.answered;
        errors.values.push_back(std::abs(answer->distance - place.distance) / voxel);
        const double steep = glm::length(answer->direction);
        if (place.gradient == glm::dvec3(0) || !(steep > 0)) continue;
        const double apart = glm::length(glm::cross(answer->direction, place.gradient)) / steep;
        const double along = glm::dot(answer->direction, place.gradient) / steep;
        errors.angles.push_back(glm::degrees(std::atan2(apart, along)));
    }
    return errors;
}

Errors errorsOfSamples(const Field& field, const std::vector<Place>& all) {
    return errorsOf(all, field.voxelSize(), [&](const glm::vec3& point) -> std::optional<Answer> {
        const Sample sample = field.sample(point);
        if (!sample.inBand) return std::nullopt;
        return Answer{sample.distance, sample.gradient};
    });
}

// On a face the direction is its normal; at edges and vertices it is the direction from them to the point.
Errors errorsOfClosest(const Field& field, const std::vector<Place>& all) {
    return errorsOf(all, field.voxelSize(), [&](const glm::vec3& point) -> std::optional<Answer> {
        const ClosestPoint closest = field.closest(point);
        if (!closest.found) return std::nullopt;
        const glm::dvec3 way = glm::dvec3(point) - glm::dvec3(closest.position);
        const bool onFace = closest.feature == Feature::face;
        return Answer{closest.distance, onFace ? glm::dvec3(closest.normal) : closest.distance < 0 ? -way : way};
    });
}

double mean(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value;
    return sum / double(values.size());
}

double quantile(std::vector<double> values, double part) {
    const auto nth = values.begin() + std::ptrdiff_t(part * double(values.size() - 1));
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
}

void print(const Row& row) {
    const Errors& e = row.errors;
    fmt::print("| {} | {:g} | {} | {:.1f} | {:.1e} | {:.1e} | {:.3g} | {:.3g} |\n", row.shape, row.resolution,
               row.query, 100. * double(e.answered) / double(row.asked), mean(e.values), quantile(e.values, 1),
               mean(e.angles), quantile(e.angles, percentile));
    std::fflush(stdout);
}

nlohmann::json toJson(const Row& row) {
    const Errors& e = row.errors;
    return {{"shape", row.shape},          {"resolution", row.resolution},
            {"query", row.query},          {"answered", double(e.answered) / double(row.asked)},
            {"valueMean", mean(e.values)}, {"valueMax", quantile(e.values, 1)},
            {"angleMean", mean(e.angles)}, {"angle99", quantile(e.angles, percentile)}};
}

std::vector<Row> measure(const Shape& shape, const test::Truth& triangles, float resolution, const Options& options) {
    const float voxel = voxelSizeFor(shape.mesh, resolution), width = options.halfWidth;
    const LevelSet ofMesh =
        build(shape.mesh,
              {.voxelSize = voxel, .exteriorWidthVoxels = width, .interiorWidthVoxels = width, .triangles = true});
    const Distance toMesh = [&](const glm::dvec3& p) { return triangles.signedDistance(p); };
    const LevelSet sampled = shape.solid ? test::levelSetOf(*shape.solid, voxel, width, width) : ofMesh;
    const auto aroundMesh = places(ofMesh, toMesh, options);
    const auto around = shape.solid ? places(sampled, shape.solid->distance, options) : aroundMesh;
    return {
        {shape.name, "sample", resolution, around.size(), errorsOfSamples(Field(sampled), around)},
        {shape.name, "closest", resolution, aroundMesh.size(), errorsOfClosest(Field(ofMesh, shape.mesh), aroundMesh)}};
}

int run(int argc, char** argv) {
    CLI::App app("Measures the errors of samples and closest points.");
    Options options;
    app.add_option("--shape", options.shapes, "sphere, torus, box, or the name or file of a mesh")
        ->capture_default_str();
    app.add_option("--resolution", options.resolutions, "voxels along the longest side")->capture_default_str();
    app.add_option("--half-width", options.halfWidth, "half width of the band [voxels]")->capture_default_str();
    app.add_option("--points", options.points)->capture_default_str()->check(CLI::PositiveNumber);
    app.add_option("--seed", options.seed)->capture_default_str();
    app.add_option("--json", options.json, "also write all numbers to this file");
    CLI11_PARSE(app, argc, argv);
    openvdb::initialize();
    fmt::print(
        "| shape | voxels | query | answered [%] | value, mean [voxels] | value, worst | angle, mean [degrees] | "
        "angle, 99th percentile |\n|---|---|---|---|---|---|---|---|\n");
    nlohmann::json rows;
    for (const std::string& name : options.shapes) {
        const Shape shape = shapeNamed(name);
        const test::Truth triangles(shape.mesh);
        for (const float resolution : options.resolutions)
            for (const Row& row : measure(shape, triangles, resolution, options)) {
                print(row);
                rows.push_back(toJson(row));
            }
    }
    if (!options.json.empty()) std::ofstream(options.json) << rows.dump(2) << "\n";
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    return bench::program("sampling", run, argc, argv);
}
