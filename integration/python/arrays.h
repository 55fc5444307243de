// SPDX-License-Identifier: Apache-2.0
// Conversions between numpy's arrays and the library's points, indices and results.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::python {

namespace py = pybind11;

using Shape = std::vector<py::ssize_t>;

/// "(4, 3)".
std::string text(const Shape& shape);

enum class Range {
    any,
    finite,
    nonNegativeOrInfinite,  ///< 0 or above, infinity included
    nonNegative,            ///< 0 or above, finite
};

/// How many items an argument has.
enum class Items {
    any,   ///< an array of any shape
    list,  ///< an array of one axis
    one,   ///< no axis
};

/// Floats from any array of real numbers or nested list: items of a fixed shape. A C-ordered array of float32 is used
/// without a copy.
class Floats {
  public:
    /// @param name  the argument, for errors
    /// @param item  the shape of an item: {3} for points, {} for numbers
    /// Throws std::invalid_argument that names the argument, its shape or type, and what was expected; for a value out
    /// of the range, or beyond that of float32, also its index.
    Floats(const py::handle& object, const char* name, Shape item, Range range = Range::finite,
           Items items = Items::any);

    const char* name() const { return name_; }
    /// The leading axes: (4, 5) for points in an array of shape (4, 5, 3).
    const Shape& shape() const { return shape_; }
    /// The name of an item for errors, as "directions[3, 1]", after broadcasting.
    std::string place(std::size_t item) const;
    /// The shape after broadcasting for errors, as "; its leading shape is (4, 5)".
    std::string shapeText() const;
    /// Repeats the items as numpy's broadcasting does. Throws std::invalid_argument if they do not fit.
    void broadcast(const Shape& shape);

    /// The items; valid as long as this object.
    template <class Item>
    std::span<const Item> as() const {
        const std::size_t count = std::size_t(array_.size()) * sizeof(float) / sizeof(Item);
        return {reinterpret_cast<const Item*>(array_.data()), count};
    }
    std::span<const glm::vec3> points() const { return as<glm::vec3>(); }

  private:
    Shape wholeShape() const;
    void convert(const py::array& array, Range range);

    py::array_t<float, py::array::c_style> array_;
    const char* name_;
    Shape shape_, item_;
};

/// Broadcasts all arguments to their common shape, and returns it. Throws std::invalid_argument that names the first
/// argument that does not fit those before it.
Shape broadcast(std::initializer_list<Floats*> arguments);

/// Integers of shape (N, columns), or (N,) for one column. Throws std::invalid_argument as Floats does, and for an
/// index that is negative or not below `end`, which it names by `what`: "a vertex".
std::vector<std::uint32_t> indices(const py::handle& object, const char* name, py::ssize_t columns, std::uint64_t end,
                                   const char* what);

/// A read-only copy of an array of real numbers, as float64. Throws as Floats does for what is no such array.
py::array_t<double> frozen(const py::handle& object, const char* name);

/// Three numbers. Throws as Floats does.
glm::vec3 vector(const py::handle& object, const char* name);
glm::dvec3 doubleVector(const py::handle& object, const char* name);

/// A read-only array over memory that `owner` keeps alive.
template <class Value>
py::array readOnly(const Value* first, const Shape& shape, const py::handle& owner) {
    py::array array(py::dtype::of<Value>(), shape, first, owner);
    py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
    return array;
}

/// A capsule that owns the items of a vector, without a copy.
/// @param first  receives the address of the first item
template <class Item>
py::capsule owned(std::vector<Item> items, Item*& first) {
    auto keeper = std::make_unique<std::vector<Item>>(std::move(items));
    first = keeper->data();
    py::capsule capsule(keeper.get(), [](void* memory) { delete static_cast<std::vector<Item>*>(memory); });
    keeper.release();
    return capsule;
}

py::array_t<double> toArray(const glm::dvec3& value);
py::array_t<float> toArray(const glm::vec3& value);
/// Lower and upper corner, of shape (2, 3).
py::array_t<float> toArray(const Bounds& bounds);

/// Results of a query, of which numpy sees each member as an array, without a copy. The arrays keep the results alive.
template <class Item>
class Records {
  public:
    Records(std::vector<Item> items, Shape shape) : shape_(std::move(shape)), owner_(owned(std::move(items), first_)) {}

    /// The member of all items; a number for a single item. Unsigned indices become int32, where -1 is none.
    template <class Value>
    py::object member(Value Item::*which) const {
        using Number = std::conditional_t<
            std::is_same_v<Value, glm::vec3>, float,
            std::conditional_t<std::is_enum_v<Value>, std::uint8_t,
                               std::conditional_t<std::is_same_v<Value, std::uint32_t>, std::int32_t, Value>>>;
        Shape shape = shape_, strides(shape_.size());
        py::ssize_t stride = sizeof(Item);
        for (std::size_t axis = shape_.size(); axis-- > 0;) {
            strides[axis] = stride;
            stride *= shape_[axis];
        }
        if constexpr (std::is_same_v<Value, glm::vec3>) {
            shape.push_back(3);
            strides.push_back(sizeof(float));
        }
        // an empty vector has no first item
        const auto* first = first_ ? reinterpret_cast<const Number*>(&(first_->*which)) : nullptr;
        const py::array array = first ? py::array(py::dtype::of<Number>(), shape, strides, first, owner_)
                                      : py::array(py::dtype::of<Number>(), shape);
        return shape.empty() ? array[py::tuple()] : py::object(array);
    }

  private:
    Shape shape_;
    Item* first_ = nullptr;
    py::capsule owner_;
};

}  // namespace bilayer::python
