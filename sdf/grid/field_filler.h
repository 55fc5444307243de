// SPDX-License-Identifier: Apache-2.0
// The state of one build. It fills a field by one method of distances and one of signs, again if needed, and makes a
// LevelSet of the last one.
// Tested by tests/sdf/build.cpp through build().
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/options.h>
#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/base/stopwatch.h"
#include "sdf/grid/assemble.h"
#include "sdf/grid/field_metadata.h"
#include "sdf/grid/field_part.h"
#include "sdf/grid/filled_field.h"
#include "sdf/leaf/blocks.h"
#include "sdf/leaf/build_size.h"

namespace bilayer::detail {

/// Fills the field of a mesh.
class FieldFiller {
  public:
    /// @param options  valid
    /// @param device   fills the blocks; null: the CPU
    /// @param part     the part of the field that is filled, whose triangles are those of `mesh`; null: all of it
    /// Throws as validate() and checkSize() do. The arguments must outlive the filler.
    FieldFiller(const Mesh& mesh, const BuildOptions& options, const DeviceFiller* device,
                const FieldPart* part = nullptr);

    /// Fills by a method that finds signs itself.
    void fillWithOwnSigns();

    /// Fills by a sign method, or the union of the solids if the options ask for it. Returns the sign method that was
    /// used.
    Sign fill(const Mesh& mesh, Sign sign, const std::string& reason, Method method);

    /// May change a job, and add known leaves.
    using Adapt = std::function<void(MeshJob&, Assembler&)>;

    /// Fills distances to `mesh`, with winding numbers of `solids`.
    void fillFrom(const Mesh& mesh, const Mesh& solids, Sign sign, const std::string& reason, Method method,
                  const Adapt& adapt = {});

    /// Fills by the requested method, with the signs of the last field.
    void fillWithSidesOfLast(const Mesh& mesh, const std::string& reason);

    /// Replaces the signs of the last field, filled by normals and by the requested method, with those of winding
    /// numbers. Returns false and does nothing if another fill would find distances that the last one left out, or if a
    /// device keeps the field.
    bool signAgainByWinding(const Mesh& mesh, const std::string& reason);

    /// Returns the last field as a level set.
    LevelSet levelSet();

    /// Returns the grids of the last field, which may be empty, with their metadata.
    std::shared_ptr<Grids> grids();

    /// Returns the grids of the last field of a part, with what its neighbours need.
    FilledPart part();

    const Mesh& mesh() const { return mesh_; }
    const BuildOptions& options() const { return options_; }
    const Bounds& box() const { return extent_.box; }
    /// The signs of the last field.
    const FieldSigns& signs() const { return field_.signs; }
    BuildTimes& times() { return times_; }
    Progress& progress() { return progress_; }

  private:
    struct Counts {
        std::atomic<std::size_t> undecided = 0, conflicts = 0;
    };

    bool fillUnion(const Mesh& mesh);
    MeshJob jobFor(const Mesh& mesh, float reach, bool sign, Assembler& assembler, Counts& counts);
    void take(Assembler& assembler, const FilledBlocks& blocks);  // thread-safe

    const Mesh& mesh_;
    const BuildOptions& options_;
    const DeviceFiller* device_;
    const FieldPart* part_;
    BuildTimes times_;
    Stopwatch total_;
    Progress progress_;
    MeshExtent extent_;
    FilledField field_;  // the last one
    std::atomic<std::size_t> filledBlocks_ = 0;
};

}  // namespace bilayer::detail
