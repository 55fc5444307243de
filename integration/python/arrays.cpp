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

#include "integration/python/convert.h"
#include "integration/python/without_gil.h"

namespace bilayer::python {
namespace {

constexpr std::size_t checkedAtOnce = 4096;  // floats that are checked without a branch

// "a 'list' that is no array of numbers", "None", "shape (2, 4) and dtype float64".
std::string description(const py::handle& object, const py::array& array) {
    if (!array) return typeText(object) + " that is no array of numbers";
    const bool areObjects = array.dtype().kind() == 'O';
    if (areObjects && py::hasattr(object, "numpy")) return typeText(object) + ": pass its .numpy()";
    if (areObjects && array.ndim() == 0) return typeText(object);
    const Shape shape(array.shape(), array.shape() + array.ndim());
    return fmt::format("shape {} and dtype {}", text(shape), std::string(py::str(array.dtype())));
}

[[noreturn]] void refuse(const char* name, const std::string& expected, const std::string& got) {
    throw std::invalid_argument(fmt::format("{}: expected {}, got {}", name, expected, got));
}

// Null for an object that is no array. Throws std::invalid_argument for an array with masked items, which would show.
py::array arrayOf(const py::handle& object, const char* name) {
    if (py::hasattr(object, "mask") && py::hasattr(object, "filled")) {
        const py::object mask = py::module_::import("numpy").attr("ma").attr("getmaskarray")(object);
        if (mask.attr("any")().cast<bool>())
            refuse(name, "an array without masked items", "one with some: pass .compressed() or .filled()");
    }
    return py::array::ensure(object);
}

bool isWithin(double value, Range range) {
    switch (range) {
        case Range::any:
            return true;
        case Range::finite:
            return std::isfinite(value);
        case Range::nonNegativeOrInfinite:
            return value >= 0;
        case Range::nonNegative:
            return value >= 0 && std::isfinite(value);
    }
    return false;
}

const char* nameOf(Range range) {
    return range == Range::finite ? "finite" : range == Range::nonNegative ? "0 or above, and finite" : "0 or above";
}

bool isTooLarge(double value) {
    return std::isfinite(value) && std::abs(value) > double(std::numeric_limits<float>::max());
}

// The first value out of the range, or beyond float32.
template <class Value>
std::optional<std::size_t> firstOutside(std::span<const Value> values, Range range) {
    for (std::size_t begin = 0; begin < values.size(); begin += checkedAtOnce) {
        const auto part = values.subspan(begin, std::min(checkedAtOnce, values.size() - begin));
        bool allFinite = true;
        for (const Value value : part) allFinite &= std::abs(value) <= Value(std::numeric_limits<float>::max());
        if (allFinite && range == Range::finite) continue;
        for (std::size_t i = 0; i < part.size(); ++i)
            if (!isWithin(double(part[i]), range) || isTooLarge(double(part[i]))) return begin + i;
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

// "real numbers of shape (..., 3)".
std::string expectation(const Shape& item, Items items) {
    if (item.empty() && items == Items::one) return "a real number";
    if (item.empty() && items == Items::any) return "real numbers";
    std::string axes = items == Items::any ? "..." : items == Items::list ? "N" : "";
    for (const py::ssize_t length : item) axes += fmt::format("{}{}", axes.empty() ? "" : ", ", length);
    const bool comma = item.size() + (items != Items::one) == 1;
    return fmt::format("an array of real numbers of shape ({}{})", axes, comma ? "," : "");
}

py::array_t<double, py::array::c_style> doublesOf(const py::array& array) {
    using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
    if (array.dtype().itemsize() <= py::ssize_t(sizeof(double))) return Doubles::ensure(array);
    const py::object quiet = py::module_::import("numpy").attr("errstate")(py::arg("over") = "ignore");
    quiet.attr("__enter__")();
    const auto doubles = Doubles::ensure(array);
    quiet.attr("__exit__")(py::none(), py::none(), py::none());
    return doubles;
}

}  // namespace

std::string text(const Shape& shape) {
    std::string axes;
    for (const py::ssize_t length : shape) axes += fmt::format("{}{}", axes.empty() ? "" : ", ", length);
    return "(" + axes + (shape.size() == 1 ? ",)" : ")");
}

Floats::Floats(const py::handle& object, const char* name, Shape item, Range range, Items items)
    : name_(name), item_(item) {
    const py::array array = arrayOf(object, name);
    const auto leading = array ? array.ndim() - py::ssize_t(item.size()) : -1;
    const bool fits = items == Items::any || leading == (items == Items::list ? 1 : 0);
    if (!array || std::string("fiu").find(array.dtype().kind()) == std::string::npos || !endsWith(array, item) || !fits)
        refuse(name, expectation(item, items), description(object, array));
    shape_.assign(array.shape(), array.shape() + leading);
    convert(array, range);
}

void Floats::convert(const py::array& array, Range range) {
    const auto check = [&](const auto* data, py::ssize_t size) {
        const std::span values(data, std::size_t(size));
        const std::optional<std::size_t> wrong = firstOutside(values, range);
        if (!wrong) return;
        const auto value = double(values[*wrong]);
        const Shape shape = wholeShape();
        throw std::invalid_argument(fmt::format("{}{} is {}, and must be {}{}", name_, indexText(*wrong, shape), value,
                                                isTooLarge(value) ? "in the range of float32" : nameOf(range),
                                                shape.empty() ? "" : fmt::format("; its shape is {}", text(shape))));
    };
    // numpy would warn of each double beyond the range of floats, and of each long double beyond that of doubles
    if (array.dtype().kind() == 'f' && array.dtype().itemsize() > py::ssize_t(sizeof(float))) {
        const auto doubles = doublesOf(array);
        if (!doubles) refuse(name_, "numbers in the range of float32", description(array, array));
        array_ = py::array_t<float, py::array::c_style>(wholeShape());
        float* const to = array_.mutable_data();
        const WithoutGil release;
        check(doubles.data(), doubles.size());
        std::transform(doubles.data(), doubles.data() + doubles.size(), to, [](double value) { return float(value); });
        return;
    }
    array_ = py::array_t<float, py::array::c_style | py::array::forcecast>::ensure(array);
    if (!array_) throw py::error_already_set();
    const WithoutGil release;
    check(array_.data(), array_.size());
}

std::string Floats::place(std::size_t item) const {
    return name_ + indexText(item, shape_);
}

std::string Floats::shapeText() const {
    return shape_.empty() ? "" : "; its leading shape is " + text(shape_);
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
                                                        argument->name(), text(shape), longest->name(), text(common)));
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
    const py::array array = arrayOf(object, name);
    const std::string shape = columns == 1 ? "(N,)" : fmt::format("(N, {})", columns);
    const std::string expected = fmt::format("an array of integers of shape {}", shape);
    // an empty list has no second axis, and the dtype float64
    const bool empty = array && array.ndim() == 1 && array.size() == 0;
    const bool fits = array && (columns == 1 ? array.ndim() == 1 : array.ndim() == 2 && array.shape(1) == columns);
    const bool integers = array && std::string("iu").find(array.dtype().kind()) != std::string::npos;
    if (!empty && (!fits || !(integers || array.size() == 0))) refuse(name, expected, description(object, array));
    // the largest unsigned numbers would become negative
    const bool isUnsigned = integers && array.dtype().kind() == 'u';
    const auto values = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>::ensure(array);
    if (!values) throw py::error_already_set();
    const std::int64_t* const data = values.data();
    const Shape whole(array.shape(), array.shape() + array.ndim());
    const std::string allowed =
        end > 0 ? fmt::format("{} of 0 to {}", what, end - 1) : fmt::format("{}, but there is none", what);
    const WithoutGil release;
    std::vector<std::uint32_t> result(static_cast<std::size_t>(values.size()));
    for (std::size_t i = 0; i < result.size(); ++i) {
        const auto value = std::uint64_t(data[i]);
        if (value >= end)
            throw std::invalid_argument(
                fmt::format("{}{} is {}, and must be {}; its shape is {}", name, indexText(i, whole),
                            isUnsigned ? std::to_string(value) : std::to_string(data[i]), allowed, text(whole)));
        result[i] = std::uint32_t(value);
    }
    return result;
}

py::array_t<double> frozen(const py::handle& object, const char* name) {
    const Floats numbers(object, name, {}, Range::any);  // for its errors
    const py::object copy =
        py::module_::import("numpy").attr("array")(object, py::arg("dtype") = "float64", py::arg("order") = "C");
    copy.attr("flags").attr("writeable") = false;
    return copy;
}

glm::vec3 vector(const py::handle& object, const char* name) {
    return Floats(object, name, {3}, Range::finite, Items::one).points()[0];
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
