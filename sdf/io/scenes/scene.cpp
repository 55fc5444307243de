// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/scenes/scene.h"

#include <algorithm>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <stdexcept>

namespace bilayer::detail {
namespace {

// Each face keeps its first corner; the other corners are reversed.
void appendReversed(std::vector<unsigned>& corners, const ScenePart& part, unsigned base) {
    std::size_t first = 0;
    for (std::size_t face = 0; first < part.corners.size(); ++face) {
        const std::size_t size = part.sizes.empty() ? 3 : part.sizes[face];
        corners.push_back(base + part.corners[first]);
        for (std::size_t k = size - 1; k > 0; --k) corners.push_back(base + part.corners[first + k]);
        first += size;
    }
}

// A scene of triangles has no sizes. The first part with other faces adds the sizes of the existing ones.
void appendSizes(Polygons& scene, const ScenePart& part) {
    if (part.sizes.empty() && scene.sizes.empty()) return;
    if (scene.sizes.empty()) scene.sizes.assign(scene.corners.size() / 3, 3);
    if (part.sizes.empty()) scene.sizes.insert(scene.sizes.end(), part.corners.size() / 3, 3);
    scene.sizes.insert(scene.sizes.end(), part.sizes.begin(), part.sizes.end());
}

}  // namespace

void place(Polygons& scene, const ScenePart& part, const glm::dmat4& transform) {
    if (part.points.size() > std::numeric_limits<unsigned>::max() - scene.points.size())
        throw std::runtime_error("the scene has more than 4294967295 vertices");
    const auto base = unsigned(scene.points.size());
    for (const glm::dvec3& p : part.points) scene.points.push_back(glm::dvec3(transform * glm::dvec4(p, 1)));
    appendSizes(scene, part);
    if (glm::determinant(glm::dmat3(transform)) < 0)
        appendReversed(scene.corners, part, base);
    else
        for (const unsigned corner : part.corners) scene.corners.push_back(base + corner);
}

}  // namespace bilayer::detail
