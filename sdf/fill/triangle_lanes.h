// SPDX-License-Identifier: Apache-2.0
// A batch of triangles, one per SIMD lane. Highway includes this file once for each instruction set: only between
// HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/sdf/double_layer.cpp.
#if defined(BILAYER_SDF_TRIANGLE_LANES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_TRIANGLE_LANES_H
#undef BILAYER_SDF_TRIANGLE_LANES_H
#else
#define BILAYER_SDF_TRIANGLE_LANES_H
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/vector_lanes.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

/// One row per component, one column per triangle.
struct TriangleLanes {
    static constexpr std::size_t most = 8;
    /// As many triangles as there are double lanes.
    using Wide = hn::CappedTag<double, most>;
    /// The same count of floats.
    using Small = hn::Rebind<float, Wide>;

    alignas(64) float world[3][3][most];  ///< corners, then axes [m]
    alignas(64) std::int32_t triangles[most];
    alignas(64) double corners[3][3][most];  ///< the same [voxels]
    alignas(64) double normal[3][most], length[most], longest2[most];

    /// Loads the corners of some triangles. Prefetches the next ones, since they are scattered in memory.
    void load(const Mesh& mesh, std::span<const std::uint32_t> indices, std::size_t first, std::size_t count) {
        // Prefetch distances match the memory latency: first the indices, then the corners.
        constexpr std::size_t indicesAhead = 32, cornersAhead = 16;
        for (std::size_t lane = 0; lane < count; ++lane) {
            const std::size_t i = first + lane;
            if (i + indicesAhead < indices.size()) __builtin_prefetch(&mesh.triangles[indices[i + indicesAhead]]);
            if (i + cornersAhead < indices.size())
                for (int k = 0; k < 3; ++k)
                    __builtin_prefetch(&mesh.points[mesh.triangles[indices[i + cornersAhead]][k]]);
            const glm::uvec3& t = mesh.triangles[indices[i]];
            for (int k = 0; k < 3; ++k)
                for (int axis = 0; axis < 3; ++axis) world[k][axis][lane] = mesh.points[t[k]][axis];
            triangles[lane] = std::int32_t(indices[i]);
        }
    }

    /// Returns a corner of each triangle [voxels], and stores it for at().
    VectorLanes<Wide> corner(std::size_t k, double voxelsPerUnit) {
        const Wide wide;
        const auto at = [&](std::size_t axis) {
            const auto metres = hn::PromoteTo(wide, hn::Load(Small(), world[k][axis]));
            return hn::Mul(metres, hn::Set(wide, voxelsPerUnit));
        };
        const VectorLanes<Wide> points{at(0), at(1), at(2)};
        store(points, corners[k]);
        return points;
    }

    static void store(const VectorLanes<Wide>& points, double (&rows)[3][most]) {
        hn::Store(points.x, Wide(), rows[0]);
        hn::Store(points.y, Wide(), rows[1]);
        hn::Store(points.z, Wide(), rows[2]);
    }

    /// Returns one triangle's column.
    static glm::dvec3 at(const double (&rows)[3][most], std::size_t lane) {
        return glm::dvec3(rows[0][lane], rows[1][lane], rows[2][lane]);
    }
};

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
