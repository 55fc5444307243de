// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/body/stored_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "collider/contact/body/stored_body.h"
#include "sdf/base/quoted_text.h"

namespace bilayer::detail {
namespace {

// Bytes of a type unknown to OpenVDB: other programs pass them through unchanged.
using Bytes = openvdb::UnknownMetadata;
constexpr const char* meshType = "bilayer_mesh";
constexpr std::size_t maxMeshBytes = std::size_t(1) << 31;

struct MeshHead {
    std::uint64_t hash, points, triangles;
};

std::size_t bytesOf(const MeshHead& head) {
    const std::size_t maxCount = maxMeshBytes / sizeof(glm::vec3);  // of either: larger sums would overflow
    if (head.points > maxCount || head.triangles > maxCount) return std::numeric_limits<std::size_t>::max();
    return sizeof(head) + head.points * sizeof(glm::vec3) + head.triangles * sizeof(glm::uvec3);
}

/// Of nothing, pointers may be null, which std::memcpy() does not allow.
void copyBytes(void* to, const void* from, std::size_t count) {
    if (count > 0) std::memcpy(to, from, count);
}

}  // namespace

// A header, three coordinates per vertex, three vertex indices per triangle.
openvdb::Metadata::Ptr packMesh(const Mesh& mesh) {
    const MeshHead head{hash(mesh), mesh.points.size(), mesh.triangles.size()};
    if (bytesOf(head) > maxMeshBytes)
        throw std::invalid_argument(
            "the mesh is too large to store with its field: leave it out (withBody() with keepMesh = false, "
            "--no-mesh)");
    Bytes::ByteVec bytes(bytesOf(head));
    const std::size_t pointBytes = head.points * sizeof(glm::vec3);
    std::memcpy(bytes.data(), &head, sizeof(head));
    copyBytes(bytes.data() + sizeof(head), mesh.points.data(), pointBytes);
    copyBytes(bytes.data() + sizeof(head) + pointBytes, mesh.triangles.data(), head.triangles * sizeof(glm::uvec3));
    const auto entry = std::make_shared<Bytes>(meshType);
    entry->setValue(bytes);
    return entry;
}

std::shared_ptr<Mesh> unpackMesh(const openvdb::Metadata& entry) {
    const auto* stored = dynamic_cast<const Bytes*>(&entry);
    if (!stored) refuseBody(fmt::format("'{}' is of type {}", meshEntry, quotedWord(entry.typeName())));
    const Bytes::ByteVec& bytes = stored->value();
    MeshHead head{};
    copyBytes(&head, bytes.data(), std::min(sizeof(head), bytes.size()));
    if (bytesOf(head) != bytes.size()) refuseBody(fmt::format("'{}' is too short or too long", meshEntry));
    auto mesh = std::make_shared<Mesh>();
    mesh->points.resize(head.points);
    mesh->triangles.resize(head.triangles);
    const std::size_t pointBytes = head.points * sizeof(glm::vec3);
    copyBytes(mesh->points.data(), bytes.data() + sizeof(head), pointBytes);
    copyBytes(mesh->triangles.data(), bytes.data() + sizeof(head) + pointBytes, head.triangles * sizeof(glm::uvec3));
    if (hash(*mesh) != head.hash) refuseBody(fmt::format("'{}' is not what was written", meshEntry));
    try {
        validate(*mesh);
    } catch (const std::invalid_argument& error) {
        refuseBody(fmt::format("'{}': {}", meshEntry, error.what()));
    }
    return mesh;
}

}  // namespace bilayer::detail
