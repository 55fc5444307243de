// SPDX-License-Identifier: Apache-2.0
// Fills a field by a sign method, and by another one or from a repaired mesh if the signs contradict each other.
// Tested by tests/sdf/sign_choice.cpp.
#pragma once

namespace bilayer::detail {

class FieldFiller;

/// Fills by the sign method that Sign::automatic selects. Selects another one if the first gives contradictions.
void fillWithAutomaticSign(FieldFiller& filler);

/// Fills by the sign method of the options. If that is `normals` and the mesh is inside out, fills again with the
/// normals of a repaired mesh.
void fillWithRequestedSign(FieldFiller& filler);

}  // namespace bilayer::detail
