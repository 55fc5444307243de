// Which public meshes an exact field is promised for.
#pragma once

#include <string>
#include <vector>

namespace bilayer::test {

/// The meshes of the public corpus that are watertight and oriented after welding and have no self-intersection, as the
/// corpus's own table says; no mesh that is inside out. Empty where the corpus is absent.
std::vector<std::string> cleanMeshes();

}  // namespace bilayer::test
