// SPDX-License-Identifier: Apache-2.0
// The warning about fields in a process without a dispatcher for them; internal.
//
// For two concave shapes, Bullet's own tables hold an algorithm that does nothing, so neither shape is called when such
// a pair meets. A shape is called by its world only for its bounding box: once a step for each body, and once more for
// a dynamic body, for the predicted pose.
// Tested by tests/bullet/stock.cpp.
#pragma once

#include <LinearMath/btTransform.h>

namespace bilayer::bullet::detail {

/// Held by each Dispatcher and FieldAlgorithms. While one exists, boxes are not recorded.
class FieldDispatcherMark {
  public:
    FieldDispatcherMark();
    ~FieldDispatcherMark();
    FieldDispatcherMark(const FieldDispatcherMark&) = delete;
    FieldDispatcherMark& operator=(const FieldDispatcherMark&) = delete;
};

/// Records the bounding box of a field, from any thread. Warns on the standard error output, once in a process, when
/// the box of a dynamic body meets another field's while no FieldDispatcherMark exists.
/// @param transform  its address identifies the body
void noteBox(const void* field, const btTransform& transform, const btVector3& lower, const btVector3& upper);

/// Forgets a field's boxes; to be called before the field is destroyed.
void forgetBoxes(const void* field);

}  // namespace bilayer::bullet::detail
