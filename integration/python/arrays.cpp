// SPDX-License-Identifier: Apache-2.0
#include "integration/python/arrays.h"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <stdexcept>

namespace bilayer::python {
namespace {

constexpr std::size_t checkedAtOnce = 4096;  // floats that are checked without a branch

// "a list", "an array of shape (2, 4) and dtype float64".
std::string description(const py::handle& object, const py::array& array) {
    if (!array) return fmt::format("{} '{}' that is no array of numbers", "a", Py_TYPE(object.ptr())->tp_name);
    const Shape shape(array.shape(), array.shape() + array.ndim());
    return fmt::format("shape {} and dtype {}", text(shape), std::string(py::str(array.dtype())));
}

[[noreturn]] void refuse(const char* name, const std::string& expected, const std::string& got) {
    throw std::invalid_argument(fmt::format("{}: expected {}, got {}", name, expected, got));
}

// Null for an object that is no array.
py::array arrayOf(const py::handle& object) {
    return py::array::ensure(object);
}

bool isWithin(float value, Range range) {
    switch (range) {
        case Range::finite:
            return std::isfinite(value);
        case Range::positiveOrInfinite:
            return value >= 0;
        case Range::nonNegative:
            return value >= 0 && std::isfinite(value);
    }
    return false;
}

const char* nameOf(Range range) {
    return range == Range::finite ? "finite" : range == Range::nonNegative ? "0 or above, and finite" : "0 or above";
}

// The first value out of the range.
std::optional<std::size_t> firstOutside(std::span<const float> values, Range range) {
    for (std::size_t begin = 0; begin < values.size(); begin += checkedAtOnce) {
        const auto part = values.subspan(begin, std::min(checkedAtOnce, values.size() - begin));
        bool allFinite = true;
        for (const float value : part) allFinite &= std::abs(value) <= std::numeric_limits<float>::max();
        if (allFinite && range == Range::finite) continue;
        for (std::size_t i = 0; i < part.size(); ++i)
            if (!isWithin(part[i], range)) return begin + i;
    }
    return std::nullopt;
}

// "[3, 1]" of a position in an array; "" for a number.
std::string indexText(std::size_t position, const Shape& shape) {
    if (shape.empty()) return "";
    std::string result;
    for (std::size_t axis = shape.size(); axis-- > 0;) {
        result = fmt::format("{}{}", position % std::size_t(shape[axis]), result.empty() ? "" : ", " + result);
        position /= std::size_t(shape[axis]);
    }
    return "[" + result + "]";
}

bool endsWith(const py::array& array, const Shape& item) {
    const auto axes = std::size_t(array.ndim());
    return axes >= item.size() && std::equal(item.begin(), item.end(), array.shape() + (axes - item.size()));
}

}  // namespace

std::string text(const Shape& shape, bool wildcard) {
    std::string axes = wildcard ? "..." : "";
    for (const py::ssize_t length : shape) axes += fmt::format("{}{}", axes.empty() ? "" : ", ", length);
    return "(" + axes + (shape.size() == 1 && !wildcard ? ",)" : ")");
}

Floats::Floats(const py::handle& object, const char* name, Shape item, Range range) : name_(name), item_(item) {
    const std::string expected =
        item.empty() ? "real numbers" : fmt::format("an array of real numbers of shape {}", text(item, true));
    const py::array array = arrayOf(object);
    if (!array || std::string("fiu").find(array.dtype().kind()) == std::string::npos || !endsWith(array, item))
        refuse(name, expected, description(object, array));
    array_ = py::array_t<float, py::array::c_style | py::array::forcecast>::ensure(array);
    if (!array_) throw py::error_already_set();
    shape_.assign(array.shape(), array.shape() + (std::size_t(array.ndim()) - item.size()));
    const auto values = as<float>();
    std::optional<std::size_t> wrong;
    {
        const py::gil_scoped_release release;
        wrong = firstOutside(values, range);
    }
    if (wrong)
        throw std::invalid_argument(fmt::format("{}{} is {}, and must be {}", name, indexText(*wrong, wholeShape()),
                                                values[*wrong], nameOf(range)));
}

Shape Floats::wholeShape() const {
    Shape shape = shape_;
    shape.insert(shape.end(), item_.begin(), item_.end());
    return shape;
}

void Floats::broadcast(const Shape& shape) {
    if (shape == shape_) return;
    shape_ = shape;
    const py::object repeated = py::module_::import("numpy").attr("broadcast_to")(array_, py::cast(wholeShape()));
    array_ = py::array_t<float, py::array::c_style | py::array::forcecast>::ensure(repeated);
}

Shape broadcast(std::initializer_list<Floats*> arguments) {
    Shape common;
    const Floats* longest = nullptr;
    for (const Floats* argument : arguments) {
        const Shape& shape = argument->shape();
        Shape both(std::max(common.size(), shape.size()), 1);
        for (std::size_t i = 0; i < both.size(); ++i) {  // from the last axis
            const auto axis = [&](const Shape& of) { return i < of.size() ? of[of.size() - 1 - i] : 1; };
            const py::ssize_t a = axis(common), b = axis(shape);
            if (a != b && a != 1 && b != 1)
                throw std::invalid_argument(fmt::format("{}: leading shape {} does not fit {} of leading shape {}",
                                                        argument->name(), text(shape, false), longest->name(),
                                                        text(common, false)));
            both[both.size() - 1 - i] = a == 1 ? b : a;
        }
        if (!longest || both != common) longest = argument;
        common = both;
    }
    for (Floats* argument : arguments) argument->broadcast(common);
    return common;
}

std::vector<std::uint32_t> indices(const py::handle& object, const char* name, py::ssize_t columns, std::uint64_t end,
                                   const char* what) {
    const py::array array = arrayOf(object);
    const std::string shape = columns == 1 ? "(N,)" : fmt::format("(N, {})", columns);
    const std::string expected = fmt::format("an array of integers of shape {}", shape);
    const bool empty = array && array.size() == 0;  // whose dtype is float64 for a list
    const bool fits = array && (columns == 1 ? array.ndim() == 1 : array.ndim() == 2 && array.shape(1) == columns);
    if (!array || (!empty && (!fits || std::string("iu").find(array.dtype().kind()) == std::string::npos)))
        refuse(name, expected, description(object, array));
    const auto values = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>::ensure(array);
    if (!values) throw py::error_already_set();
    const std::int64_t* const data = values.data();
    const Shape whole(array.shape(), array.shape() + array.ndim());
    const py::gil_scoped_release release;
    std::vector<std::uint32_t> result(static_cast<std::size_t>(values.size()));
    for (std::size_t i = 0; i < result.size(); ++i) {
        const std::int64_t value = data[i];
        if (value < 0 || std::uint64_t(value) >= end)
            throw std::invalid_argument(fmt::format("{}{} is {}, and must be {} of 0 to {}", name, indexText(i, whole),
                                                    value, what, std::int64_t(end) - 1));
        result[i] = std::uint32_t(value);
    }
    return result;
}

glm::vec3 vector(const py::handle& object, const char* name) {
    const Floats floats(object, name, {3});
    if (!floats.shape().empty()) refuse(name, "three numbers", "shape " + text(floats.shape()) + " of them");
    return floats.points()[0];
}

glm::dvec3 doubleVector(const py::handle& object, const char* name) {
    vector(object, name);  // for its errors
    const auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(object);
    return {array.data()[0], array.data()[1], array.data()[2]};
}

py::array_t<double> toArray(const glm::dvec3& value) {
    return py::array_t<double>(3, &value.x);
}

py::array_t<float> toArray(const glm::vec3& value) {
    return py::array_t<float>(3, &value.x);
}

py::array_t<float> toArray(const Bounds& bounds) {
    py::array_t<float> array({2, 3});
    std::memcpy(array.mutable_data(0), &bounds.lower, sizeof(glm::vec3));
    std::memcpy(array.mutable_data(1), &bounds.upper, sizeof(glm::vec3));
    return array;
}

}  // namespace bilayer::python
