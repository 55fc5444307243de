// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/boundary_loops.h"

#include "sdf/mesh/topology.h"

namespace bilayer::detail {

BoundaryLoops::BoundaryLoops(const Mesh& mesh, Progress* progress) : ends_(mesh.points.size()) {
    Topology(mesh, progress).forEachUnbalancedEdge([&](unsigned from, unsigned to, unsigned count) {
        ends_[to].insert(ends_[to].end(), count, from);
    });
}

BoundaryLoops::Loop BoundaryLoops::vertices() const {
    Loop vertices;
    for (unsigned v = 0; v < ends_.size(); ++v)
        if (!ends_[v].empty()) vertices.push_back(v);
    return vertices;
}

}  // namespace bilayer::detail
