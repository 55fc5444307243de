// SPDX-License-Identifier: Apache-2.0
// The data of colliders that is made when it is first asked for. Programs that only ask link neither the construction
// of colliders nor the reading of body files.
#include "collider/contact/body/collider_data.h"

#include <bilayer/sdf/surface.h>
#include <oneapi/tbb/task_arena.h>

#include <memory>
#include <utility>

#include "collider/field/samples/field_data.h"
#include "sdf/base/access.h"
#include "sdf/mesh/topology.h"

namespace bilayer::detail {

Field fieldWithMesh(const Field& samples, std::shared_ptr<const Mesh> mesh) {
    return makeOf<Field>(std::make_shared<const FieldData>(dataOf(samples), std::move(mesh)));
}

template <class Make>
void ColliderData::once(std::once_flag& flag, const Make& make) {
    // isolated: a waiting thread must not take up a task that enters this same call
    std::call_once(flag, [&] { tbb::this_task_arena::isolate(make); });
}

const Mesh& ColliderData::mesh() const {
    if (body.mesh) return *body.mesh;
    once(once_, [&] {
        zeroSet_ = surface(*levelSet_);
        levelSet_.reset();
    });
    return zeroSet_;
}

const Field& ColliderData::exactField() const {
    if (field.mesh() || !body.mesh) return field;
    once(once_, [&] { exact_ = fieldWithMesh(field, body.mesh); });
    return *exact_;
}

const MeshTree& ColliderData::meshTree() const {
    if (const MeshTree* tree = dataOf(exactField()).mesh.get()) return *tree;
    once(treeOnce_, [&] { zeroSetTree_.emplace(mesh(), field.voxelSize()); });
    return *zeroSetTree_;
}

std::span<const glm::vec3> ColliderData::componentPoints() const {
    once(componentsOnce_, [&] {
        const Mesh welded = weld(mesh());
        ConcurrentDisjointSets sets = connectedVertices(welded);
        for (unsigned i = 0; i < welded.points.size(); ++i)
            if (sets.root(i) == i) componentPoints_.push_back(welded.points[i]);
    });
    return componentPoints_;
}

}  // namespace bilayer::detail
