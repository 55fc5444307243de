// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/surface.h>

#include <fmt/format.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <stdexcept>

#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"

namespace bilayer {

Mesh surface(const LevelSet& levelSet, const SurfaceOptions& options) {
    if (!(options.isovalue < levelSet.exteriorWidth() && options.isovalue > -levelSet.interiorWidth()))
        throw std::invalid_argument(fmt::format("isovalue {:g} lies outside the band, {:g} to {:g}", options.isovalue,
                                                -levelSet.interiorWidth(), levelSet.exteriorWidth()));
    if (!(options.adaptivity >= 0 && options.adaptivity <= 1))
        throw std::invalid_argument(fmt::format("adaptivity must be in 0..1, not {:g}", options.adaptivity));
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*levelSet.grids().distance, points, triangles, quads, double(options.isovalue),
                                 double(options.adaptivity));
    Mesh mesh;
    mesh.origin = levelSet.origin();
    mesh.points.reserve(points.size());
    for (const auto& p : points) mesh.points.push_back({p.x(), p.y(), p.z()});
    // OpenVDB's faces are clockwise when seen from outside.
    mesh.triangles.reserve(triangles.size() + 2 * quads.size());
    for (const auto& t : triangles) mesh.triangles.push_back({t[0], t[2], t[1]});
    for (const auto& q : quads) {
        mesh.triangles.push_back({q[0], q[2], q[1]});
        mesh.triangles.push_back({q[0], q[3], q[2]});
    }
    return mesh;
}

}  // namespace bilayer
