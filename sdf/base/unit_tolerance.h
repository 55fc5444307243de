// SPDX-License-Identifier: Apache-2.0
// The tolerance of unit quaternions that users give.
// Tested by tests/fluid/seed.cpp through seed().
#pragma once

namespace bilayer::detail {

/// Max deviation of the length of a rotation's quaternion from 1, or of its square. Products of float32 rotations are
/// off by less.
inline constexpr float unitTolerance = 1e-3f;

}  // namespace bilayer::detail
