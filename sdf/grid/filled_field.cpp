// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/filled_field.h"

#include <bilayer/sdf/grids.h>

namespace bilayer::detail {

void FilledField::join(Assembler& assembler, float voxelSize) {
    distance = assembler.distances();
    distance->setTransform(openvdb::math::Transform::createLinearTransform(voxelSize));
    triangle = assembler.triangles();
}

void FilledField::trim(const FieldPart& own) {
    part.faces = faceSides(distance->tree(), own);
    part.border = borderOf(distance->tree(), own);
    trimToPart(distance->tree(), own);
    if (triangle) renumber(triangle->tree(), own);
}

std::shared_ptr<Grids> FilledField::finish(const Mesh& mesh, std::uint64_t meshHash, const BuildOptions& options) {
    describe(*distance, mesh.origin, meshHash, options, signs);
    auto grids = std::make_shared<Grids>();
    grids->distance = distance;
    if (triangle) {
        keepActive(triangle->tree(), distance->tree());
        triangle->setTransform(distance->transformPtr());
        grids->triangle = triangle;
    }
    return grids;
}

}  // namespace bilayer::detail
