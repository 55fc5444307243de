// SPDX-License-Identifier: Apache-2.0
// The data of a Field, and its access by queries.
// Tested by tests/collider/field.cpp.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <span>

#include <bilayer/collider/query.h>
#include "collider/field/layout/field_layout.h"
#include "collider/field/triangles/mesh_tree.h"
#include "sdf/base/finite.h"
#include "sdf/bvh/winding_number.h"

namespace bilayer::detail {

/// A length as a float; never infinite, as points and directions are not.
inline float toFloat(double length) {
    return float(std::min(length, double(std::numeric_limits<float>::max())));
}

// The compiler's own vector types: Highway has no fixed-size vectors for the baseline instruction set.
using Doubles [[gnu::vector_size(16)]] = double;
using Ints [[gnu::vector_size(16)]] = std::int32_t;

struct FieldData;

/// A point in a tile of a field.
struct TilePoint {
    glm::vec3 point;   ///< in field coordinates [m]
    glm::dvec3 local;  ///< from the tile's first voxel, rounded as in the whole field [voxels]
};

/// Sampling functions for one instruction set and one storage. The gradient is computed where the distance is at most
/// `gradientReach` [m].
struct SampleKernels {
    Sample (*sampleAt)(const FieldData&, const glm::dvec3& local, float gradientReach) noexcept;
    Sample (*samplePoint)(const FieldData&, const glm::vec3& point) noexcept;
    Sample (*sampleWithin)(const FieldData&, const glm::vec3& point, float gradientReach) noexcept;
    Sample (*sampleInTile)(const FieldData&, const TilePoint& point) noexcept;
    Floats (*sampleInBand)(const FieldData&, LastBlock&, const glm::vec3& point) noexcept;  ///< of FieldSampler
    void (*sampleMany)(const FieldData&, std::span<const glm::vec3> points, Sample*) noexcept;
};

/// The fastest kernels for this processor.
const SampleKernels& sampleKernels(Storage storage);

struct FieldData : FieldLayout {
    FieldData(const LevelSet& levelSet, Storage storage);
    /// Of a tile of a field, for samples alone.
    explicit FieldData(FieldLayout layout);
    /// Shares the samples.
    FieldData(const FieldData& samples, std::shared_ptr<const Mesh> outward);
    FieldData(const FieldData&) = delete;
    FieldData& operator=(const FieldData&) = delete;

    glm::dvec3 worldOrigin{0};  ///< LevelSet::origin() [m]
    const SampleKernels& kernels;
    const Clearance coarse;
    std::unique_ptr<const MeshTree> mesh;  ///< null: the field has no mesh
    BlockEntries entries;                  ///< for closest-point searches in the band
    bool signedByNormals;                  ///< the signs come from the mesh's normals
    bool signedByWinding;  ///< the mesh is closed, and the signs are those of its winding numbers or normals
    std::unique_ptr<const WindingNumber> winding;  ///< gave an open mesh its signs; null for others
    float sampleError;  ///< max error of distances in the band relative to the mesh [m]; infinite: unknown
    float error = 0;    ///< the same relative to the geometry that queries use: the mesh if there is one [m]

    /// Fraction bits of a fixed-point place. The remaining bits of the 32-bit word hold the voxel within its block.
    static constexpr int fractionBits = 29;
    static_assert(side == 1 << (32 - fractionBits));
    /// Magic number: adding it to a place leaves the fixed-point number in the low bits of the double [voxels].
    static constexpr double fixedPoint = 1.5 * (std::uint64_t(1) << (52 - fractionBits));
    static_assert(fixedPoint / 3 == double(side) * maxBlocksAlong);

    /// The frame in the form that samples need, mostly in vectors.
    struct Lanes {
        Doubles perMetre;
        Doubles offsetXy, offsetYz;  ///< of a place, with the fixed-point constant [voxels]
        Ints fraction;               ///< mask of a place's fraction bits
        Floats fractionUnit;         ///< value of the lowest fraction bit [voxels]
        Floats scales;               ///< factors of a distance and its gradient, from stored values and voxels [m]
        std::uint32_t xBlocks;       ///< count of directory entries between neighbouring blocks along x
    } lanes;

    /// Computes the gradient where the distance is at most `gradientReach` [m].
    Sample sample(const glm::dvec3& local, float gradientReach) const noexcept {
        return kernels.sampleAt(*this, local, gradientReach);
    }

    /// The same without a gradient.
    Sample sample(const glm::dvec3& local) const noexcept {
        return sample(local, -std::numeric_limits<float>::infinity());
    }

    /// A lower bound of the distance to the surface; not positive where it is unknown [voxels].
    float clearanceAt(const glm::dvec3& local) const {
        return float(Clearance::cellSide) * coarse.around(local / double(Clearance::cellSide));
    }

    float boundOf(float maxDistance) const;
    std::uint32_t orBeyond(std::uint32_t piece, const EntryPlace& place, const glm::vec3& point,
                           float maxDistance) const;
    ClosestPoint closestOn(std::uint32_t piece, const glm::vec3& point, float maxDistance) const;

    /// The closest point of the mesh, or of the zero set if there is no mesh.
    ClosestPoint closest(const glm::vec3& point, float maxDistance) const;

    bool inside(const glm::vec3& point) const;

    /// The value of a voxel of a stored block, apron included [m].
    float valueAt(std::size_t index) const {
        if (storage == Storage::fixed16)
            return std::clamp(float(values16.data()[index]) * step, -interiorWidth, exteriorWidth);
        const float value = values.data()[index];
        if (!std::isnan(value)) return value;
        return std::signbit(value) ? -interiorWidth : exteriorWidth;
    }

  private:
    void fillLanes();
};

}  // namespace bilayer::detail
