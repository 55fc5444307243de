// What a mesh file holds: polygons, before they are cut into triangles and their vertices welded; internal.
#pragma once

#include <glm/vec3.hpp>
#include <string>
#include <vector>

namespace bilayer {

struct Polygons {
    std::vector<glm::dvec3> points;  ///< vertex positions, as the file has them or under its node transforms
    std::vector<unsigned> corners;   ///< indices into `points`, of one face after the other
    std::vector<unsigned> sizes;     ///< corners of each face, in the same order; empty: each has three
    std::vector<std::string> notes;  ///< what of the file was left out and why, a sentence each
};

}  // namespace bilayer
