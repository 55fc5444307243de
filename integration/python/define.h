// SPDX-License-Identifier: Apache-2.0
// Functions of the module. Their parameters and defaults are those of the first line of their docstrings.
#pragma once

#include <pybind11/pybind11.h>

#include <array>
#include <cstddef>
#include <exception>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "integration/python/convert.h"

namespace bilayer::python {

namespace py = pybind11;

/// The last parameter of a function with many options: all that the parameters before it leave, by name.
struct Options {
    py::dict values;
};

/// A function written in Python that passes its arguments on to a native one. Python itself then binds arguments,
/// refuses unknown ones by name, and shows the signature in help() and notebooks. A constructor only binds by it: as a
/// method in Python it would show its unfinished object to whoever prints a traceback.
class Declaration {
  public:
    enum class Kind { function, method, staticMethod, constructor };

    /// @param doc      begins with the signature: "name(a, b=1, *, c=None) -> type"; `inf` is infinity
    /// @param options  whether the native function takes the last arguments by name
    /// @param count    parameters of the native function, `self` included
    Declaration(const py::object& scope, Kind kind, const char* doc, bool options, std::size_t count);

    /// The names of the parameters, in order.
    const std::vector<std::string>& names() const { return *names_; }
    std::shared_ptr<const std::vector<std::string>> sharedNames() const { return names_; }
    /// Puts the function into its scope, or the signature of a constructor into its class.
    void complete(const py::object& native);
    /// The function; that of a constructor returns what the native one does.
    py::object function() const { return globals_[name_.c_str()]; }

  private:
    py::object scope_;
    Kind kind_;
    std::string name_, doc_;
    py::dict globals_;
    std::shared_ptr<const std::vector<std::string>> names_;
};

/// Rethrows the current std::invalid_argument as Python's ValueError, which begins with the name of an argument.
[[noreturn]] void rethrowNamed(const std::vector<std::string>& names);

template <class>
struct ObjectFor {
    using Type = const py::object&;
};
template <class Parameter>
using Object = typename ObjectFor<Parameter>::Type;

/// Calls a function with arguments of Python, converted from left to right.
template <class Result, class... Parameters, std::size_t... index>
Result callConverted(const std::function<Result(Parameters...)>& function, const std::vector<std::string>& names,
                     std::index_sequence<index...>,
                     const std::array<const py::object*, sizeof...(Parameters)>& objects) {
    try {
        const auto convert = [&]<class Parameter>(std::type_identity<Parameter>, std::size_t i) -> decltype(auto) {
            if constexpr (std::is_same_v<std::remove_cvref_t<Parameter>, Options>)
                return Options{*objects[i]};
            else
                return argument<Parameter>(*objects[i], names[i].c_str());
        };
        // braces evaluate in order
        std::tuple<decltype(convert(std::type_identity<Parameters>(), index))...> values{
            convert(std::type_identity<Parameters>(), index)...};
        return std::apply(function, std::move(values));
    } catch (const std::invalid_argument&) {
        rethrowNamed(names);
    }
}

template <class Result, class... Parameters>
auto converting(std::function<Result(Parameters...)> function, const Declaration& declaration) {
    return
        [function = std::move(function), names = declaration.sharedNames()](Object<Parameters>... objects) -> Result {
            return callConverted(function, *names, std::index_sequence_for<Parameters...>(), {&objects...});
        };
}

template <class... Parameters>
constexpr bool takesOptions = (std::is_same_v<std::remove_cvref_t<Parameters>, Options> || ...);

template <class Result, class... Parameters>
void defineFunction(const py::object& scope, Declaration::Kind kind, const char* doc,
                    std::function<Result(Parameters...)> function) {
    Declaration declaration(scope, kind, doc, takesOptions<Parameters...>, sizeof...(Parameters));
    declaration.complete(py::cpp_function(converting(std::move(function), declaration)));
}

/// A function of the module.
template <class Function>
void define(py::module_& module, const char* doc, Function function) {
    defineFunction(module, Declaration::Kind::function, doc, std::function(function));
}

/// A method of a class; the first parameter is the object.
template <class Class, class... Extra, class Function>
void defineMethod(py::class_<Class, Extra...>& type, const char* doc, Function function) {
    defineFunction(type, Declaration::Kind::method, doc, std::function(function));
}

template <class Class, class... Extra, class Function>
void defineStatic(py::class_<Class, Extra...>& type, const char* doc, Function function) {
    defineFunction(type, Declaration::Kind::staticMethod, doc, std::function(function));
}

template <class Class, class... Extra, class Result, class... Parameters>
void defineConstructorAs(py::class_<Class, Extra...>& type, const char* doc,
                         std::function<Result(Parameters...)> make) {
    Declaration declaration(type, Declaration::Kind::constructor, doc, false, sizeof...(Parameters));
    declaration.complete(py::cpp_function([](const py::args& bound) -> py::object { return bound; }));
    const py::object bind = declaration.function();
    type.def(py::init([make = std::move(make), bind, names = declaration.sharedNames()](
                          const py::args& args, const py::kwargs& kwargs) -> Result {
        const py::tuple bound = bind(*args, **kwargs);
        std::array<py::object, sizeof...(Parameters)> objects;
        for (std::size_t i = 0; i < objects.size(); ++i) objects[i] = bound[i];
        return [&]<std::size_t... index>(std::index_sequence<index...> sequence) {
            return callConverted(make, *names, sequence, {&objects[index]...});
        }
        (std::index_sequence_for<Parameters...>());
    }));
}

/// How pickles, of all protocols, make an object again. pybind11's own way ends the process for protocols 0 and 1.
/// @param doc     "_name(packed) -> Class": a static function for pickles alone
/// @param unpack  makes the object from what `pack` returns of one
template <class Class, class... Extra, class Unpack, class Pack>
void defineReduce(py::class_<Class, Extra...>& type, const char* doc, Unpack unpack, Pack pack) {
    defineStatic(type, doc, unpack);
    const std::string name(doc, std::string_view(doc).find('('));
    const py::object make = type.attr(name.c_str());
    type.def("__reduce__",
             [make, pack](const Class& self) { return py::make_tuple(make, py::make_tuple(pack(self))); });
}

/// The constructor of a class, from a function that makes an object. The docstring is that of the class.
template <class Class, class... Extra, class Function>
void defineConstructor(py::class_<Class, Extra...>& type, const char* doc, Function make) {
    defineConstructorAs(type, doc, std::function(make));
}

}  // namespace bilayer::python
