// SPDX-License-Identifier: Apache-2.0
// The paper's pictures: the original next to the surface of its field.
#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include <bilayer/sdf/surface.h>
#include "bench/paper/markdown.h"
#include "bench/paper/models.h"
#include "bench/paper/part.h"
#include "bench/paper/picture.h"
#include "bench/paper/published.h"

namespace bilayer::paper {
namespace {

using nlohmann::json;
using published::largeGrid;

constexpr float halfWidth = 2;

// The paper's field, with its samples and its cubes of nodes.
LevelSet lettered(const Mesh& mesh, const Lattice& lattice, float delta = 0.5f) {
    BuildOptions options = optionsFor(lattice, Method::doubleLayer, halfWidth);
    options.doubleLayer.fillGaps = false;
    options.doubleLayer.delta = delta;
    return build(mesh, options);
}

// A view of a mesh from a direction, as large as the picture allows.
View viewOf(const Mesh& mesh, const glm::dvec3& from, const glm::dvec3& up, int pixels, int lines) {
    View view{bounds(mesh).centre(), from, up, 0, pixels, lines};
    const glm::dvec3 back = glm::normalize(from), right = glm::normalize(glm::cross(up, back)),
                     top = glm::cross(back, right);
    glm::dvec2 low(1e30), high(-1e30);
    for (const glm::vec3& p : mesh.points) {
        const glm::dvec2 seen(glm::dot(glm::dvec3(p), right), glm::dot(glm::dvec3(p), top));
        low = glm::min(low, seen);
        high = glm::max(high, seen);
    }
    const glm::dvec2 middle = 0.5 * (low + high), extent = high - low;
    view.centre += (middle.x - glm::dot(view.centre, right)) * right + (middle.y - glm::dot(view.centre, top)) * top;
    view.width = 1.06 * std::max(extent.x, extent.y * pixels / lines);
    return view;
}

std::size_t surfaceTriangles(const LevelSet& field) {
    return surface(field).triangles.size();
}

// Writes a figure and returns its location.
std::string write(const Run& run, const std::string& name, const std::vector<Picture>& pictures, int columns) {
    writeJpeg(run.pictures + "/" + name, mosaic(pictures, columns));
    return run.picturesOnPage + "/" + name;
}

std::string shown(const json& data, const std::string& what) {
    return fmt::format("![{}]({})\n\n{}\n", what, data["picture"].get<std::string>(), what);
}

const glm::dvec3 upright(0, 1, 0);

json measureFigure7(const Run& run) {
    const auto bunny = findModel("bunny", run.meshes);
    if (!bunny) return {{"skipped", "no bunny"}};
    const Lattice finest = latticeOf(published::figure7.back());
    const Mesh mesh = fitted(bunny->mesh, finest);
    const View view = viewOf(mesh, {0.15, 0.15, 1}, upright, 440, 440);
    std::vector<Picture> pictures{picture(mesh, view)};
    for (const int nodes : published::figure7) {
        // the same bunny in all pictures: only the steps of the grids differ
        const Lattice lattice = latticeOf(nodes);
        pictures.push_back(picture(lettered(mesh, lattice), view));
    }
    return {{"picture", write(run, "figure7.jpg", pictures, 4)}};
}

std::string textFigure7(const json& data) {
    const auto& grids = published::figure7;
    return shown(data, fmt::format("The bunny: original, and by the double layer at {}^3, {}^3 and {}^3.", grids[0],
                                   grids[1], grids[2])) +
           "\nDetails smaller than a step are gone. Those that the grid resolves are there, with some noise of the "
           "samples, as in the paper.\n";
}

constexpr int coarse = published::figure7.front();  // the paper does not state its grid

json measureFigure8(const Run& run) {
    const Lattice lattice = latticeOf(coarse);
    const Mesh mesh = unevenSphere(published::table5[0].variance, latticeOf(published::tableNodes));
    const View view = viewOf(mesh, {0.3, 0.4, 1}, upright, 440, 440);
    std::vector<Picture> pictures{picture(mesh, view)};
    for (const float delta : published::figure8) pictures.push_back(picture(lettered(mesh, lattice, delta), view));
    return {{"picture", write(run, "figure8.jpg", pictures, 4)}, {"triangles", mesh.triangles.size()}};
}

std::string textFigure8(const json& data) {
    const auto& deltas = published::figure8;
    return shown(data, fmt::format("The sphere of Table 5, of variance {}: original, and at {}^3 with delta = {:.1f}, "
                                   "{:.1f} and {:.1f} steps.",
                                   published::table5[0].variance, coarse, deltas[0], deltas[1], deltas[2])) +
           "\nThe farther the layers are apart, the less the places of the samples on them matter: the noise falls "
           "with "
           "delta, as in the paper. Thin walls speak against a large delta.\n";
}

json largeFigure(const Run& run, const std::string& name, const char* file, const glm::dvec3& from, int pixels,
                 int lines) {
    const auto model = findModel(name, run.meshes);
    if (!model) return {{"skipped", "no " + name}};
    const Lattice lattice = latticeOf(largeGrid);
    const Mesh mesh = fitted(model->mesh, lattice);
    const View view = viewOf(mesh, from, upright, pixels, lines);
    const LevelSet field = lettered(mesh, lattice);
    return {{"picture", write(run, file, {picture(mesh, view), picture(field, view)}, 2)},
            {"original", mesh.triangles.size()},
            {"origin", model->origin},
            {"result", surfaceTriangles(field)}};
}

// Triangle counts of a figure, the paper's next to ours.
std::string counts(const json& data, const published::Surface& paper) {
    const auto kilo = [](const json& triangles) {
        return fmt::format("{:.2f}", triangles.get<double>() / published::thousand);
    };
    return table({"triangles [K]", "original", "surface of the field"},
                 {{"paper", fmt::format("{:.2f}", paper.original), fmt::format("{:.2f}", paper.result)},
                  {"here", kilo(data["original"]), kilo(data["result"])}});
}

std::string textLarge(const json& data, const published::Surface& paper, const char* remark) {
    return shown(data,
                 fmt::format("The {}, original and by the double layer in a grid of {} x {} x {}: {}.", paper.model,
                             largeGrid.x, largeGrid.y, largeGrid.z, data["origin"].get<std::string>())) +
           "\n" + counts(data, paper) +
           fmt::format(
               "\nThe surface is extracted by OpenVDB's `volumeToMesh`, dual contouring. It gives as many triangles as "
               "marching cubes: two for each lattice edge that the surface crosses. Steps are the same along all axes, "
               "and one scale of the model holds for all, unlike in Table 4. {}\n",
               remark);
}

json measureFigure9(const Run& run) {
    return largeFigure(run, "dragon", "figure9.jpg", {-0.25, 0.3, 1}, 820, 600);
}
std::string textFigure9(const json& data) {
    return textLarge(
        data, published::surfaces[0],
        "The model fills the grid along x. The paper does not state how much of its grid the dragon fills.");
}
json measureFigure10(const Run& run) {
    return largeFigure(run, "circular box", "figure10.jpg", {0.1, 0.75, 1}, 820, 700);
}
std::string textFigure10(const json& data) {
    return textLarge(data, published::surfaces[1],
                     "The paper's box is not public. This one is carved by formula, with similar relief.");
}

// The grid on which the double layer's surface has as many triangles as the paper's.
Lattice latticeForTriangles(const Mesh& mesh, double wanted) {
    int low = 32, high = 512;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        const Lattice lattice = latticeOf(middle);
        (double(surfaceTriangles(lettered(fitted(mesh, lattice), lattice))) < wanted ? low : high) = middle;
    }
    return latticeOf(low);
}

// The upper end of the blade.
View headOf(const Mesh& mesh, const glm::dvec3& from, int pixels, int lines) {
    const Bounds box = bounds(mesh);
    Mesh head;
    for (const glm::vec3& p : mesh.points)
        if (p.z > box.upper.z - 0.075f * box.size().z) head.points.push_back(p);
    head.triangles.resize(head.points.size());
    for (unsigned i = 0; i < head.points.size(); ++i) head.triangles[i] = glm::uvec3(i);
    return viewOf(head, from, {0, 0, 1}, pixels, lines);
}

json measureFigure11(const Run& run) {
    const auto model = findModel("screwdriver", run.meshes);
    if (!model) return {{"skipped", "the screwdriver is not here"}};
    const Lattice lattice = latticeForTriangles(model->mesh, published::surfaces[2].result * published::thousand);
    const Mesh mesh = fitted(model->mesh, lattice);
    const LevelSet layers = lettered(mesh, lattice), exact = build(mesh, optionsFor(lattice, Method::exact, halfWidth));
    const View all = viewOf(mesh, {1, 0.2, 0.35}, {0, 0, 1}, 440, 540), head = headOf(mesh, {1, -0.45, 0.3}, 440, 540);
    std::vector<Picture> pictures;
    for (const View& view : {all, head})
        for (const Picture& one : {picture(mesh, view), picture(layers, view), picture(exact, view)})
            pictures.push_back(one);
    return {{"picture", write(run, "figure11.jpg", pictures, 3)},
            {"original", mesh.triangles.size()},
            {"result", surfaceTriangles(layers)},
            {"exact", surfaceTriangles(exact)},
            {"nodes", lattice.nodes.x}};
}

std::string textFigure11(const json& data) {
    return shown(data, fmt::format("The screwdriver at {}^3, where its surface has about as many triangles as the "
                                   "paper's; below, its head. From the left: original; by the double layer, noisy as "
                                   "in the paper where the blade is thinner than two layers need; by `exact` in the "
                                   "same grid.",
                                   data["nodes"].get<int>())) +
           "\n" + counts(data, published::surfaces[2]) +
           "\nThe paper does not state its grid. This one is searched for so that the counts of triangles agree, which "
           "says nothing of the method.\n";
}

}  // namespace

std::vector<Part> figureParts() {
    return {{"figure7", "Figure 7: the bunny", measureFigure7, textFigure7},
            {"figure8", "Figure 8: delta", measureFigure8, textFigure8},
            {"figure9", "Figure 9: the dragon", measureFigure9, textFigure9},
            {"figure10", "Figure 10: the circular box", measureFigure10, textFigure10},
            {"figure11", "Figure 11: the screwdriver", measureFigure11, textFigure11}};
}

}  // namespace bilayer::paper
