#include "sdf/mesh_io.h"

#include <fmt/format.h>

#include <assimp/DefaultIOSystem.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/Importer.hpp>

#include <cctype>
#include <stdexcept>
#include <string>
#include <system_error>

#include "sdf/input_file.h"
#include "sdf/mesh_readers.h"
#include "sdf/polygons.h"

namespace bilayer {
namespace {

constexpr unsigned unwanted = aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS | aiComponent_COLORS |
                              aiComponent_TEXCOORDS | aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                              aiComponent_TEXTURES | aiComponent_LIGHTS | aiComponent_CAMERAS | aiComponent_MATERIALS;

constexpr unsigned steps =
    aiProcess_RemoveComponent | aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_PreTransformVertices;

/// Of the files that a mesh refers to, materials for example, only regular ones are there for Assimp: others may never
/// end.
class RegularFiles : public Assimp::DefaultIOSystem {
  public:
    bool Exists(const char* file) const override {
        std::error_code absent;
        return std::filesystem::is_regular_file(file, absent);
    }
    Assimp::IOStream* Open(const char* file, const char* mode) override {
        return Exists(file) ? DefaultIOSystem::Open(file, mode) : nullptr;
    }
};

std::string lowerEnding(const std::filesystem::path& path) {
    std::string ending = path.extension().string();
    for (char& c : ending) c = char(std::tolower(static_cast<unsigned char>(c)));
    return ending;
}

// Assimp's later steps take it for granted that faces have corners, which are vertices that exist.
void checkFaces(const aiScene& scene, const std::filesystem::path& path) {
    for (unsigned m = 0; m < scene.mNumMeshes; ++m)
        for (unsigned f = 0; f < scene.mMeshes[m]->mNumFaces; ++f) {
            const aiFace& face = scene.mMeshes[m]->mFaces[f];
            if (face.mNumIndices == 0)
                throw std::runtime_error(fmt::format("{}: face {} has no corner", path.string(), f));
            for (unsigned k = 0; k < face.mNumIndices; ++k)
                if (face.mIndices[k] >= scene.mMeshes[m]->mNumVertices)
                    throw std::runtime_error(fmt::format("{}: face {} uses vertex {}, but there are only {}",
                                                         path.string(), f, face.mIndices[k],
                                                         scene.mMeshes[m]->mNumVertices));
        }
}

Polygons readScene(const std::filesystem::path& path) {
    Assimp::Importer importer;
    importer.SetIOHandler(new RegularFiles);  // the importer's own from here on
    importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, int(unwanted));
    importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
    requireInputFile(path);
    const aiScene* scene = importer.ReadFile(path.string(), 0);
    if (scene) {
        checkFaces(*scene, path);
        scene = importer.ApplyPostProcessing(steps);
    }
    if (!scene) throw std::runtime_error(fmt::format("{}: {}", path.string(), importer.GetErrorString()));
    Polygons polygons;
    for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
        const aiMesh& part = *scene->mMeshes[m];
        const auto base = unsigned(polygons.points.size());
        for (unsigned i = 0; i < part.mNumVertices; ++i)
            polygons.points.push_back({part.mVertices[i].x, part.mVertices[i].y, part.mVertices[i].z});
        for (unsigned i = 0; i < part.mNumFaces; ++i)
            if (part.mFaces[i].mNumIndices == 3)
                for (unsigned k = 0; k < 3; ++k) polygons.corners.push_back(base + part.mFaces[i].mIndices[k]);
    }
    return polygons;
}

}  // namespace

Mesh readMesh(const std::filesystem::path& path, ReadReport* report) {
    ReadReport ignored;
    ReadReport& told = report ? *report : ignored;
    told = {};
    const std::string ending = lowerEnding(path);
    if (ending == ".obj") return readObj(path, told);
    if (ending == ".ply") return readPly(path, told);
    if (ending == ".stl") return readStl(path, told);
    if (ending == ".off") return readOff(path, told);
    return assembled(readScene(path), path, told);
}

}  // namespace bilayer
