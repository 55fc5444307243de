// What a Field holds, and how its queries read it.
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
#include "collider/field/field_layout.h"
#include "collider/field/mesh_tree.h"

namespace bilayer::detail {

inline bool isFinite(const glm::vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// A length as a float; never infinite, as points and directions are not.
inline float toFloat(double length) {
    return float(std::min(length, double(std::numeric_limits<float>::max())));
}

// Vectors of the compiler's own: Highway has none of fixed size for the plain instruction set.
using Doubles [[gnu::vector_size(16)]] = double;
using Floats [[gnu::vector_size(16)]] = float;
using Ints [[gnu::vector_size(16)]] = std::int32_t;

struct FieldData;

/// How samples are taken: for one instruction set and one storage. `gradientReach`: the gradient is found where the
/// distance is no more than that [m].
struct SampleKernels {
    Sample (*sampleAt)(const FieldData&, const glm::dvec3& local, float gradientReach) noexcept;
    Sample (*samplePoint)(const FieldData&, const glm::vec3& point) noexcept;
    Sample (*sampleWithin)(const FieldData&, const glm::vec3& point, float gradientReach) noexcept;
    void (*sampleMany)(const FieldData&, std::span<const glm::vec3> points, Sample*) noexcept;
};

/// The best for this processor.
const SampleKernels& sampleKernels(Storage storage);

struct FieldData : FieldLayout {
    /// Also the Lipschitz bound of the trilinear interpolant [voxels].
    static constexpr float cellDiagonal = 1.7320508f;

    FieldData(const LevelSet& levelSet, Storage storage);
    /// Shares the samples.
    FieldData(const FieldData& samples, std::shared_ptr<const Mesh> outward);
    FieldData(const FieldData&) = delete;
    FieldData& operator=(const FieldData&) = delete;

    const SampleKernels& kernels;
    const Clearance coarse;
    std::unique_ptr<const MeshTree> mesh;  ///< null: the field has none
    BlockEntries entries;                  ///< of searches for points in the band
    bool signedByNormals;                  ///< of the mesh
    float sampleError;                     ///< of distances in the band from the mesh's [m]; infinite: not known
    float error = 0;                       ///< the same from what queries ask for: the mesh's where there is one [m]

    /// Bits of a place below the voxel, which leave those of the voxel in its block in the same word.
    static constexpr int fractionBits = 29;
    static_assert(side == 1 << (32 - fractionBits));
    /// Added to a place, it leaves the fixed-point number in a double's lower bits [voxels].
    static constexpr double fixedPoint = 1.5 * (std::uint64_t(1) << (52 - fractionBits));
    static_assert(fixedPoint / 3 == double(side) * maxBlocksAlong);

    /// The frame as samples need it, much of it in vectors.
    struct Lanes {
        Doubles perMetre;
        Doubles offsetXy, offsetYz;  ///< of a place, with the fixed point [voxels]
        Ints fraction;               ///< the bits of a place below the voxel
        Floats fractionUnit;         ///< the lowest of them [voxels]
        Floats scales;               ///< of a distance and its gradient, from stored values and voxels [m]
        std::uint32_t xBlocks;       ///< entries of the directory from one block to the next along x
    } lanes;

    // Local places are in voxels from the directory's first one, in double: exact enough however far the mesh is from
    // the origin.
    glm::dvec3 toLocal(const glm::vec3& point) const { return (glm::dvec3(point) - origin) * perMetre; }
    glm::vec3 toWorld(const glm::dvec3& local) const { return glm::vec3(local * voxel + origin); }
    glm::dvec3 extent() const { return double(side) * glm::dvec3(blocks); }

    /// With the gradient where the distance is no more than `gradientReach` [m].
    Sample sample(const glm::dvec3& local, float gradientReach) const noexcept {
        return kernels.sampleAt(*this, local, gradientReach);
    }

    /// The same without a gradient.
    Sample sample(const glm::dvec3& local) const noexcept {
        return sample(local, -std::numeric_limits<float>::infinity());
    }

    /// The distance from the surface, at least; not positive where nothing is known [voxels].
    float clearanceAt(const glm::dvec3& local) const {
        return float(Clearance::partSide) * coarse.around(local / double(Clearance::partSide));
    }

    /// What the field knows of the side that a point lies on.
    struct Side {
        bool inside, certain;
    };
    std::ptrdiff_t nearestVoxel(const glm::dvec3& local) const;
    void fetchSide(const glm::dvec3& local) const;
    Side sideAt(const glm::dvec3& local) const;
    bool divides(const glm::dvec3& place, const glm::dvec3& normal) const;
    bool isInside(const NearestFeature& nearest, const glm::vec3& point) const;
    float boundOf(float maxDistance) const;
    std::uint32_t orBeyond(std::uint32_t part, const EntryPlace& place, const glm::vec3& point,
                           float maxDistance) const;
    ClosestPoint closestOn(std::uint32_t part, const glm::vec3& point, float maxDistance) const;

    /// The closest point of the mesh, or of the zero set where there is none.
    ClosestPoint closest(const glm::vec3& point, float maxDistance) const;
    glm::dvec3 whereZerosTell(const glm::dvec3& local) const;
    ClosestPoint closestZero(const glm::vec3& point, float maxDistance) const;

    bool inside(const glm::vec3& point) const;

    /// A voxel of a stored block, apron included [m].
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
