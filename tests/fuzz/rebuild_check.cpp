// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/checks.h"
#include "tests/fuzz/mesh_recipe.h"
#include "tests/support/same_fields.h"

namespace bilayer::test {
namespace {

constexpr unsigned maxEdits = 5, maxFrames = 3;

void edit(Mesh& mesh, ByteSource& bytes) {
    const float size = bounds(mesh).longestSide();
    for (unsigned count = bytes.below(maxEdits); count > 0; --count) {
        glm::vec3& point = mesh.points[bytes.below(unsigned(mesh.points.size()))];
        const float reach = bytes.byte() % 4 ? 0.1f : 1;
        point += reach * size * bytes.latticePoint();
    }
}

std::vector<std::uint32_t> movedTriangles(const Mesh& before, const Mesh& after, bool withOthers) {
    std::vector<std::uint32_t> moved;
    for (std::uint32_t i = 0; i < before.triangles.size(); ++i) {
        const glm::uvec3 t = before.triangles[i];
        const auto hasMoved = [&](unsigned p) { return before.points[p] != after.points[p]; };
        if (hasMoved(t.x) || hasMoved(t.y) || hasMoved(t.z) || (withOthers && i % 7 == 0)) moved.push_back(i);
    }
    return moved;
}

}  // namespace

void checkRebuild(Bytes recipe) {
    ByteSource bytes(recipe);
    Mesh before = bytes.flag() ? meshOf(bytes) : shapes::sphere(1, 2);
    const float widths[] = {1.5f, 3, 4};
    BuildOptions options{.voxelSize = bounds(before).longestSide() / float(6 + bytes.below(20)),
                         .exteriorWidthVoxels = widths[bytes.below(3)],
                         .interiorWidthVoxels = widths[bytes.below(3)],
                         .triangles = bytes.flag()};
    if (bytes.flag()) options.sign = Sign::normals;
    try {
        LevelSet field = build(before, options);
        for (unsigned frame = 1 + bytes.below(maxFrames); frame > 0; --frame) {
            Mesh after = before;
            edit(after, bytes);
            field = rebuild(field, before, after, movedTriangles(before, after, bytes.flag()), options);
            require(sameFields(field, build(after, options)), "a rebuilt field differs from one that is built in full");
            before = after;
        }
    } catch (const std::invalid_argument& error) {
        requirePlainError(error.what());
    }
}

}  // namespace bilayer::test
