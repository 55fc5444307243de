// SPDX-License-Identifier: Apache-2.0
// The data behind public types: the libraries see it, their users do not.
// Tested by tests/collider/collider.cpp.
#pragma once

#include <utility>

namespace bilayer::detail {

/// A friend of all public types with private data.
struct Access {
    template <class Object>
    static auto& dataOf(const Object& object) noexcept {
        return *object.data_;
    }
    template <class Object, class Data>
    static Object make(Data&& data) {
        return Object(std::forward<Data>(data));
    }
};

/// Returns the data of an object. Valid as long as the object or a copy of it lives.
template <class Object>
auto& dataOf(const Object& object) noexcept {
    return Access::dataOf(object);
}

/// Makes an object of its data.
template <class Object, class Data>
Object makeOf(Data&& data) {
    return Access::make<Object>(std::forward<Data>(data));
}

}  // namespace bilayer::detail
