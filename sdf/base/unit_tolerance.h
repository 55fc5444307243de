// SPDX-License-Identifier: Apache-2.0
// The tolerance of unit vectors and quaternions that users give or files hold.
// Tested by tests/fluid/seed.cpp through seed().
#pragma once

namespace bilayer::detail {

/// Max deviation from 1 of the length of a unit vector or of a rotation's quaternion, or of its square. Products of
/// float32 rotations are off by less.
inline constexpr float unitTolerance = 1e-3f;

}  // namespace bilayer::detail
