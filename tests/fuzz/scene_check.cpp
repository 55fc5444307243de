// SPDX-License-Identifier: Apache-2.0
#include <assimp/mesh.h>
#include <assimp/scene.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "sdf/io/polygon/polygons.h"
#include "sdf/io/scenes/assimp_reader.h"
#include "sdf/io/scenes/polygon_record.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/checks.h"

namespace bilayer::test {
namespace {

using detail::Polygons;

constexpr std::size_t byteLimit = 1 << 20;  // of an answer

/// One in sixteen indices may be one too large.
unsigned indexBelow(ByteSource& source, unsigned count) {
    return source.below(16) == 0 ? source.below(count + 1) : source.below(std::max(count, 1u));
}

void fill(aiMesh& mesh, ByteSource& source) {
    mesh.mNumVertices = source.below(6);
    mesh.mVertices = new aiVector3D[mesh.mNumVertices];
    for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
        const glm::vec3 p = source.latticePoint();
        mesh.mVertices[i] = {p.x, p.y, p.z};
    }
    mesh.mNumFaces = source.below(5);
    mesh.mFaces = new aiFace[mesh.mNumFaces];
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
        aiFace& face = mesh.mFaces[f];
        face.mNumIndices = source.below(6);
        face.mIndices = new unsigned[face.mNumIndices];
        for (unsigned k = 0; k < face.mNumIndices; ++k) face.mIndices[k] = indexBelow(source, mesh.mNumVertices);
    }
}

aiNode* node(ByteSource& source, unsigned meshes, int depth) {
    auto* const result = new aiNode;
    float* const matrix = result->mTransformation[0];
    for (int i = 0; i < 12; ++i) matrix[i] = source.flag() ? source.lattice() : float(i % 5 == 0);
    result->mNumMeshes = source.below(3);
    result->mMeshes = new unsigned[result->mNumMeshes];
    for (unsigned i = 0; i < result->mNumMeshes; ++i) result->mMeshes[i] = indexBelow(source, meshes);
    std::vector<aiNode*> children;
    for (unsigned count = depth > 0 ? source.below(3) : 0; count > 0; --count)
        children.push_back(node(source, meshes, depth - 1));
    if (!children.empty()) result->addChildren(unsigned(children.size()), children.data());
    return result;
}

void fill(aiScene& scene, ByteSource& source) {
    scene.mNumMeshes = source.below(4);
    scene.mMeshes = new aiMesh*[scene.mNumMeshes];
    for (unsigned i = 0; i < scene.mNumMeshes; ++i) fill(*(scene.mMeshes[i] = new aiMesh), source);
    if (source.byte() != 1) scene.mRootNode = node(source, scene.mNumMeshes, 3);
}

/// Rows of an affine transform.
using Affine = std::array<std::array<double, 4>, 3>;

Affine product(const Affine& a, const aiMatrix4x4& b) {
    Affine result{};
    for (unsigned row = 0; row < 3; ++row)
        for (unsigned column = 0; column < 4; ++column) {
            for (unsigned k = 0; k < 3; ++k) result[row][column] += a[row][k] * double(b[k][column]);
            result[row][column] += column == 3 ? a[row][3] : 0;
        }
    return result;
}

double determinant(const Affine& a) {
    const auto axis = [&](unsigned column) { return glm::dvec3(a[0][column], a[1][column], a[2][column]); };
    return glm::dot(axis(0), glm::cross(axis(1), axis(2)));
}

/// What a scene shows, by recursion over its nodes: each face as the positions of its corners.
struct ShownFaces {
    struct Face {
        std::vector<glm::dvec3> corners;
        double determinant;  ///< of the node's transform
    };
    std::vector<Face> faces{};
    std::size_t pointsAndLines = 0;
    bool isValid = true;  ///< whether all indices exist

    void add(const aiScene& scene, const aiNode& node, const Affine& parent) {
        const Affine world = product(parent, node.mTransformation);
        for (unsigned i = 0; i < node.mNumMeshes; ++i) {
            if (node.mMeshes[i] < scene.mNumMeshes)
                add(*scene.mMeshes[node.mMeshes[i]], world);
            else
                isValid = false;
        }
        for (unsigned i = 0; i < node.mNumChildren; ++i) add(scene, *node.mChildren[i], world);
    }

    void add(const aiMesh& mesh, const Affine& world) {
        for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
            const aiFace& face = mesh.mFaces[f];
            if (face.mNumIndices < 3) {
                ++pointsAndLines;
                continue;
            }
            faces.push_back({{}, determinant(world)});
            for (unsigned k = 0; k < face.mNumIndices; ++k) {
                isValid &= face.mIndices[k] < mesh.mNumVertices;
                if (!isValid) return;
                const aiVector3D& p = mesh.mVertices[face.mIndices[k]];
                glm::dvec3 placed;
                for (unsigned row = 0; row < 3; ++row)
                    placed[int(row)] = world[row][0] * p.x + world[row][1] * p.y + world[row][2] * p.z + world[row][3];
                faces.back().corners.push_back(placed);
            }
        }
    }
};

void requireFace(const ShownFaces::Face& expected, const Polygons& polygons, std::size_t first) {
    constexpr double rounding = 1e-12, flat = 1e-9;
    const std::size_t count = expected.corners.size();
    if (std::abs(expected.determinant) < flat) return;  // may be mirrored or not
    for (std::size_t k = 0; k < count; ++k) {
        const std::size_t at = expected.determinant < 0 ? (count - k) % count : k;
        const glm::dvec3 found = polygons.points[polygons.corners[first + at]];
        require(glm::distance(found, expected.corners[k]) < rounding, "a corner of a scene is at another place");
    }
}

void requireShown(const ShownFaces& expected, const Polygons& polygons) {
    const std::size_t count = polygons.sizes.empty() ? polygons.corners.size() / 3 : polygons.sizes.size();
    require(count == expected.faces.size(), "a scene has another number of faces");
    std::size_t first = 0;
    for (std::size_t f = 0; f < count; ++f) {
        const std::size_t size = polygons.sizes.empty() ? 3 : polygons.sizes[f];
        require(size == expected.faces[f].corners.size(), "a face of a scene has another number of corners");
        requireFace(expected.faces[f], polygons, first);
        first += size;
    }
    const std::string note = std::to_string(expected.pointsAndLines) + " points and lines were left out";
    require((expected.pointsAndLines > 0) == std::count(polygons.notes.begin(), polygons.notes.end(), note),
            "points and lines are not told");
}

/// Receives an answer that was kept.
Polygons received(const std::string& answer) {
    std::size_t at = 0;
    return detail::receivePolygons(
        [&](void* bytes, std::size_t count) {
            if (count > answer.size() - at) throw detail::ChildFailure("ended early");
            std::copy_n(answer.data() + at, count, static_cast<char*>(bytes));
            at += count;
        },
        byteLimit);
}

void requireSame(const Polygons& a, const Polygons& b) {
    require(a.points == b.points && a.corners == b.corners && a.sizes == b.sizes && a.notes == b.notes,
            "polygons are received as others than were sent");
}

/// An edited answer is refused, or holds polygons whose indices exist.
void checkEdited(std::string answer, ByteSource& source) {
    for (unsigned edits = 1 + source.below(3); edits > 0; --edits) {
        const std::size_t words = answer.size() / 4;
        const std::uint32_t value = source.flag() ? source.byte() : source.number<std::uint32_t>();
        std::memcpy(answer.data() + 4 * source.below(unsigned(words)), &value, sizeof value);
    }
    if (source.below(8) == 0) answer.resize(source.below(unsigned(answer.size())));
    Polygons polygons;
    try {
        polygons = received(answer);
    } catch (const detail::ChildFailure&) {
        return;
    } catch (const std::bad_alloc&) {  // the child tells so
        return;
    } catch (const std::runtime_error& error) {
        return requirePlainError(error.what());
    }
    std::size_t corners = 0;
    for (const unsigned size : polygons.sizes) corners += size;
    require(polygons.sizes.empty() ? polygons.corners.size() % 3 == 0 : corners == polygons.corners.size(),
            "an answer with a part of a face was taken");
    for (const unsigned corner : polygons.corners)
        require(corner < polygons.points.size(), "an answer whose corner is no point was taken");
    for (const std::string& note : polygons.notes)
        if (!note.empty()) requirePlainError(note);
}

}  // namespace

void checkSceneParts(Bytes recipe) {
    ByteSource source(recipe);
    aiScene scene;
    fill(scene, source);
    ShownFaces expected;
    const Affine identity{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    if (scene.mRootNode) expected.add(scene, *scene.mRootNode, identity);
    Polygons polygons;
    try {
        polygons = detail::polygonsOf(scene);
    } catch (const std::runtime_error& error) {
        require(!expected.isValid, std::string("a valid scene is refused: ") + error.what());
        return requirePlainError(error.what());
    }
    require(expected.isValid, "a scene whose indices do not exist is taken");
    requireShown(expected, polygons);

    std::string answer;
    detail::sendPolygons(
        [&](const void* bytes, std::size_t count) { answer.append(static_cast<const char*>(bytes), count); }, polygons);
    requireSame(received(answer), polygons);
    while (!source.empty()) checkEdited(answer, source);
}

}  // namespace bilayer::test
