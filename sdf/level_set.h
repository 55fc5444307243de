// SPDX-License-Identifier: Apache-2.0
// A narrow-band signed distance field. grids.h gives access to its OpenVDB grids, whose headers are slow to compile.
// Tested by tests/sdf/build.cpp.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <string>

namespace bilayer {

struct Grids;

/// What work on a device took: times by the events of its queues, and memory. Times are 0 unless they were asked for
/// (OpenclOptions::profile).
struct DeviceTimes {
    double kernels = 0;           ///< overlapping kernels count once [s]
    double upload = 0;            ///< to the device; 0 if it shares the host's memory [s]
    double download = 0;          ///< from the device [s]
    std::uint64_t peakBytes = 0;  ///< peak device memory [bytes]

    /// Adds the times of other work. The peak is the larger one.
    DeviceTimes& operator+=(const DeviceTimes& other) {
        kernels += other.kernels;
        upload += other.upload;
        download += other.download;
        peakBytes = std::max(peakBytes, other.peakBytes);
        return *this;
    }
};

/// Times of the phases of a build [s], and the count of blocks that it filled.
struct BuildTimes {
    double prepare = 0;   ///< choosing the sign method, uniting solids, finding what an update must fill
    double fill = 0;      ///< binning triangles into blocks, computing distances
    double assemble = 0;  ///< building the tree, signs far from the surface, signs by winding number or flood
    double total = 0;     ///< of the whole build
    /// Blocks of 8x8x8 voxels whose distances were computed. A block counts again for each sign method that is tried.
    /// rebuild() copies all other blocks.
    std::size_t filledBlocks = 0;
    DeviceTimes device{};  ///< of a build by a device
};

/// An immutable narrow-band signed distance field, cheap to copy and safe to share between threads. Distances are
/// negative inside, in world units. Voxel centres lie at integer index coordinates times the voxel size.
class LevelSet {
  public:
    /// Takes ownership of complete grids, which must not change afterwards. Throws std::invalid_argument if the grids
    /// are not a valid level set:
    /// - another grid class, or no active voxel;
    /// - a transform other than a uniform scale and a shift by whole voxels;
    /// - voxels below 2e-5 m or above 1e15 m;
    /// - a width that is not positive or exceeds 2^23 voxels;
    /// - an error bound that is negative, no number, or below that of its method; a negative count;
    /// - an unknown method or sign method, or signs that the method does not have.
    explicit LevelSet(std::shared_ptr<const Grids> grids);

    float voxelSize() const;             ///< [m]
    glm::dvec3 origin() const;           ///< Mesh::origin; queries use coordinates relative to it [m]
    float exteriorWidth() const;         ///< voxels with 0 <= distance < this are active [m]
    float interiorWidth() const;         ///< voxels with -this < distance < 0 are active [m]
    std::uint64_t activeVoxels() const;  ///< count
    std::uint64_t leaves() const;        ///< count of 8x8x8 leaves
    std::uint64_t memoryBytes() const;   ///< of all grids [bytes]
    const std::string& method() const;   ///< "exact", ..., or "" for a field from another program
    /// The sign method: "normals", "winding", "flood", "layers" or "prisms"; "" for a field from another program.
    const std::string& sign() const;
    const std::string& signReason() const;  ///< why it was selected, without a full stop: "closed and oriented"
    std::uint64_t signConflicts() const;    ///< count of voxels and neighbour pairs whose normals disagree
    /// Count of voxels whose nearest normals cancel out; by layers: of voxels off the surface that are equally near to
    /// both layers, counted by the processor only.
    std::uint64_t signUndecided() const;
    /// Maximum error of the distances at active voxels [m]; infinity: not bounded; NaN: unknown.
    float errorBound() const;
    /// Times of the build that made the field; zeros for a field from a file.
    const BuildTimes& buildTimes() const;
    std::uint64_t meshHash() const;  ///< hash() of the source mesh, or 0
    /// Its OpenVDB grids: include sdf/grids.h to use them.
    const Grids& grids() const { return *grids_; }

  private:
    std::shared_ptr<const Grids> grids_;
    float exteriorWidth_, interiorWidth_, errorBound_;
    std::uint64_t meshHash_, signConflicts_, signUndecided_;
    std::string method_, sign_, signReason_;
    glm::dvec3 origin_;
};

}  // namespace bilayer
