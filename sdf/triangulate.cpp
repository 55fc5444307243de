#include "sdf/triangulate.h"
namespace bilayer { bool triangulate(std::span<const glm::dvec3> o, std::vector<glm::uvec3>& t) { for (unsigned i = 2; i < o.size(); ++i) t.push_back({0, i - 1, i}); return true; } }
