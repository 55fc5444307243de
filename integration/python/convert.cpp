// SPDX-License-Identifier: Apache-2.0
#include "integration/python/convert.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <string_view>

namespace bilayer::python {

std::string withArticle(const std::string& noun) {
    return (std::string_view("AEIOaeio").find(noun.front()) == std::string_view::npos ? "a " : "an ") + noun;
}

std::string typeText(const py::handle& object) {
    if (object.is_none()) return "None";
    return fmt::format("a '{}'", py::str(py::type::of(object).attr("__name__")).cast<std::string>());
}

void refuseType(const char* name, const std::string& expected, const py::handle& got) {
    throw std::invalid_argument(fmt::format("{}: expected {}, got {}", name, expected, typeText(got)));
}

double numberOf(const py::handle& object, const char* name, bool single) {
    const bool isNumber = py::hasattr(object, "__float__") || PyIndex_Check(object.ptr());
    const double value = isNumber ? PyFloat_AsDouble(object.ptr()) : -1;
    if (!isNumber || (value == -1 && PyErr_Occurred())) {
        PyErr_Clear();
        refuseType(name, "a number", object);
    }
    if (single && std::isfinite(value) && std::abs(value) > double(std::numeric_limits<float>::max()))
        throw std::invalid_argument(fmt::format("{} is {:g}, and must be in the range of float32", name, value));
    return value;
}

bool flagOf(const py::handle& object, const char* name) {
    py::detail::make_caster<bool> caster;
    if (!caster.load(object, /*convert=*/false)) refuseType(name, "True or False", object);
    return py::detail::cast_op<bool>(caster);
}

std::string textOf(const py::handle& object, const char* name) {
    if (!PyUnicode_Check(object.ptr())) refuseType(name, "a string", object);
    return object.cast<std::string>();
}

std::uint64_t integerOf(const py::handle& object, const char* name, std::int64_t min, std::uint64_t max) {
    const auto number = py::reinterpret_steal<py::object>(PyNumber_Index(object.ptr()));
    if (!number) {
        PyErr_Clear();
        refuseType(name, "an integer", object);
    }
    if (number < py::int_(min) || number > py::int_(max))
        throw std::invalid_argument(fmt::format("{} is {}, and must be an integer from {} to {}", name,
                                                py::str(number).cast<std::string>(), min, max));
    return PyLong_AsUnsignedLongLongMask(number.ptr());
}

}  // namespace bilayer::python
