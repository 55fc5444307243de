// SPDX-License-Identifier: Apache-2.0
// Public meshes for which the exact method guarantees an exact field.
#pragma once

#include <string>
#include <vector>

namespace bilayer::test {

/// The meshes of the public corpus that, by the corpus's own table, are watertight and oriented after welding and do
/// not self-intersect. Inside-out meshes are excluded. Empty if the corpus is absent.
std::vector<std::string> cleanMeshes();

}  // namespace bilayer::test
