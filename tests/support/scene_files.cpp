// SPDX-License-Identifier: Apache-2.0
#include "tests/support/scene_files.h"

#include <fmt/format.h>
#include <zlib.h>

#include <assimp/mesh.h>
#include <assimp/scene.h>
#include <array>
#include <assimp/Exporter.hpp>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>

#include "tests/support/gltf.h"
#include "tests/support/support.h"

namespace bilayer::test {
namespace {

std::size_t triangleCount() {
    return cubeCorners().size() / 3;
}

glm::vec3 corner(std::size_t triangle, std::size_t k) {
    return cubePoints()[cubeCorners()[3 * triangle + k]];
}

std::unique_ptr<aiScene> cubeScene() {
    auto scene = std::make_unique<aiScene>();
    scene->mMaterials = new aiMaterial* [1] { new aiMaterial };
    scene->mNumMaterials = 1;
    auto* mesh = new aiMesh;
    scene->mMeshes = new aiMesh* [1] { mesh };
    scene->mNumMeshes = 1;
    scene->mRootNode = new aiNode("root");
    auto* child = new aiNode("cube");
    child->mMeshes = new unsigned[1]{0};
    child->mNumMeshes = 1;
    scene->mRootNode->addChildren(1, &child);
    mesh->mName = "cube";
    mesh->mPrimitiveTypes = aiPrimitiveType_TRIANGLE;
    mesh->mNumVertices = unsigned(cubePoints().size());
    mesh->mVertices = new aiVector3D[cubePoints().size()];
    mesh->mNormals = new aiVector3D[cubePoints().size()];
    for (std::size_t i = 0; i < cubePoints().size(); ++i) {
        mesh->mVertices[i] = {cubePoints()[i].x, cubePoints()[i].y, cubePoints()[i].z};
        mesh->mNormals[i] = mesh->mVertices[i];
    }
    mesh->mNumFaces = unsigned(triangleCount());
    mesh->mFaces = new aiFace[triangleCount()];
    for (std::size_t t = 0; t < triangleCount(); ++t) {
        mesh->mFaces[t].mNumIndices = 3;
        mesh->mFaces[t].mIndices =
            new unsigned[3]{cubeCorners()[3 * t], cubeCorners()[3 * t + 1], cubeCorners()[3 * t + 2]};
    }
    return scene;
}

SceneFile exported(const char* format, const char* name) {
    Assimp::Exporter exporter;
    const std::filesystem::path path = scratch(name);
    if (exporter.Export(cubeScene().get(), format, path.string()) != aiReturn_SUCCESS)
        throw std::runtime_error(exporter.GetErrorString());
    return {name, contentsOf(path)};
}

SceneFile ac() {
    std::string text =
        "AC3Db\nMATERIAL \"\" rgb 1 1 1  amb 0 0 0  emis 0 0 0  spec 0 0 0  shi 0  trans 0\n"
        "OBJECT world\nkids 1\nOBJECT poly\nname \"cube\"\nnumvert 8\n";
    for (const glm::vec3& p : cubePoints()) text += fmt::format("{} {} {}\n", p.x, p.y, p.z);
    text += fmt::format("numsurf {}\n", triangleCount());
    for (std::size_t t = 0; t < triangleCount(); ++t) {
        text += "SURF 0x0\nmat 0\nrefs 3\n";
        for (std::size_t k = 0; k < 3; ++k) text += fmt::format("{} 0 0\n", cubeCorners()[3 * t + k]);
    }
    return {"cube.ac", text + "kids 0\n"};
}

SceneFile smd() {
    std::string text = "version 1\nnodes\n0 \"root\" -1\nend\nskeleton\ntime 0\n0 0 0 0 0 0 0\nend\ntriangles\n";
    for (std::size_t t = 0; t < triangleCount(); ++t) {
        text += "skin.bmp\n";
        for (std::size_t k = 0; k < 3; ++k) {
            const glm::vec3 p = corner(t, k);
            text += fmt::format("0 {} {} {} 0 0 1 0 0\n", p.x, p.y, p.z);
        }
    }
    return {"cube.smd", text + "end\n"};
}

SceneFile nff() {
    std::string text;
    for (std::size_t t = 0; t < triangleCount(); ++t) {
        text += "p 3\n";
        for (std::size_t k = 0; k < 3; ++k) {
            const glm::vec3 p = corner(t, k);
            text += fmt::format("{} {} {}\n", p.x, p.y, p.z);
        }
    }
    return {"cube.nff", text};
}

SceneFile raw() {
    std::string text = "cube\n";
    for (std::size_t t = 0; t < triangleCount(); ++t) {
        for (std::size_t k = 0; k < 3; ++k) {
            const glm::vec3 p = corner(t, k);
            text += fmt::format("{} {} {} ", p.x, p.y, p.z);
        }
        text += "\n";
    }
    return {"cube.raw", text};
}

SceneFile dxf() {
    std::string text = "0\nSECTION\n2\nENTITIES\n";
    for (std::size_t t = 0; t < triangleCount(); ++t) {
        text += "0\n3DFACE\n8\n0\n";
        for (std::size_t k = 0; k < 4; ++k) {
            const glm::vec3 p = corner(t, std::min<std::size_t>(k, 2));
            text += fmt::format("{}\n{}\n{}\n{}\n{}\n{}\n", 10 + k, p.x, 20 + k, p.y, 30 + k, p.z);
        }
    }
    return {"cube.dxf", text + "0\nENDSEC\n0\nEOF\n"};
}

SceneFile amf() {
    std::string text =
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<amf unit=\"meter\"><object id=\"1\"><mesh><vertices>";
    for (const glm::vec3& p : cubePoints())
        text += fmt::format("<vertex><coordinates><x>{}</x><y>{}</y><z>{}</z></coordinates></vertex>", p.x, p.y, p.z);
    text += "</vertices><volume>";
    for (std::size_t t = 0; t < triangleCount(); ++t)
        text += fmt::format("<triangle><v1>{}</v1><v2>{}</v2><v3>{}</v3></triangle>", cubeCorners()[3 * t],
                            cubeCorners()[3 * t + 1], cubeCorners()[3 * t + 2]);
    return {"cube.amf", text + "</volume></mesh></object></amf>\n"};
}

SceneFile md5() {
    std::string text =
        "MD5Version 10\ncommandline \"\"\n\nnumJoints 1\nnumMeshes 1\n\njoints {\n"
        "\t\"origin\"\t-1 ( 0 0 0 ) ( 0 0 0 )\n}\n\nmesh {\n\tshader \"x\"\n\n\tnumverts 8\n";
    for (std::size_t i = 0; i < 8; ++i) text += fmt::format("\tvert {} ( 0 0 ) {} 1\n", i, i);
    text += fmt::format("\n\tnumtris {}\n", triangleCount());
    for (std::size_t t = 0; t < triangleCount(); ++t)
        text += fmt::format("\ttri {} {} {} {}\n", t, cubeCorners()[3 * t], cubeCorners()[3 * t + 2],
                            cubeCorners()[3 * t + 1]);
    text += "\n\tnumweights 8\n";
    for (std::size_t i = 0; i < 8; ++i) {
        const glm::vec3 p = cubePoints()[i];
        text += fmt::format("\tweight {} 0 1.0 ( {} {} {} )\n", i, p.x, p.y, p.z);
    }
    return {"cube.md5mesh", text + "}\n"};
}

template <class T>
void append(std::string& bytes, T value, bool bigEndian = false) {
    std::string one(reinterpret_cast<const char*>(&value), sizeof value);
    bytes += bigEndian ? std::string(one.rbegin(), one.rend()) : one;
}

std::string bigEndianChunk(const char* id, const std::string& data) {
    std::string bytes = id;
    append(bytes, std::uint32_t(data.size()), true);
    return bytes + data;
}

SceneFile lwo() {
    std::string points, faces{"FACE"};
    for (const glm::vec3& p : cubePoints())
        for (const float x : {p.x, p.y, p.z}) append(points, x, true);
    for (std::size_t t = 0; t < triangleCount(); ++t) {
        append(faces, std::uint16_t(3), true);
        // clockwise and left-handed
        for (std::size_t k = 0; k < 3; ++k) append(faces, std::uint16_t(cubeCorners()[3 * t + k]), true);
    }
    const std::string layer(18, '\0');
    const std::string form = "LWO2" + bigEndianChunk("TAGS", std::string("Default\0", 8)) +
                             bigEndianChunk("LAYR", layer) + bigEndianChunk("PNTS", points) +
                             bigEndianChunk("POLS", faces);
    return {"cube.lwo", bigEndianChunk("FORM", form)};
}

std::string b3dChunk(const char* id, const std::string& data) {
    std::string bytes = id;
    append(bytes, std::uint32_t(data.size()));
    return bytes + data;
}

SceneFile b3d() {
    std::string vertices, triangles, mesh, node("cube\0", 5), file;
    for (const std::uint32_t none : {0u, 0u, 0u}) append(vertices, none);
    for (const glm::vec3& p : cubePoints())
        for (const float x : {p.x, p.y, p.z}) append(vertices, x);
    append(triangles, std::int32_t(-1));
    for (const unsigned c : cubeCorners()) append(triangles, std::uint32_t(c));
    append(mesh, std::int32_t(-1));
    mesh += b3dChunk("VRTS", vertices) + b3dChunk("TRIS", triangles);
    for (const float x : {0.f, 0.f, 0.f, 1.f, 1.f, 1.f, 1.f, 0.f, 0.f, 0.f}) append(node, x);
    node += b3dChunk("MESH", mesh);
    append(file, std::uint32_t(1));
    return {"cube.b3d", b3dChunk("BB3D", file + b3dChunk("NODE", node))};
}

SceneFile md2() {
    constexpr std::uint32_t headerSize = 68;
    const auto triangles = std::uint32_t(triangleCount());
    std::string frame;
    for (const float x : {1.f, 1.f, 1.f, -1.f, -1.f, -1.f}) append(frame, x);
    frame += std::string("frame").append(11, '\0');
    for (const glm::vec3& p : cubePoints())
        for (const float x : {p.x + 1, p.y + 1, p.z + 1, 0.f}) append(frame, std::uint8_t(x));
    std::string faces;
    for (const unsigned c : cubeCorners()) append(faces, std::uint16_t(c));
    std::string interleaved;  // three vertices and three texture coordinates per triangle
    for (std::size_t t = 0; t < triangles; ++t) interleaved += faces.substr(6 * t, 6) + std::string(6, '\0');
    std::string bytes = "IDP2";
    const std::uint32_t textureAt = headerSize, triangleAt = textureAt + 4,
                        frameAt = triangleAt + std::uint32_t(interleaved.size()),
                        end = frameAt + std::uint32_t(frame.size());
    for (const std::uint32_t n : {8u, 16u, 16u, std::uint32_t(frame.size()), 0u, 8u, 1u, triangles, 0u, 1u, headerSize,
                                  textureAt, triangleAt, frameAt, end, end})
        append(bytes, n);
    return {"cube.md2", bytes + std::string(4, '\0') + interleaved + frame + std::string(4, '\0')};
}

std::vector<SceneFile> gltfFiles() {
    Gltf gltf = Gltf::cube();
    gltf.file["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
        {"TRANSLATION", gltf.points({{0, 0, 0}, {5, 0, 0}})}};
    gltf.file["skins"] = {{{"joints", {0}}}};
    gltf.file["accessors"][0]["sparse"] = {
        {"count", 1},
        {"indices", {{"bufferView", gltf.view({7}, Gltf::UnsignedByte)}, {"componentType", 5121}}},
        {"values", {{"bufferView", gltf.view({1, 1, 1}, Gltf::Float)}}}};
    return {{"cube.gltf", contentsOf(gltf.write("cube.gltf"))}, {"cube.glb", contentsOf(gltf.writeBinary("cube.glb"))}};
}

}  // namespace

std::vector<SceneFile> cubeFiles() {
    std::vector<SceneFile> files;
    for (const auto& [format, name] :
         {std::pair("collada", "cube.dae"), std::pair("x", "cube.x"), std::pair("3ds", "cube.3ds"),
          std::pair("assbin", "cube.assbin"), std::pair("x3d", "cube.x3d"), std::pair("fbxa", "cube.fbx")})
        files.push_back(exported(format, name));
    files.push_back({"cube.3mf", zip(parts3mf())});
    for (const SceneFile& file : {ac(), smd(), nff(), raw(), dxf(), amf(), md5(), lwo(), b3d(), md2()})
        files.push_back(file);
    return files;
}

std::vector<SceneFile> headFiles() {
    using namespace std::string_literals;
    return {
        {"a.mdc", "CPDI\2\0\0\0"s},
        {"a.md3", "IDP3\17\0\0\0"s},
        {"a.mdl", "IDPO\6\0\0\0"s},
        {"a.ndo", "nendo 1.1"s},
        {"a.iqm", "INTERQUAKEMODEL\0\2\0\0\0"s},
        {"a.blend", "BLENDER-v262"s},
        {"a.csm", "$comments\n$firstframe 1\n$lastframe 2\n$order\na b\n$points\n1 0 0 0 1 1 1\n"s},
        {"a.bvh", "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\nEnd Site\n{\n"s},
        {"a.q3o", "quick3Do"s},
        {"a.ter", "TERRAGENTERRAIN "s},
        {"a.ms3d", "MS3D000000\4\0\0\0"s},
        {"a.hmp", "HMP7"s},
        {"a.pmx", "PMX \0\0\0\x40"s},
        {"a.bsp", "IBSP\x2e\0\0\0"s},
        {"a.sib", "HEAD\0\0\0\4\0\0\0\1"s},
        {"a.cob", "Caligari V00.01ALH             \n"s},
        {"a.ase", "*3DSMAX_ASCIIEXPORT 200\n*GEOMOBJECT {\n*MESH {\n*MESH_NUMVERTEX 3\n*MESH_NUMFACES 1\n"s},
        {"a.ogex", "Metric (key = \"up\") {string {\"z\"}}\nGeometryNode $n {ObjectRef {ref {$g}}}\n"s},
        {"a.xgl", "<WORLD><MESH ID=\"0\"><P ID=\"0\">0,0,0</P><F><FV1><PREF>0</PREF></FV1></F></MESH></WORLD>"s},
        {"a.irr", "<?xml version=\"1.0\"?>\n<irr_scene><node type=\"cube\"/></irr_scene>"s},
        {"a.irrmesh", "<?xml version=\"1.0\"?>\n<mesh><buffer><vertices type=\"standard\" vertexCount=\"3\">"s},
        {"a.mesh.xml", "<mesh><submeshes><submesh><faces count=\"1\"><face v1=\"0\" v2=\"1\" v3=\"2\"/>"s},
        {"a.mesh", "\0\x10[MeshSerializer_v1.41]\n"s},
        {"a.ifc",
         "ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('IFC2X3'));\nENDSEC;\nDATA;\n#1=IFCPROJECT('a',$,$,$,$,$,"
         "$,$,$);\nENDSEC;\nEND-ISO-10303-21;\n"s},
        {"a.lws", "LWSC\n3\n\nLoadObjectLayer 1 a.lwo\n"s},
        {"a.3d", "\3\0\0\0\3\0\0\0"s},
        {"a.zae", zip({{"manifest.xml", "<dae_root>./a.dae</dae_root>"}, {"a.dae", "<COLLADA version=\"1.4.1\"/>"}})},
        {"a.pk3", zip({{"maps/a.bsp", "IBSP\x2e\0\0\0"s}})},
        {"a.3mf", zip({{"3D/nothing.txt", ""}})}};
}

std::vector<SceneFile> sceneFiles() {
    std::vector<SceneFile> all;
    for (const auto& files : {cubeFiles(), headFiles(), gltfFiles()}) all.insert(all.end(), files.begin(), files.end());
    return all;
}

std::vector<SceneFile> parts3mf() {
    std::string model =
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"millimeter\" "
        "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"><resources><object "
        "id=\"1\" type=\"model\"><mesh><vertices>";
    for (const glm::vec3& p : cubePoints()) model += fmt::format("<vertex x=\"{}\" y=\"{}\" z=\"{}\"/>", p.x, p.y, p.z);
    model += "</vertices><triangles>";
    for (std::size_t t = 0; t < triangleCount(); ++t)
        model += fmt::format("<triangle v1=\"{}\" v2=\"{}\" v3=\"{}\"/>", cubeCorners()[3 * t],
                             cubeCorners()[3 * t + 1], cubeCorners()[3 * t + 2]);
    model += "</triangles></mesh></object></resources><build><item objectid=\"1\"/></build></model>";
    return {{"[Content_Types].xml",
             "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Types "
             "xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\"><Default Extension=\"rels\" "
             "ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/><Default Extension=\"model\" "
             "ContentType=\"application/vnd.ms-package.3dmanufacturing-3dmodel+xml\"/></Types>"},
            {"_rels/.rels",
             "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Relationships "
             "xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\"><Relationship "
             "Target=\"/3D/3dmodel.model\" Id=\"rel0\" "
             "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>"},
            {"3D/3dmodel.model", model}};
}

std::string zip(const std::vector<SceneFile>& files) {
    std::string bytes, directory;
    for (const SceneFile& file : files) {
        const auto check =
            std::uint32_t(::crc32(0, reinterpret_cast<const Bytef*>(file.bytes.data()), unsigned(file.bytes.size())));
        std::string common;  // fields that the file's own header and its directory entry share
        for (const std::uint16_t n : {20, 0, 0, 0, 33}) append(common, n);
        for (const std::uint32_t n : {check, std::uint32_t(file.bytes.size()), std::uint32_t(file.bytes.size())})
            append(common, n);
        for (const std::uint16_t n : {std::uint16_t(file.name.size()), std::uint16_t(0)}) append(common, n);
        directory += "PK\1\2" + std::string("\x14\0", 2) + common + std::string(10, '\0');
        append(directory, std::uint32_t(bytes.size()));
        directory += file.name;
        bytes += "PK\3\4" + common + file.name + file.bytes;
    }
    std::string end = "PK\5\6" + std::string(4, '\0');
    for (int i = 0; i < 2; ++i) append(end, std::uint16_t(files.size()));
    for (const std::size_t n : {directory.size(), bytes.size()}) append(end, std::uint32_t(n));
    return bytes + directory + end + std::string(2, '\0');
}

}  // namespace bilayer::test
