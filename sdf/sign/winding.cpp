// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/winding.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>
#include <optional>
#include <span>

#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"
#include "sdf/leaf/build_size.h"
#include "sdf/sign/octree_cells.h"
#include "sdf/sign/winding_cells.h"
#include "sdf/sign/winding_leaves.h"

namespace bilayer::detail {
namespace {

// Returns the region where an open mesh's winding number can exceed one half.
// At a distance R the number is at most area / (4 pi R^2).
openvdb::CoordBBox spaceOf(const std::vector<BandLeaf*>& leaves, const WindingQuery& query) {
    openvdb::CoordBBox box;
    for (const BandLeaf* leaf : leaves) box.expand(leaf->getNodeBoundingBox());
    if (!query.slope) return box;
    const double reach = std::sqrt(query.winding.area() / (2 * glm::pi<double>())) / query.voxelSize;
    const auto margin = std::int32_t(std::min(std::ceil(reach), maxIndexCoordinate));
    for (int axis = 0; axis < 3; ++axis) {
        box.min()[axis] = std::int32_t(std::max(double(box.min()[axis]) - margin, -maxIndexCoordinate));
        box.max()[axis] = std::int32_t(std::min(double(box.max()[axis]) + margin, maxIndexCoordinate));
    }
    return box;
}

}  // namespace

void signByWinding(openvdb::FloatGrid& grid, const Mesh& mesh, const BandWidths& widths, bool closed,
                   Progress* progress) {
    const WindingNumber winding(mesh, progress);
    std::optional<WindingSlope> slope;
    if (!closed) slope.emplace(mesh, progress);
    const WindingQuery query{winding, slope ? &*slope : nullptr, double(widths.voxelSize), progress};
    const std::vector<BandLeaf*> leaves = leavesOf(grid);
    tbb::enumerable_thread_specific<std::vector<openvdb::CoordBBox>> found;
    if (!leaves.empty()) {
        const OctreeCells cells(leaves, spaceOf(leaves, query), progress);
        const std::span bricks = cells.bricks();
        tbb::parallel_for(std::size_t(0), bricks.size() - 1, [&](std::size_t b) {
            poll(progress);
            const WindingBrick brick(cells.all().subspan(bricks[b], bricks[b + 1] - bricks[b]));
            signEmptyCells(query, brick, found.local());
        });
    }
    signLeaves(leaves, mesh, query, widths);
    std::vector<openvdb::CoordBBox> inside;
    for (const auto& boxes : found) inside.insert(inside.end(), boxes.begin(), boxes.end());
    assemble(grid, inside, widths, progress);
}

}  // namespace bilayer::detail
