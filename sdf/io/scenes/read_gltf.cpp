// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/scenes/read_gltf.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <string>
#include <utility>
#include <vector>

#include "sdf/io/scenes/gltf_numbers.h"
#include "sdf/io/scenes/load_gltf.h"
#include "sdf/io/scenes/scene.h"

namespace bilayer::detail {
namespace {

template <class Items>
void requireIndex(int index, const Items& items, const char* what, const std::string& by) {
    require(index >= 0 && std::size_t(index) < items.size(), "{} names {} {}, but the file has {}", by, what, index,
            items.size());
}

// Tolerance for the bottom row of a matrix, for exporters that round to floats.
constexpr double bottomRowTolerance = 1e-6;

// Requires that a matrix is affine: its bottom row is 0 0 0 1.
void requireAffine(const glm::dmat4& m, const std::string& name) {
    const double row[] = {m[0][3], m[1][3], m[2][3], m[3][3]};
    for (int k = 0; k < 4; ++k)
        require(std::abs(row[k] - (k == 3)) <= bottomRowTolerance,
                "the bottom row of {} is {} {} {} {}; it must be 0 0 0 1, without perspective", name, row[0], row[1],
                row[2], row[3]);
}

// Exporters round, and some do not normalise.
glm::dquat rotationOf(const glm::dvec4& r, const std::string& name) {
    const double largest = std::max(  // against overflow and underflow of the squares
        {std::abs(r.x), std::abs(r.y), std::abs(r.z), std::abs(r.w)});
    const glm::dvec4 unit = glm::normalize(r / largest);
    require(largest > 0 && std::isfinite(unit.x + unit.y + unit.z + unit.w),
            "the {} is {} {} {} {}; it must be a quaternion of length 1", name, r.x, r.y, r.z, r.w);
    return {unit.w, unit.x, unit.y, unit.z};
}

glm::dmat4 transformOf(const glm::dvec3& translation, const glm::dquat& rotation, const glm::dvec3& scale) {
    glm::dmat4 m = glm::mat4_cast(rotation);
    for (int k = 0; k < 3; ++k) m[k] *= scale[k];
    m[3] = glm::dvec4(translation, 1);
    return m;
}

glm::dmat4 matrixOf(const std::vector<double>& numbers, const std::string& name) {
    glm::dmat4 matrix;
    for (int i = 0; i < 16; ++i) matrix[i / 4][i % 4] = numbers[std::size_t(i)];
    requireAffine(matrix, name);
    return matrix;
}

// Returns a node's own transform. Missing members default to the identity. parseGltf() has checked the lengths.
glm::dmat4 transformOf(const tinygltf::Node& node, std::size_t index) {
    const auto &t = node.translation, &r = node.rotation, &s = node.scale;
    if (!node.matrix.empty()) return matrixOf(node.matrix, fmt::format("the matrix of node {}", index));
    const glm::dquat rotation = r.empty()
                                    ? glm::dquat(1, 0, 0, 0)
                                    : rotationOf({r[0], r[1], r[2], r[3]}, fmt::format("rotation of node {}", index));
    return transformOf(t.empty() ? glm::dvec3(0) : glm::dvec3(t[0], t[1], t[2]), rotation,
                       s.empty() ? glm::dvec3(1) : glm::dvec3(s[0], s[1], s[2]));
}

// Converts the vertices of a strip or a fan into triangles: section 3.7.2.1 of the glTF 2.0 specification.
std::vector<unsigned> trianglesOf(const std::vector<unsigned>& vertices, int mode) {
    if (mode == TINYGLTF_MODE_TRIANGLES) return vertices;
    std::vector<unsigned> corners;
    for (std::size_t i = 0; i + 2 < vertices.size(); ++i) {
        const std::size_t odd = i % 2;
        if (mode == TINYGLTF_MODE_TRIANGLE_STRIP)
            corners.insert(corners.end(), {vertices[i], vertices[i + 1 + odd], vertices[i + 2 - odd]});
        else
            corners.insert(corners.end(), {vertices[i + 1], vertices[i + 2], vertices[0]});
    }
    return corners;
}

class GltfScene {
  public:
    explicit GltfScene(const tinygltf::Model& model) : model_(model), numbers_(model) {}

    Polygons read() {
        placeNodes();
        addNotes();
        return std::move(scene_);
    }

  private:
    struct Omitted {
        std::size_t linesOrPoints = 0, morphed = 0, cornersOfNone = 0;
    };

    std::vector<int> roots();
    void placeNodes();
    void placeMesh(std::size_t node);
    std::vector<glm::dmat4> instances(const tinygltf::Node& node, std::size_t index) const;
    bool hasData(int accessor) const;
    void readPrimitive(ScenePart& part, const tinygltf::Primitive& primitive, const std::string& name);
    void applySkin(ScenePart& part, const tinygltf::Primitive& primitive, int skin, const std::string& name) const;
    void addNotes();

    const tinygltf::Model& model_;
    GltfNumbers numbers_;
    std::vector<glm::dmat4> world_;  // for each node
    std::vector<char> reached_;      // nodes of the scene
    Polygons scene_;
    Omitted omitted_;
};

std::vector<int> GltfScene::roots() {
    if (!model_.scenes.empty()) {
        const int scene = std::max(model_.defaultScene, 0);
        requireIndex(scene, model_.scenes, "scene", "\"scene\"");
        if (model_.scenes.size() > 1)
            scene_.notes.push_back(fmt::format("scene {} of {} was read", scene, model_.scenes.size()));
        return model_.scenes[std::size_t(scene)].nodes;
    }
    std::vector<char> isChild(model_.nodes.size(), 0);
    for (const tinygltf::Node& node : model_.nodes)
        for (const int child : node.children)
            if (child >= 0 && std::size_t(child) < isChild.size()) isChild[std::size_t(child)] = 1;
    std::vector<int> roots;
    for (std::size_t i = 0; i < isChild.size(); ++i)
        if (!isChild[i]) roots.push_back(int(i));
    return roots;
}

// All transforms are computed before all meshes, since skins refer to nodes anywhere.
void GltfScene::placeNodes() {
    world_.assign(model_.nodes.size(), glm::dmat4(1));
    reached_.assign(model_.nodes.size(), 0);
    std::vector<std::size_t> order;
    const auto reach = [&](int child, const glm::dmat4& parent, const std::string& by) {
        requireIndex(child, model_.nodes, "node", by);
        const auto index = std::size_t(child);
        require(!reached_[index], "node {} is reached twice; the nodes of glTF are trees", child);
        reached_[index] = 1;
        world_[index] = parent * transformOf(model_.nodes[index], index);
        order.push_back(index);
    };
    for (const int root : roots()) reach(root, glm::dmat4(1), "the scene");
    for (std::size_t i = 0; i < order.size(); ++i) {
        const std::size_t parent = order[i];
        for (const int child : model_.nodes[parent].children)
            reach(child, world_[parent], fmt::format("node {}", parent));
    }
    for (const std::size_t node : order)
        if (model_.nodes[node].mesh >= 0) placeMesh(node);
}

void GltfScene::placeMesh(std::size_t index) {
    const tinygltf::Node& node = model_.nodes[index];
    requireIndex(node.mesh, model_.meshes, "mesh", fmt::format("node {}", index));
    const auto& primitives = model_.meshes[std::size_t(node.mesh)].primitives;
    const std::vector<glm::dmat4> transforms = instances(node, index);
    for (std::size_t k = 0; k < primitives.size(); ++k) {
        const std::string name = fmt::format("primitive {} of mesh {}", k, node.mesh);
        ScenePart part;
        readPrimitive(part, primitives[k], name);
        if (node.skin >= 0) applySkin(part, primitives[k], node.skin, name);
        for (const glm::dmat4& transform : transforms) place(scene_, part, transform);
    }
}

// Returns the world transforms of the node's mesh: one, or as many as EXT_mesh_gpu_instancing specifies. The joints of
// a skin place a mesh instead of its node.
std::vector<glm::dmat4> GltfScene::instances(const tinygltf::Node& node, std::size_t index) const {
    if (node.skin >= 0) return {glm::dmat4(1)};
    const auto extension = node.extensions.find("EXT_mesh_gpu_instancing");
    if (extension == node.extensions.end()) return {world_[index]};
    const std::string by = fmt::format("the instances of node {}", index);
    const tinygltf::Value& attributes =
        extension->second.Has("attributes") ? extension->second.Get("attributes") : extension->second;
    const auto accessor = [&](const char* name) {
        if (!attributes.Has(name)) return -1;
        const tinygltf::Value& value = attributes.Get(name);
        require(value.IsInt() && value.GetNumberAsInt() >= 0, "{} have a {} that is not the index of an accessor", by,
                name);
        return value.GetNumberAsInt();
    };
    const int t = accessor("TRANSLATION"), r = accessor("ROTATION"), s = accessor("SCALE");
    require(t >= 0 || r >= 0 || s >= 0, "{} have no TRANSLATION, ROTATION or SCALE", by);
    const auto translations = t >= 0 ? numbers_.vectors3(t, "TRANSLATION") : std::vector<glm::dvec3>();
    const auto rotations = r >= 0 ? numbers_.vectors4(r, "ROTATION") : std::vector<glm::dvec4>();
    const auto scales = s >= 0 ? numbers_.vectors3(s, "SCALE") : std::vector<glm::dvec3>();
    const std::size_t count = std::max({translations.size(), rotations.size(), scales.size()});
    require((t < 0 || translations.size() == count) && (r < 0 || rotations.size() == count) &&
                (s < 0 || scales.size() == count),
            "{} have {} translations, {} rotations and {} scales; the counts must be equal", by, translations.size(),
            rotations.size(), scales.size());
    std::vector<glm::dmat4> transforms;
    for (std::size_t i = 0; i < count; ++i)
        transforms.push_back(
            world_[index] *
            transformOf(t < 0 ? glm::dvec3(0) : translations[i],
                        r < 0 ? glm::dquat(1, 0, 0, 0)
                              : rotationOf(rotations[i], fmt::format("rotation of instance {} of node {}", i, index)),
                        s < 0 ? glm::dvec3(1) : scales[i]));
    return transforms;
}

// Whether the file has the values of an accessor. An accessor out of range is an error of its own.
bool GltfScene::hasData(int accessor) const {
    if (accessor < 0 || std::size_t(accessor) >= model_.accessors.size()) return true;
    const tinygltf::Accessor& values = model_.accessors[std::size_t(accessor)];
    return values.bufferView >= 0 || values.sparse.isSparse;
}

void GltfScene::readPrimitive(ScenePart& part, const tinygltf::Primitive& primitive, const std::string& name) {
    require(primitive.mode >= TINYGLTF_MODE_POINTS && primitive.mode <= TINYGLTF_MODE_TRIANGLE_FAN,
            "{} has mode {}; it must be 0 to 6", name, primitive.mode);
    if (primitive.mode < TINYGLTF_MODE_TRIANGLES) {
        ++omitted_.linesOrPoints;
        return;
    }
    omitted_.morphed += !primitive.targets.empty();
    const auto positions = primitive.attributes.find("POSITION");
    require(positions != primitive.attributes.end(), "{} has no POSITION", name);
    // an optional compression leaves the uncompressed data in the file
    for (const char* compression : {"KHR_draco_mesh_compression", "EXT_meshopt_compression"})
        require(!primitive.extensions.count(compression) ||
                    (hasData(positions->second) && (primitive.indices < 0 || hasData(primitive.indices))),
                "{} uses {}, which is not read; export it without", name, compression);
    part.points = numbers_.vectors3(positions->second, "POSITION");
    std::vector<unsigned> vertices;
    if (primitive.indices >= 0) {
        vertices = numbers_.unsignedIntegers(primitive.indices, "indices");
    } else {
        require(part.points.size() <= 0xffffffffu, "{} has {} vertices, more than can be numbered", name,
                part.points.size());
        for (std::size_t i = 0; i < part.points.size(); ++i) vertices.push_back(unsigned(i));
    }
    for (std::size_t i = 0; i < vertices.size(); ++i)
        require(vertices[i] < part.points.size(), "index {} of {} is {}, but there are {} vertices", i, name,
                vertices[i], part.points.size());
    part.corners = trianglesOf(vertices, primitive.mode);
    omitted_.cornersOfNone += part.corners.size() % 3;
    part.corners.resize(part.corners.size() - part.corners.size() % 3);
}

// Transforms the vertices by the joints of a skin: section 3.7.3.3 of the glTF 2.0 specification.
void GltfScene::applySkin(ScenePart& part, const tinygltf::Primitive& primitive, int index,
                          const std::string& name) const {
    requireIndex(index, model_.skins, "skin", name);
    const tinygltf::Skin& skin = model_.skins[std::size_t(index)];
    std::vector<glm::dmat4> joints(skin.joints.size(), glm::dmat4(1));
    if (skin.inverseBindMatrices >= 0) joints = numbers_.matrices(skin.inverseBindMatrices, "inverseBindMatrices");
    require(joints.size() >= skin.joints.size(), "skin {} has {} joints and {} inverseBindMatrices", index,
            skin.joints.size(), joints.size());
    for (std::size_t i = 0; i < skin.joints.size(); ++i) {
        requireIndex(skin.joints[i], model_.nodes, "node", fmt::format("skin {}", index));
        requireAffine(joints[i], fmt::format("inverse bind matrix {} of skin {}", i, index));
        joints[i] = world_[std::size_t(skin.joints[i])] * joints[i];
    }
    std::vector<glm::dvec3> placed(part.points.size(), glm::dvec3(0));
    std::vector<double> sums(part.points.size(), 0);
    for (int set = 0; primitive.attributes.count(fmt::format("JOINTS_{}", set)); ++set) {
        const auto weightsOf = primitive.attributes.find(fmt::format("WEIGHTS_{}", set));
        require(weightsOf != primitive.attributes.end(), "{} has JOINTS_{} without WEIGHTS_{}", name, set, set);
        const auto of = numbers_.vectors4(primitive.attributes.at(fmt::format("JOINTS_{}", set)), "JOINTS");
        const auto weights = numbers_.vectors4(weightsOf->second, "WEIGHTS");
        require(of.size() == part.points.size() && weights.size() == of.size(),
                "{} has {} vertices, {} joints and {} weights; the counts must be equal", name, part.points.size(),
                of.size(), weights.size());
        for (std::size_t i = 0; i < of.size(); ++i)
            for (int k = 0; k < 4; ++k) {
                if (weights[i][k] == 0) continue;
                require(of[i][k] >= 0 && of[i][k] < double(skin.joints.size()),
                        "vertex {} of {} has joint {}, but its skin has {}", i, name, of[i][k], skin.joints.size());
                placed[i] += weights[i][k] * glm::dvec3(joints[std::size_t(of[i][k])] * glm::dvec4(part.points[i], 1));
                sums[i] += weights[i][k];
            }
    }
    for (std::size_t i = 0; i < placed.size(); ++i) {
        require(sums[i] > 0, "vertex {} of {} has no weight for any joint of its skin", i, name);
        part.points[i] = placed[i] / sums[i];
    }
}

void GltfScene::addNotes() {
    const auto note = [&](std::size_t count, const char* text) {
        if (count > 0) scene_.notes.push_back(fmt::format("{} {}", count, text));
    };
    note(omitted_.linesOrPoints, "primitives of points or lines were left out");
    note(omitted_.morphed, "primitives have morph targets, which were not applied");
    note(omitted_.cornersOfNone, "indices at the ends of primitives make no whole triangle and were left out");
    std::vector<char> used(model_.meshes.size(), 0);
    std::size_t shown = 0, outside = 0;  // nodes with a mesh
    for (std::size_t i = 0; i < model_.nodes.size(); ++i) {
        if (model_.nodes[i].mesh < 0) continue;
        ++(reached_[i] ? shown : outside);
        if (reached_[i]) used[std::size_t(model_.nodes[i].mesh)] = 1;
    }
    note(std::size_t(std::count(used.begin(), used.end(), 0)),
         "meshes were left out, since no node of the scene shows them");
    note(outside, "nodes with a mesh are outside of the scene and were left out");
    if (scene_.corners.empty())
        scene_.notes.push_back(fmt::format("the scene shows {} meshes; the file has {} meshes and {} nodes", shown,
                                           model_.meshes.size(), model_.nodes.size()));
    if (std::any_of(model_.nodes.begin(), model_.nodes.end(), [](const auto& node) { return node.skin >= 0; }))
        scene_.notes.push_back("skins were applied in the pose of the file's nodes, without animation");
}

}  // namespace

Polygons readGltf(const std::filesystem::path& path) {
    const tinygltf::Model model = loadGltf(path);
    return GltfScene(model).read();
}

}  // namespace bilayer::detail
