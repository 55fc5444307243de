// SPDX-License-Identifier: Apache-2.0
#include "bench/paper/errors.h"

#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"

namespace bilayer::paper {

bool finite(float phi) {
    return std::abs(phi) < farAway;
}

Errors errors(const DenseField& field, const DenseField& truth, float within) {
    Errors result;
    const float step = field.lattice.step;
    for (std::size_t i = 0; i < field.phi.size(); ++i)
        if (finite(field.phi[i]) && finite(truth.phi[i]) && std::abs(truth.phi[i]) <= within * step)
            result.add(field.phi[i] / step, truth.phi[i] / step);
    return result;
}

Errors errors(const LevelSet& field, const DenseField& truth) {
    Errors result;
    const float step = truth.lattice.step;
    for (auto voxel = field.grids().distance->cbeginValueOn(); voxel; ++voxel) {
        const openvdb::Coord at = voxel.getCoord();
        const float expected = truth.phi[truth.lattice.index(at.x(), at.y(), at.z())];
        if (finite(expected)) result.add(*voxel / step, expected / step);
    }
    return result;
}

}  // namespace bilayer::paper
