// SPDX-License-Identifier: Apache-2.0
// Bodies that fall on five kinds of ground, and the energy that they gain. For tests and benchmarks.
#pragma once

#include <glm/gtc/quaternion.hpp>
#include <glm/vec2.hpp>
#include <memory>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/sdf/mesh.h>

class btCollisionShape;

namespace bilayer::test {

constexpr float dropHeight = 0.1f;      ///< from which bodies fall on the top of the ground [m]
constexpr double maxEnergyGain = 0.01;  ///< of a usable body, relative to the energy of the fall, m g h

/// A static ground, at most 3 cm high.
struct Ground {
    const char* name;
    std::shared_ptr<btCollisionShape> shape;
};

/// A plane, a box, and waves of 3 cm as a field, a triangle mesh and a height field, in this order.
std::vector<Ground> grounds();

/// Where a body falls.
struct DropPlace {
    glm::quat rotation;  ///< of the mesh
    glm::vec2 centre;    ///< of the mesh's own origin [m]
};

/// The result of a drop.
struct Drop {
    /// Maximum increase of the energy over its earlier minimum, relative to the energy of the fall. Infinite if the
    /// motion is not finite.
    double gain = 0;
    int sidewaysContacts = 0;  ///< contacts in all steps whose normals point sideways or down
    bool sleeps = false;       ///< at the end
    bool fell = false;         ///< the centre of mass ends below the ground: the body went through it, or over its side
};

/// Drops a body of 1 kg, in steps of 1/240 s. Throws std::invalid_argument for a body without volume.
Drop drop(const std::shared_ptr<const Collider>& collider, btCollisionShape& ground, const DropPlace& place,
          float seconds);

/// Returns a mesh for dropping: y points up, the centre of the bounds is the origin, and the longest side is 0.8 m.
Mesh droppable(const Mesh& mesh);

}  // namespace bilayer::test
