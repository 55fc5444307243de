// The warning of fields that no dispatcher knows; internal.
//
// For two concave shapes Bullet's own tables hold an algorithm that does nothing, so that neither shape is called when
// such a pair meets. All that a shape hears of its world is that its box is asked for: once a step for each body, and
// once more for a dynamic body, where it is going to be.
#pragma once

#include <LinearMath/btTransform.h>

namespace bilayer::bullet::detail {

/// Each Dispatcher and FieldAlgorithms holds one. While there is any, nothing is watched.
class KnowsFields {
  public:
    KnowsFields();
    ~KnowsFields();
    KnowsFields(const KnowsFields&) = delete;
    KnowsFields& operator=(const KnowsFields&) = delete;
};

/// Takes down that a field was asked for its box, from any thread. Warns on the standard error output, once in a
/// process, when the box of a dynamic body meets another field's while nothing in the process knows fields.
/// @param transform  bodies are told apart by where their transforms are stored
void noteBox(const void* field, const btTransform& transform, const btVector3& lower, const btVector3& upper);

/// Before the field ends.
void forgetBoxes(const void* field);

}  // namespace bilayer::bullet::detail
