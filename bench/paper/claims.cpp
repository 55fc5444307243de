// SPDX-License-Identifier: Apache-2.0
// The paper's proved claims and their limits: Theorems 1 and 2 at random, and thin walls.
#include <fmt/format.h>
#include <openvdb/tools/MeshToVolume.h>

#include <algorithm>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "bench/paper/markdown.h"
#include "bench/paper/part.h"
#include "bench/paper/theorems.h"
#include "sdf/base/openvdb.h"
#include "tests/support/truth.h"

namespace bilayer::paper {
namespace {

using nlohmann::json;

constexpr unsigned seed = 2014;

json toJson(const DistanceError& error) {
    return {{"over", error.over}, {"under", error.under}, {"underDelta", error.underDelta}};
}

json toJson(const SignError& error) {
    return {{"bound", error.bound}, {"formula", error.formula}, {"farthest", error.farthest}, {"wrong", error.wrong}};
}

json measureTheorems(const Run&) {
    constexpr int many = 1'000'000, wedges = 400, bends = 200'000;
    return {{"seed", seed},
            {"edges", toJson(overEdges(seed, many))},
            {"triangles", toJson(overTriangles(seed, many))},
            {"reflex", toJson(aroundWedges(seed, wedges, pi, 2 * pi - 0.3))},
            {"blunt", toJson(aroundWedges(seed, wedges, 0.75 * pi, pi))},
            {"square", toJson(aroundWedges(seed, wedges, 0.5 * pi, 0.75 * pi))},
            {"sharp", toJson(aroundWedges(seed, wedges, 0.1, 0.5 * pi))},
            {"closed", toJson(aroundBends(seed, bends, true))},
            {"open", toJson(aroundBends(seed, bends, false))}};
}

constexpr double claimRounding = 1e-6;

std::string remarkTheorem1(const json& data) {
    double over = 0, flat = 0, convex = 0, convexDelta = 0;  // `flat` and `convex`: maximum "under"
    for (const char* which : {"triangles", "reflex", "blunt", "square", "sharp"})
        over = std::max(over, double(data[which]["over"]));
    for (const char* which : {"edges", "triangles", "reflex"}) flat = std::max(flat, double(data[which]["under"]));
    for (const char* which : {"blunt", "square", "sharp"}) {
        convex = std::max(convex, double(data[which]["under"]));
        convexDelta = std::max(convexDelta, double(data[which]["underDelta"]));
    }
    std::string text;
    if (over < 2.0 / 3 && double(data["edges"]["over"]) < 0.5)
        text += " No distance is too large by more than the bound.";
    if (flat < claimRounding) text += " Over faces and at reflex edges none is too small.";
    if (convex > 2.0 / 3)
        text += fmt::format(
            " At convex edges the theorem does not hold as it is printed: the proof's case 3 bounds `d_e - d` from "
            "above only. There the points of a face's inner layer come near the other face, or through it. They make "
            "distances too small by up to {:.1f} delta, however fine the mesh.",
            convexDelta);
    return text.empty() ? "" : "\n" + text.substr(1) + "\n";
}

std::string textTheorems(const json& data) {
    const auto distance = [&](const char* which, const char* name, const char* bound) {
        const json& error = data[which];
        const auto shown = [](double value) { return value < 1e-12 ? std::string("0") : digits(value); };
        return std::vector<std::string>{name, bound, digits(error["over"]), shown(error["under"]),
                                        shown(error["underDelta"])};
    };
    const auto sign = [&](const char* which, const char* name) {
        const json& error = data[which];
        return std::vector<std::string>{name, fmt::format("{:.4f}", error["bound"].get<double>()),
                                        digits(error["formula"], 2),
                                        fmt::format("{}", error["wrong"].get<std::uint64_t>()),
                                        fmt::format("{:.2f}", error["farthest"].get<double>())};
    };
    return fmt::format("Random triangles, wedges and bends (seed {}). Tests check what is said here.\n\n",
                       data["seed"].get<unsigned>()) +
           "**Theorem 1**: without sign errors `|d_e - d| < 2/3 L_max`, in 2D `L_max / 2`. The table has the worst of "
           "a "
           "million points over edges and triangles, and of 8,000 points around wedges of two rows of triangles. Delta "
           "is 0.5, L_max 0.1 to 2, and each triangle is sampled once.\n\n" +
           table({"", "bound", "max too far [L_max]", "max too near [L_max]", "max too near [delta]"},
                 {distance("edges", "over edges, 2D", "1/2"), distance("triangles", "over triangles", "2/3"),
                  distance("reflex", "solid angle 180 degrees and more", "2/3"),
                  distance("blunt", "135 to 180 degrees", "2/3"), distance("square", "90 to 135 degrees", "2/3"),
                  distance("sharp", "below 90 degrees", "2/3")}) +
           remarkTheorem1(data) +
           "\n**Theorem 2**: an edge of 2 L1 meets a longer one of 2 L2 at a bend of 2 theta. The sign error ends at "
           "F, "
           "and `OF <= (L2 - L1) / 2` where `L2 tan(theta) <= delta`. Points are tried within a square of 4 OF to each "
           "side of O. Where the region is open, the farthest is that of the square.\n\n" +
           table({"bends with", "max of OF / ((L2 - L1) / 2)", "formula's F off the bisector by", "wrong signs met",
                  "the farthest of them [OF]"},
                 {sign("closed", "delta sin(2 theta) < L2 + L1 cos(2 theta)"), sign("open", "else")}) +
           (std::max(double(data["closed"]["bound"]), double(data["open"]["bound"])) < 1 + claimRounding
                ? "\nThe inequality holds."
                : "\nThe inequality does not hold.") +
           (double(data["closed"]["farthest"]) < 1 + claimRounding && double(data["open"]["farthest"]) > 1
                ? " F is the farthest point on the wrong side under one more condition: the bisector of P and Q meets "
                  "the longer edge, `delta sin(2 theta) < L2 + L1 cos(2 theta)`. Otherwise the region OGF of Fig. 6 is "
                  "open instead of a triangle, and wrong signs end only where other samples are nearer. For equal "
                  "edges and delta = 2 L2 the theorem asks for tan(theta) <= 2, and the condition for tan(theta) < "
                  "1/2.\n"
                : "\n");
}

// A wall of side x side x thickness. Its two faces are triangulated independently.
Mesh wall(float side, float thickness, int cells, std::mt19937& random) {
    std::uniform_real_distribution<float> jitter(-0.3f, 0.3f);
    Mesh mesh;
    const auto vertex = [&](int face, int i, int j) { return unsigned((face * (cells + 1) + i) * (cells + 1) + j); };
    for (int face = 0; face < 2; ++face)
        for (int i = 0; i <= cells; ++i)
            for (int j = 0; j <= cells; ++j) {
                const bool inner = i > 0 && j > 0 && i < cells && j < cells;
                const glm::vec2 at =
                    glm::vec2(i, j) + (inner ? glm::vec2(jitter(random), jitter(random)) : glm::vec2(0));
                mesh.points.push_back({at * (side / float(cells)) - side / 2, (float(face) - 0.5f) * thickness});
            }
    const auto quad = [&](unsigned a, unsigned b, unsigned c, unsigned d) {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
    };
    for (int i = 0; i < cells; ++i)
        for (int j = 0; j < cells; ++j) {
            quad(vertex(1, i, j), vertex(1, i + 1, j), vertex(1, i + 1, j + 1), vertex(1, i, j + 1));
            quad(vertex(0, i, j + 1), vertex(0, i + 1, j + 1), vertex(0, i + 1, j), vertex(0, i, j));
        }
    for (int i = 0; i < cells; ++i) {
        quad(vertex(0, i, 0), vertex(0, i + 1, 0), vertex(1, i + 1, 0), vertex(1, i, 0));
        quad(vertex(0, cells, i), vertex(0, cells, i + 1), vertex(1, cells, i + 1), vertex(1, cells, i));
        quad(vertex(0, i + 1, cells), vertex(0, i, cells), vertex(1, i, cells), vertex(1, i + 1, cells));
        quad(vertex(0, 0, i + 1), vertex(0, 0, i), vertex(1, 0, i), vertex(1, 0, i + 1));
    }
    return mesh;
}

openvdb::FloatGrid::ConstPtr openvdbField(const Mesh& mesh, float voxelSize, float halfWidth) {
    std::vector<openvdb::Vec3s> points;
    for (const glm::vec3& p : mesh.points) points.push_back(openvdb::Vec3s(p.x, p.y, p.z) / voxelSize);
    std::vector<openvdb::Vec3I> triangles;
    for (const glm::uvec3& t : mesh.triangles) triangles.push_back({t.x, t.y, t.z});
    const openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, openvdb::Vec3I> adapter(points, triangles);
    const auto transform = openvdb::math::Transform::createLinearTransform(voxelSize);
    return openvdb::tools::meshToVolume<openvdb::FloatGrid>(adapter, *transform, halfWidth, halfWidth,
                                                            openvdb::tools::DISABLE_RENORMALIZATION);
}

constexpr float wallSide = 30, wallBand = 1.5f;  // [voxels]
constexpr int wallCells = 20, wallRotations = 6;
constexpr float wallHalfWidth = 3;

// Voxels within the band, and those of wrong sign.
struct Sides {
    std::uint64_t outside = 0, inside = 0, outsideWrong = 0, insideWrong = 0;
};

void judge(const openvdb::FloatGrid& grid, const std::vector<std::pair<openvdb::Coord, double>>& voxels, Sides& sides) {
    const auto values = grid.getConstAccessor();
    for (const auto& [at, truth] : voxels) {
        const bool called = values.getValue(at) < 0;
        ++(truth < 0 ? sides.inside : sides.outside);
        if (truth < 0 && !called) ++sides.insideWrong;
        if (truth > 0 && called) ++sides.outsideWrong;
    }
}

json measureWalls(const Run&) {
    openvdb::initialize();
    json rows = json::array();
    for (const float thickness : {1.25f, 1.f, 0.75f, 0.5f, 0.25f, 0.f}) {
        std::mt19937 random(seed);
        std::uniform_real_distribution<float> any(-1, 1);
        Sides layers, openvdb, exact;
        for (int rotation = 0; rotation < wallRotations; ++rotation) {
            const glm::vec3 axis(any(random), any(random), any(random));
            const glm::mat4 place = glm::rotate(
                glm::translate(glm::mat4(1), glm::vec3(any(random), any(random), any(random))), 3 * any(random), axis);
            const Mesh mesh = transformed(wall(wallSide, thickness, wallCells, random), place);
            const test::Truth truth(mesh);
            std::vector<std::pair<openvdb::Coord, double>> voxels;
            const Bounds box = bounds(mesh);
            const glm::ivec3 low(glm::floor(box.lower - wallBand)), high(glm::ceil(box.upper + wallBand));
            for (int x = low.x; x <= high.x; ++x)
                for (int y = low.y; y <= high.y; ++y)
                    for (int z = low.z; z <= high.z; ++z) {
                        const glm::dvec3 point(x, y, z);
                        if (truth.distance(point) > wallBand || truth.distance(point) < 1e-4) continue;
                        voxels.push_back({{x, y, z}, truth.signedDistance(point)});
                    }
            BuildOptions options{
                .voxelSize = 1, .exteriorWidthVoxels = wallHalfWidth, .interiorWidthVoxels = wallHalfWidth};
            judge(*build(mesh, options).grids().distance, voxels, exact);
            options.method = Method::doubleLayer;
            judge(*build(mesh, options).grids().distance, voxels, layers);
            judge(*openvdbField(mesh, 1, wallHalfWidth), voxels, openvdb);
        }
        const auto toJson = [](const Sides& sides) {
            return json{{"outside", sides.outside},
                        {"inside", sides.inside},
                        {"outsideWrong", sides.outsideWrong},
                        {"insideWrong", sides.insideWrong}};
        };
        rows.push_back({{"thickness", thickness},
                        {"layers", toJson(layers)},
                        {"openvdb", toJson(openvdb)},
                        {"exact", toJson(exact)}});
    }
    return {{"rows", rows}, {"seed", seed}};
}

std::string textWalls(const json& data) {
    std::vector<std::vector<std::string>> rows;
    for (const json& row : data["rows"]) {
        std::vector<std::string> cells{fmt::format("{}", row["thickness"].get<double>())};
        for (const char* which : {"layers", "openvdb", "exact"}) {
            cells.push_back(percent(row[which]["outsideWrong"], row[which]["outside"]));
            const double inside = row[which]["inside"];
            cells.push_back(inside > 0 ? percent(row[which]["insideWrong"], inside) : "-");
        }
        rows.push_back(cells);
    }
    double thickest = 0;  // thickest wall with a wrong sign
    for (const json& row : data["rows"])
        if (row["layers"]["outsideWrong"] > 0) thickest = std::max(thickest, row["thickness"].get<double>());
    return fmt::format(
               "Section 5 names the limit: layers that cross. Walls of {} x {} voxels get thinner and thinner. Their "
               "two "
               "faces are cut into triangles independently, with {} places and rotations each (seed {}). The table has "
               "the voxels within {} of the surface that are on the wrong side. OpenVDB is `meshToVolume` without "
               "renormalisation.\n\n",
               wallSide, wallSide, wallRotations, data["seed"].get<unsigned>(), wallBand) +
           table({"thickness [voxels]", "double-layer: outside called inside", "inside called outside",
                  "OpenVDB: outside called inside", "inside called outside", "exact: outside called inside",
                  "inside called outside"},
                 rows) +
           "\nThe inner layers of two faces cross where a wall is thinner than 2 delta, one voxel." +
           (thickest >= 1
                ? fmt::format(
                      " Samples to the side of a voxel bring wrong signs to thicker walls too, here of {} voxels.",
                      thickest)
                : "") +
           " Choose `exact` where there are such walls. A wall without thickness has no inside.\n";
}

std::vector<std::string> behindWalls(const json& data) {
    std::vector<std::string> found;
    for (const json& row : data["rows"])
        for (const char* name : {"layers", "exact"})
            if (row[name]["outsideWrong"] > row["openvdb"]["outsideWrong"])
                found.push_back(fmt::format("A wall of {} voxels: `{}` has {} of the outside inside, OpenVDB {}.",
                                            row["thickness"].get<double>(),
                                            std::string(name) == "layers" ? "double-layer" : name,
                                            percent(row[name]["outsideWrong"], row[name]["outside"]),
                                            percent(row["openvdb"]["outsideWrong"], row["openvdb"]["outside"])));
    return found;
}

}  // namespace

std::vector<Part> claimParts() {
    return {{"theorems", "Theorems 1 and 2", measureTheorems, textTheorems},
            {"walls", "Thin walls", measureWalls, textWalls, behindWalls}};
}

}  // namespace bilayer::paper
