// SPDX-License-Identifier: Apache-2.0
// What a collider holds.
#include <bilayer/collider/collider.h>

#include <stdexcept>

#include "collider/contact/body/collider_data.h"

namespace bilayer {

const Mesh& Collider::mesh() const {
    return data_->mesh();
}
const Field& Collider::field() const {
    return data_->field;
}
const Field& Collider::exactField() const {
    return data_->exactField();
}
const Bounds& Collider::bounds() const {
    return data_->body.bounds;
}
float Collider::margin() const {
    return data_->body.margin;
}
std::uint64_t Collider::id() const {
    return data_->id;
}

const MassProperties& Collider::mass() const {
    if (!data_->body.mass)
        throw std::invalid_argument("the body encloses no volume, or its inertia is beyond single precision");
    return *data_->body.mass;
}

}  // namespace bilayer
