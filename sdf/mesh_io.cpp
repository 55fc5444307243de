#include "sdf/mesh_io.h"

#include <fmt/format.h>

#include <assimp/DefaultIOSystem.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/Exporter.hpp>
#include <assimp/Importer.hpp>

#include <cctype>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>

#include "sdf/atomic_file.h"
#include "sdf/input_file.h"
#include "sdf/mesh_guard.h"
#include "sdf/scene_io.h"

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

const aiScene* readScene(Assimp::Importer& importer, const std::filesystem::path& path) {
    constexpr unsigned none = 0;
    const std::string ending = lowerEnding(path);
    if (ending == ".off") {
        const std::string text = guardedOff(path);
        return importer.ReadFileFromMemory(text.data(), text.size(), none, "off");
    }
    if (ending == ".ply") guardPly(path);
    if (ending == ".stl") guardStl(path);
    return importer.ReadFile(path.string(), none);
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

void add(Mesh& mesh, const aiMesh& part) {
    const auto base = unsigned(mesh.points.size());
    for (unsigned i = 0; i < part.mNumVertices; ++i)
        mesh.points.push_back({part.mVertices[i].x, part.mVertices[i].y, part.mVertices[i].z});
    for (unsigned i = 0; i < part.mNumFaces; ++i) {
        const aiFace& face = part.mFaces[i];
        if (face.mNumIndices == 3)
            mesh.triangles.push_back({base + face.mIndices[0], base + face.mIndices[1], base + face.mIndices[2]});
    }
}

// Faces cut into fans.
Mesh fanned(const Polygons& polygons) {
    Mesh mesh;
    for (const glm::dvec3& p : polygons.points) mesh.points.push_back(glm::vec3(p));
    std::size_t first = 0;
    for (std::size_t face = 0; first < polygons.corners.size(); ++face) {
        const std::size_t size = polygons.sizes.empty() ? 3 : polygons.sizes[face];
        const unsigned* corners = polygons.corners.data() + first;
        for (std::size_t k = 2; k < size; ++k) mesh.triangles.push_back({corners[0], corners[k - 1], corners[k]});
        first += size;
    }
    return mesh;
}

Mesh readByAssimp(const std::filesystem::path& path) {
    Assimp::Importer importer;
    importer.SetIOHandler(new RegularFiles);  // the importer's own from here on
    importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, int(unwanted));
    importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
    const aiScene* scene = readScene(importer, path);
    if (scene) {
        checkFaces(*scene, path);
        scene = importer.ApplyPostProcessing(steps);
    }
    if (!scene) throw std::runtime_error(fmt::format("{}: {}", path.string(), importer.GetErrorString()));
    Mesh mesh;
    for (unsigned i = 0; i < scene->mNumMeshes; ++i) add(mesh, *scene->mMeshes[i]);
    return mesh;
}

// The one mesh as an Assimp scene, which owns it.
std::unique_ptr<aiScene> toScene(const Mesh& mesh) {
    auto scene = std::make_unique<aiScene>();
    scene->mMaterials = new aiMaterial* [1] { new aiMaterial };
    scene->mNumMaterials = 1;
    auto* part = new aiMesh;
    scene->mMeshes = new aiMesh* [1] { part };
    scene->mNumMeshes = 1;
    scene->mRootNode = new aiNode;
    scene->mRootNode->mMeshes = new unsigned[1]{0};
    scene->mRootNode->mNumMeshes = 1;
    part->mPrimitiveTypes = aiPrimitiveType_TRIANGLE;
    part->mNumVertices = unsigned(mesh.points.size());
    part->mVertices = new aiVector3D[mesh.points.size()];
    for (std::size_t i = 0; i < mesh.points.size(); ++i)
        part->mVertices[i] = {mesh.points[i].x, mesh.points[i].y, mesh.points[i].z};
    part->mNumFaces = unsigned(mesh.triangles.size());
    part->mFaces = new aiFace[mesh.triangles.size()];
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        part->mFaces[i].mNumIndices = 3;
        part->mFaces[i].mIndices = new unsigned[3]{mesh.triangles[i].x, mesh.triangles[i].y, mesh.triangles[i].z};
    }
    return scene;
}

}  // namespace

Mesh readMesh(const std::filesystem::path& path) {
    requireInputFile(path);
    const std::string ending = lowerEnding(path);
    const bool byAssimp = ending == ".obj" || ending == ".ply" || ending == ".stl" || ending == ".off";
    Mesh mesh = byAssimp ? readByAssimp(path) : fanned(readScene(path));
    if (mesh.triangles.empty()) throw std::runtime_error(fmt::format("{}: holds no triangle", path.string()));
    try {
        validate(mesh);
    } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(fmt::format("{}: {}", path.string(), error.what()));
    }
    mesh = weld(mesh);
    if (mesh.triangles.empty())
        throw std::runtime_error(fmt::format("{}: holds no triangle with three different corners", path.string()));
    return mesh;
}

void writeMesh(const std::filesystem::path& path, const Mesh& mesh) {
    const std::string ending = lowerEnding(path);
    const char* format = ending == ".obj"   ? "objnomtl"
                         : ending == ".ply" ? "plyb"
                         : ending == ".stl" ? "stlb"
                                            : nullptr;
    if (!format)
        throw std::invalid_argument(fmt::format("{}: meshes are written as .obj, .ply or .stl", path.string()));
    validate(mesh);
    const std::unique_ptr<aiScene> scene = toScene(mesh);
    Assimp::Exporter exporter;
    const aiExportDataBlob* blob = exporter.ExportToBlob(scene.get(), format);
    if (!blob) throw std::runtime_error(fmt::format("{}: {}", path.string(), exporter.GetErrorString()));
    AtomicFile file(path);
    std::ofstream stream(file.temporary(), std::ios::binary);
    stream.write(static_cast<const char*>(blob->data), std::streamsize(blob->size));
    stream.close();
    if (!stream) throw std::runtime_error(fmt::format("{}: cannot be written (is the disk full?)", path.string()));
    file.commit();
}

}  // namespace bilayer
