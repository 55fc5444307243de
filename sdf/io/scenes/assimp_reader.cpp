// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/scenes/assimp_reader.h"

#include <fmt/format.h>

#include <assimp/DefaultIOSystem.h>
#include <assimp/config.h>
#include <assimp/scene.h>
#include <assimp/Importer.hpp>

#include <algorithm>
#include <cmath>
#include <exception>
#include <fstream>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "sdf/io/scenes/scene.h"

namespace bilayer::detail {
namespace {

/// Gives Assimp access only to regular files among those that a mesh refers to, such as materials. Other kinds of files
/// may never end. Assimp writes no files.
class RegularFiles : public Assimp::DefaultIOSystem {
  public:
    bool Exists(const char* file) const override {
        std::error_code absent;
        return std::filesystem::is_regular_file(file, absent);
    }
    Assimp::IOStream* Open(const char* file, const char* mode) override {
        return mode[0] == 'r' && Exists(file) ? DefaultIOSystem::Open(file, mode) : nullptr;
    }
};

struct PlacedNode {
    const aiNode* node;
    glm::dmat4 world;
};

glm::dmat4 matrixOf(const aiMatrix4x4& m) {
    return {{m.a1, m.b1, m.c1, m.d1}, {m.a2, m.b2, m.c2, m.d2}, {m.a3, m.b3, m.c3, m.d3}, {m.a4, m.b4, m.c4, m.d4}};
}

// Returns whether a file is a ZIP archive with 64-bit sizes. Criteria are the version required by its first entry, and
// the locator of the 64-bit directory, which precedes the 32-bit one. See sections 4.3 and 4.4 of the ZIP file format
// (APPNOTE).
bool isZip64(const std::filesystem::path& path) {
    constexpr std::streamoff headSize = 5, tailSize = 22 + 65535 + 20;  // with the longest comment [bytes]
    constexpr char zip64Version = 45;
    std::ifstream stream(path, std::ios::binary);
    std::string head(headSize, '\0');
    if (!stream.read(head.data(), headSize) || head.compare(0, 4, "PK\3\4") != 0) return false;
    if (head[4] >= zip64Version) return true;
    const auto size = std::streamoff(std::filesystem::file_size(path));
    stream.seekg(std::max(size - tailSize, std::streamoff(0)));
    const std::string tail{std::istreambuf_iterator<char>(stream), {}};
    return tail.find("PK\6\7") != std::string::npos;
}

class AssimpScene {
  public:
    explicit AssimpScene(const aiScene& scene) : scene_(scene) {}

    Polygons read() {
        std::vector<PlacedNode> open;
        if (scene_.mRootNode) open.push_back({scene_.mRootNode, glm::dmat4(1)});
        while (!open.empty()) {
            const auto [node, parent] = open.back();
            open.pop_back();
            ++nodes_;
            shown_ += node->mNumMeshes;
            const glm::dmat4 world = parent * matrixOf(node->mTransformation);
            for (unsigned i = 0; i < node->mNumMeshes; ++i) add(part(node->mMeshes[i]), world);
            for (unsigned i = node->mNumChildren; i > 0; --i) open.push_back({node->mChildren[i - 1], world});
        }
        if (pointsAndLines_ > 0)
            polygons_.notes.push_back(fmt::format("{} points and lines were left out", pointsAndLines_));
        if (polygons_.corners.empty())
            polygons_.notes.push_back(fmt::format("the scene shows {} meshes; the file has {} meshes and {} nodes",
                                                  shown_, scene_.mNumMeshes, nodes_));
        noteRounding();
        return std::move(polygons_);
    }

  private:
    void add(const ScenePart& part, const glm::dmat4& world) {
        const std::size_t first = polygons_.points.size();
        place(polygons_, part, world);
        double scale = 0, farthest = 0;
        for (int axis = 0; axis < 3; ++axis) scale = std::max(scale, glm::length(glm::dvec3(world[axis])));
        for (const unsigned corner : part.corners) {
            const glm::dvec3 &local = part.points[corner], &placed = polygons_.points[first + corner];
            farthest = std::max({farthest, std::abs(local.x), std::abs(local.y), std::abs(local.z)});
            lower_ = glm::min(lower_, placed);
            upper_ = glm::max(upper_, placed);
        }
        farthest_ = std::max(farthest_, scale * farthest);
    }

    void noteRounding() {
        const glm::dvec3 sides = upper_ - lower_;
        const double size = std::max({sides.x, sides.y, sides.z});
        if (!isTooFarForFloats(farthest_, size)) return;
        polygons_.notes.push_back(fmt::format(
            "the importer has single precision and rounds coordinates that are {:.6g} m from zero by up to {:.2g} m, "
            "for a mesh of {:.6g} m; move the mesh near to zero, or save it as OBJ or as PLY of doubles",
            farthest_, farthest_ * floatRounding, size));
    }

    ScenePart part(unsigned index) {
        if (index >= scene_.mNumMeshes)
            throw std::runtime_error(fmt::format("names mesh {}, but has {}", index, scene_.mNumMeshes));
        const aiMesh& mesh = *scene_.mMeshes[index];
        ScenePart part;
        for (unsigned i = 0; i < mesh.mNumVertices; ++i)
            part.points.push_back({mesh.mVertices[i].x, mesh.mVertices[i].y, mesh.mVertices[i].z});
        for (unsigned f = 0; f < mesh.mNumFaces; ++f) addFace(part, mesh.mFaces[f], f);
        return part;
    }

    void addFace(ScenePart& part, const aiFace& face, unsigned number) {
        if (face.mNumIndices < 3) {
            ++pointsAndLines_;
            return;
        }
        for (unsigned k = 0; k < face.mNumIndices; ++k) {
            if (face.mIndices[k] >= part.points.size())
                throw std::runtime_error(fmt::format("face {} uses vertex {}, but its mesh has {} vertices", number,
                                                     face.mIndices[k], part.points.size()));
            part.corners.push_back(face.mIndices[k]);
        }
        part.sizes.push_back(face.mNumIndices);
    }

    const aiScene& scene_;
    Polygons polygons_;
    std::size_t pointsAndLines_ = 0, nodes_ = 0, shown_ = 0;  // shown: count of mesh instances
    glm::dvec3 lower_{std::numeric_limits<double>::infinity()}, upper_{-std::numeric_limits<double>::infinity()};
    double farthest_ = 0;  // largest magnitude of a coordinate before the translation of its node [m]
};

}  // namespace

Polygons readByAssimp(const std::filesystem::path& path) {
    // Never deleted, because Assimp frees some scenes incorrectly, for example 3MF files with thumbnails.
    Assimp::Importer& importer = *new Assimp::Importer;
    const std::string extension = path.extension().string();
    if (!importer.IsExtensionSupported(extension.c_str()))
        throw std::runtime_error(
            extension.empty()
                ? "has no extension that would name its format, as .obj, .ply, .stl, .off, .gltf or .glb"
                : fmt::format("{} is not the extension of a format that is read, as .obj, .ply, .stl, .off, "
                              ".gltf or .glb",
                              extension));
    importer.SetIOHandler(new RegularFiles);  // the importer takes ownership
    importer.SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
    importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
    constexpr unsigned noFurtherStep = 0;
    const aiScene* scene = importer.ReadFile(path.string(), noFurtherStep);
    Polygons polygons;
    if (scene) polygons = polygonsOf(*scene);
    if (polygons.corners.empty() && isZip64(path))
        throw std::runtime_error("is a ZIP64 archive, of which the importer reads nothing; save it without ZIP64");
    if (scene) return polygons;
    // an exception carries more than its text
    if (importer.GetException()) std::rethrow_exception(importer.GetException());
    throw std::runtime_error(importer.GetErrorString());
}

Polygons polygonsOf(const aiScene& scene) {
    return AssimpScene(scene).read();
}

}  // namespace bilayer::detail
