// A narrow-band signed distance field as a value. OpenVDB's headers are heavy, so its grids are behind grids.h.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <string>

namespace bilayer {

struct Grids;

/// An immutable narrow-band signed distance field: cheap to copy, safe to share between threads. Distances are negative
/// inside, in world units; voxel centres lie at integer index coordinates times the voxel size.
class LevelSet {
  public:
    /// Takes over grids that are complete and no longer change. Throws std::invalid_argument if they are no level set:
    /// another grid class, a transform that is more than a uniform scale and whole voxels of shift, voxels below 1e-15
    /// or above 1e15 m, no active voxel; or if an entry of theirs is not what it can be: a width that is not positive
    /// or wider than 2^23 voxels, an error or a count below 0, a method or a way of signs that is not known.
    explicit LevelSet(std::shared_ptr<const Grids> grids);

    float voxelSize() const;             ///< [m]
    glm::dvec3 origin() const;           ///< Mesh::origin: distances are asked for relative to it [m]
    float exteriorWidth() const;         ///< every voxel with 0 <= distance < this is active [m]
    float interiorWidth() const;         ///< every voxel with -this < distance < 0 is active [m]
    std::uint64_t activeVoxels() const;  ///< count
    std::uint64_t leaves() const;        ///< count of 8x8x8 blocks
    std::uint64_t memoryBytes() const;   ///< of all grids [bytes]
    const std::string& method() const;   ///< "exact", ..., or "" for a field from elsewhere
    /// What told inside from outside: "normals", "winding", "flood", "layers" or "prisms"; "" for a field from
    /// elsewhere.
    const std::string& sign() const;
    const std::string& signReason() const;  ///< why it was taken, without a full stop: "closed and oriented"
    std::uint64_t signConflicts() const;    ///< voxels and pairs of neighbours whose normals contradict each other
    /// What distances of active voxels are off by at most [m]; infinite: there is no bound; NaN: nobody knows.
    float errorBound() const;
    std::uint64_t meshHash() const;  ///< hash() of the mesh it came from, or 0
    const Grids& grids() const { return *grids_; }

  private:
    std::shared_ptr<const Grids> grids_;
    float exteriorWidth_, interiorWidth_, errorBound_;
    std::uint64_t meshHash_, signConflicts_;
    std::string method_, sign_, signReason_;
    glm::dvec3 origin_;
};

}  // namespace bilayer
