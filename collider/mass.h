// Mass properties of the solid that a closed mesh bounds.
#pragma once

#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include "sdf/mesh.h"

namespace bilayer {

/// Of a solid of density 1; multiply mass and inertia by the density.
struct MassProperties {
    double volume = 0;                    ///< [m^3]
    glm::vec3 centre{0};                  ///< centre of mass [m]
    glm::mat3 inertia{0};                 ///< about the centre of mass, mesh axes [m^5]
    glm::vec3 principalInertia{0};        ///< eigenvalues of `inertia`, ascending [m^5]
    glm::quat principalAxes{1, 0, 0, 0};  ///< takes principal axes to mesh axes
};

/// Exact integrals over the tetrahedra that the triangles span with the centre of the bounds, in double precision
/// (D. Eberly, "Polyhedral Mass Properties (Revisited)", 2002). The mesh should be closed; an inside-out one gives the
/// same as its reverse. Throws std::invalid_argument if the volume is zero, as for an open sheet.
MassProperties massProperties(const Mesh& mesh);

}  // namespace bilayer
