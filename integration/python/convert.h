// SPDX-License-Identifier: Apache-2.0
// Arguments of Python as values of C++. A wrong type is a ValueError that names the argument.
#pragma once

#include <pybind11/pybind11.h>

#include <concepts>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>

#include "integration/python/arguments.h"

namespace bilayer::python {

namespace py = pybind11;

/// "None", "a 'str'".
std::string typeText(const py::handle& object);

/// Throws std::invalid_argument: "NAME: expected EXPECTED, got a 'str'".
[[noreturn]] void refuseType(const char* name, const std::string& expected, const py::handle& got);

/// A finite or infinite real number; with `single` in the range of float32. Each throws std::invalid_argument.
double numberOf(const py::handle& object, const char* name, bool single);
bool flagOf(const py::handle& object, const char* name);
std::string textOf(const py::handle& object, const char* name);
/// An integer from `min` to `max`, as its 64 bits.
std::uint64_t integerOf(const py::handle& object, const char* name, std::int64_t min, std::uint64_t max);

/// "a LevelSet".
std::string withArticle(const std::string& noun);

template <class Value>
struct IsOptional : std::false_type {};
template <class Value>
struct IsOptional<std::optional<Value>> : std::true_type {};

/// An argument as a C++ function takes it: a reference for an object of the module, a value otherwise. None becomes
/// an empty optional or a null pointer. Throws std::invalid_argument that names the argument for another type.
template <class Parameter>
decltype(auto) argument(const py::object& object, const char* name) {
    using Value = std::remove_cvref_t<Parameter>;
    if constexpr (std::is_same_v<Value, py::object>) {
        return static_cast<const py::object&>(object);
    } else if constexpr (std::is_same_v<Value, bool>) {
        return flagOf(object, name);
    } else if constexpr (std::integral<Value>) {
        using Limits = std::numeric_limits<Value>;
        return static_cast<Value>(integerOf(object, name, std::int64_t(Limits::min()), std::uint64_t(Limits::max())));
    } else if constexpr (std::floating_point<Value>) {
        return static_cast<Value>(numberOf(object, name, std::is_same_v<Value, float>));
    } else if constexpr (std::is_same_v<Value, std::string>) {
        return textOf(object, name);
    } else if constexpr (std::is_same_v<Value, Path>) {
        return pathOf(object, name);
    } else if constexpr (std::is_same_v<Value, SharedMesh>) {
        return meshOf(object, name);
    } else if constexpr (IsOptional<Value>::value) {
        return object.is_none() ? Value() : Value(argument<typename Value::value_type>(object, name));
    } else if constexpr (std::is_pointer_v<Value>) {
        using Pointee = std::remove_pointer_t<Value>;
        return object.is_none() ? nullptr : &argument<Pointee&>(object, name);
    } else {
        if (!py::isinstance<Value>(object))
            refuseType(name, withArticle(py::str(py::type::of<Value>().attr("__name__"))), object);
        return object.cast<Value&>();
    }
}

}  // namespace bilayer::python
