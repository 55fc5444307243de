// SPDX-License-Identifier: Apache-2.0
// The error that exact distances promise.
// Tested by tests/sdf/exact.cpp through build().
#pragma once

namespace bilayer::detail {

/// Guaranteed error of Method::exact and Method::pseudonormal [voxels]; ten times the largest observed error.
inline constexpr float exactError = 1e-4f;

}  // namespace bilayer::detail
