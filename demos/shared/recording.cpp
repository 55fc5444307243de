// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/recording.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <glm/geometric.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <tuple>

#include "sdf/io/atomic_file.h"

namespace bilayer {

using namespace bilayer::detail;
namespace detail {
// the files of these names, embedded by the build
extern const char* const player_html;
extern const char* const player_scene_js;
extern const char* const player_js;
}  // namespace detail
}  // namespace bilayer

namespace bilayer::demo {
namespace {

constexpr const char* threeFolder = "/usr/share/javascript/three/";  // where Debian's libjs-three puts three.js
constexpr float coordinateSteps = 65535;                             // of a 16-bit coordinate
constexpr float quaternionSteps = 32767;                             // of a signed 16-bit component
constexpr float changingSteps = 4095;                                // of a coordinate of a surface that changes

template <class T>
std::string base64(const std::vector<T>& values) {
    static_assert(std::is_trivially_copyable_v<T>);
    constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::vector<unsigned char> bytes(values.size() * sizeof(T) + 2, 0);
    if (!values.empty()) std::memcpy(bytes.data(), values.data(), values.size() * sizeof(T));
    const std::size_t size = values.size() * sizeof(T);
    std::string text;
    text.reserve((size + 2) / 3 * 4);
    for (std::size_t i = 0; i < size; i += 3) {
        const unsigned word = unsigned(bytes[i]) << 16 | unsigned(bytes[i + 1]) << 8 | bytes[i + 2];
        for (int shift = 18; shift >= 0; shift -= 6) text += digits[word >> shift & 63];
    }
    // the last group may contain one byte or two
    for (std::size_t i = 0; i < (3 - size % 3) % 3; ++i) text[text.size() - 1 - i] = '=';
    return text;
}

std::string readText(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::stringstream text;
    if (!(text << file.rdbuf()))
        throw std::runtime_error(path.string() + ": cannot be read (Debian package libjs-three)");
    return text.str();
}

void replace(std::string& text, std::string_view placeholder, std::string_view value) {
    const std::size_t at = text.find(placeholder);
    if (at != std::string::npos) text.replace(at, placeholder.size(), value);
}

// Points quantised to 16-bit steps from `lower` to `upper`.
struct Quantised {
    Bounds box;
    std::vector<std::uint16_t> steps;
};

void append(Quantised& to, const glm::vec3& point) {
    for (int axis = 0; axis < 3; ++axis) {
        const float size = std::max(to.box.size()[axis], 1e-9f);  // avoids a division by zero for a flat box
        to.steps.push_back(std::uint16_t(std::lround((point[axis] - to.box.lower[axis]) / size * coordinateSteps)));
    }
}

nlohmann::json json(const glm::vec3& v) {
    return {v.x, v.y, v.z};
}

nlohmann::json json(const Mesh& mesh) {
    Quantised points{bounds(mesh), {}};
    for (const auto& point : mesh.points) append(points, point);
    std::vector<std::uint32_t> indices;
    for (const auto& t : mesh.triangles) indices.insert(indices.end(), {t.x, t.y, t.z});
    // half the bytes if 16 bits can index the points
    const bool small = mesh.points.size() <= 65536;
    return {{"lower", json(points.box.lower)},
            {"size", json(points.box.size())},
            {"points", base64(points.steps)},
            {"indexBits", small ? 16 : 32},
            {"indices", small ? base64(std::vector<std::uint16_t>(indices.begin(), indices.end())) : base64(indices)}};
}

nlohmann::json json(const Look& look) {
    nlohmann::json all = {{"colour", look.colour},
                          {"roughness", look.roughness},
                          {"metalness", look.metalness},
                          {"clearcoat", look.clearcoat},
                          {"opacity", look.opacity}};
    if (look.clear) all["clear"] = true;
    return all;
}

// Appends a number as a variable-length integer: seven bits per byte, the lowest first.
void append(std::vector<std::uint8_t>& to, std::uint32_t number) {
    for (; number > 127; number >>= 7) to.push_back(std::uint8_t(number | 128));
    to.push_back(std::uint8_t(number));
}

// Duplicates the vertices of a mesh along sharp edges, so that averaged vertex normals keep these edges sharp.
Mesh splitCreases(const Mesh& mesh, float crease) {
    const std::size_t corners = 3 * mesh.triangles.size();
    std::vector<std::size_t> parent(corners);
    std::iota(parent.begin(), parent.end(), std::size_t(0));
    const auto root = [&](std::size_t i) {
        while (parent[i] != i) i = parent[i] = parent[parent[i]];
        return i;
    };
    const auto normal = [&](std::size_t t) {
        const auto& [a, b, c] = std::tie(mesh.triangles[t].x, mesh.triangles[t].y, mesh.triangles[t].z);
        const glm::vec3 n = glm::cross(mesh.points[b] - mesh.points[a], mesh.points[c] - mesh.points[a]);
        return n / std::max(glm::length(n), 1e-30f);
    };

    // corners of one vertex are merged if a smooth edge joins their triangles
    std::map<std::pair<unsigned, unsigned>, std::size_t> edges;  // directed edge to its first corner
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
        for (int i = 0; i < 3; ++i)
            edges.emplace(std::pair(mesh.triangles[t][i], mesh.triangles[t][(i + 1) % 3]), 3 * t + std::size_t(i));
    for (const auto& [ends, first] : edges) {
        const auto opposite = edges.find({ends.second, ends.first});
        if (opposite == edges.end() || opposite->second < first) continue;
        const std::size_t second = opposite->second;
        if (glm::dot(normal(first / 3), normal(second / 3)) < std::cos(crease)) continue;
        const auto next = [](std::size_t corner) { return corner / 3 * 3 + (corner + 1) % 3; };
        parent[root(first)] = root(next(second));
        parent[root(next(first))] = root(second);
    }

    Mesh split;
    std::map<std::size_t, unsigned> places;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        glm::uvec3 triangle;
        for (int i = 0; i < 3; ++i) {
            const auto [place, isNew] = places.try_emplace(root(3 * t + std::size_t(i)), unsigned(split.points.size()));
            if (isNew) split.points.push_back(mesh.points[mesh.triangles[t][i]]);
            triangle[i] = place->second;
        }
        split.triangles.push_back(triangle);
    }
    return split;
}

}  // namespace

Recording::Recording(std::string title) : title_(std::move(title)) {}

void Recording::note(std::string label, std::string value) {
    notes_.emplace_back(std::move(label), std::move(value));
}

int Recording::addMesh(const Mesh& mesh, float crease) {
    validate(mesh);
    meshes_.push_back(splitCreases(mesh, crease));
    return int(meshes_.size()) - 1;
}

int Recording::addBody(int mesh, const Look& look) {
    if (mesh < 0 || mesh >= int(meshes_.size()))
        throw std::invalid_argument("recording: no mesh " + std::to_string(mesh));
    if (!times_.empty()) throw std::invalid_argument("recording: a body is added after the first frame");
    bodies_.push_back({mesh, look});
    return int(bodies_.size()) - 1;
}

int Recording::addChanging(const Look& look) {
    if (!times_.empty()) throw std::invalid_argument("recording: a body is added after the first frame");
    changing_.push_back({look, {}});
    return int(changing_.size()) - 1;
}

// Packs the points in the order of their first use by triangles. Neighbours are then close in both lists and
// differences are small. A coordinate is stored as the difference from the previous one. A corner is stored as the
// distance of its point back from the next new one.
Recording::Packed Recording::pack(const Mesh& mesh) {
    if (!mesh.triangles.empty()) validate(mesh);
    Packed packed;
    packed.box = bounds(mesh);
    if (packed.box.empty()) packed.box = {glm::vec3(0), glm::vec3(0)};
    const glm::vec3 size = glm::max(packed.box.size(), glm::vec3(1e-9f));
    std::vector<std::uint32_t> places(mesh.points.size(), 0);  // counted from 1; 0: not used yet
    std::uint32_t used = 0;
    glm::ivec3 last(0);
    for (const glm::uvec3& triangle : mesh.triangles)
        for (int i = 0; i < 3; ++i) {
            std::uint32_t& place = places[triangle[i]];
            append(packed.triangles, place ? used + 1 - place : 0);
            if (place) continue;
            place = ++used;
            const glm::vec3 part = (mesh.points[triangle[i]] - packed.box.lower) / size;
            const glm::ivec3 now(glm::round(part * changingSteps));
            for (int axis = 0; axis < 3; ++axis) {
                const int step = now[axis] - last[axis];
                append(packed.points, std::uint32_t(step < 0 ? -2 * step - 1 : 2 * step));
            }
            last = now;
        }
    return packed;
}

void Recording::frame(double time, std::span<const Pose> poses, std::span<const Mesh> surfaces) {
    if (poses.size() != bodies_.size())
        throw std::invalid_argument("recording: " + std::to_string(poses.size()) + " poses for " +
                                    std::to_string(bodies_.size()) + " bodies");
    if (surfaces.size() != changing_.size())
        throw std::invalid_argument("recording: " + std::to_string(surfaces.size()) + " surfaces for " +
                                    std::to_string(changing_.size()) + " bodies that change");
    if (!times_.empty() && !(float(time) > times_.back()))
        throw std::invalid_argument("recording: frame " + std::to_string(times_.size()) +
                                    " is not later than the last");
    std::vector<Packed> packed;
    for (const Mesh& mesh : surfaces) packed.push_back(pack(mesh));
    for (std::size_t i = 0; i < packed.size(); ++i) changing_[i].frames.push_back(std::move(packed[i]));
    times_.push_back(float(time));
    poses_.insert(poses_.end(), poses.begin(), poses.end());
}

// Returns the JSON that the player reads.
std::string Recording::data() const {
    nlohmann::json meshes = nlohmann::json::array(), bodies = meshes, notes = meshes;
    for (const Mesh& mesh : meshes_) meshes.push_back(json(mesh));
    for (const auto& [mesh, look] : bodies_) {
        bodies.push_back(json(look));
        bodies.back()["mesh"] = mesh;
    }
    for (const auto& [label, value] : notes_) notes.push_back({label, value});

    Quantised positions;
    for (const Pose& pose : poses_) positions.box.add(pose.position);
    std::vector<std::int16_t> rotations;
    for (const Pose& pose : poses_) {
        append(positions, pose.position);
        for (const float component : {pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w})
            rotations.push_back(std::int16_t(std::lround(std::clamp(component, -1.f, 1.f) * quaternionSteps)));
    }

    nlohmann::json all = {{"title", title_},
                          {"notes", notes},
                          {"view",
                           {{"target", json(view.target)},
                            {"distance", view.distance},
                            {"azimuth", view.azimuth},
                            {"elevation", view.elevation},
                            {"ground", view.groundHeight}}},
                          {"meshes", meshes},
                          {"bodies", bodies},
                          {"times", base64(times_)},
                          {"lower", json(positions.box.lower)},
                          {"size", json(positions.box.size())},
                          {"positions", base64(positions.steps)},
                          {"rotations", base64(rotations)}};
    if (view.moment >= 0) all["view"]["moment"] = view.moment;
    for (const auto& [look, frames] : changing_) {
        nlohmann::json body = json(look);
        for (const Packed& frame : frames)
            body["frames"].push_back({{"lower", json(frame.box.lower)},
                                      {"size", json(frame.box.size())},
                                      {"points", base64(frame.points)},
                                      {"triangles", base64(frame.triangles)}});
        all["changing"].push_back(std::move(body));
    }
    std::string text = all.dump();
    // "</script>" in a title would close the element that contains the data
    for (std::size_t at = 0; (at = text.find("</", at)) != std::string::npos; at += 3) text.insert(at + 1, "\\");
    return text;
}

void Recording::write(const std::filesystem::path& path) const {
    if (times_.empty()) throw std::invalid_argument("recording: no frame to write");
    std::string page = detail::player_html;
    replace(page, "/*SCENE*/", detail::player_scene_js);
    replace(page, "/*PLAYER*/", detail::player_js);
    replace(page, "/*THREE*/", readText(std::string(threeFolder) + "three.min.js"));
    replace(page, "/*CONTROLS*/", readText(std::string(threeFolder) + "examples/js/controls/OrbitControls.js"));
    replace(page, "/*DATA*/", data());

    writeWhole(path, [&](std::ostream& file) { file << page; });
}

}  // namespace bilayer::demo
