// SPDX-License-Identifier: Apache-2.0
#include "integration/python/define.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/eval.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <limits>
#include <string>
#include <string_view>
#include <typeinfo>
#include <vector>

namespace bilayer::python {
namespace {

/// The argument that an error is about if the error names none: the new one of two meshes, or the body. In other
/// functions it is the first argument, as the mesh of build().
constexpr std::array<std::string_view, 2> defaultSubjects{"new_mesh", "body"};

// The name of an option in the libraries: "voxelSize" of "voxel_size".
std::string inCamelCase(std::string_view name) {
    std::string result;
    for (std::size_t i = 0; i < name.size(); ++i) {
        const bool begins = i > 0 && name[i - 1] == '_';
        if (name[i] != '_') result += begins ? char(std::toupper(static_cast<unsigned char>(name[i]))) : name[i];
    }
    return result;
}

// Whether a message begins with a word or words. "a margin" does not begin with the parameter `a`.
bool beginsWith(std::string_view message, std::string_view words) {
    if (!message.starts_with(words)) return false;
    const char next = message.size() > words.size() ? message[words.size()] : ':';
    return words.size() == 1 ? next == ':' : !std::isalnum(static_cast<unsigned char>(next)) && next != '_';
}

// Errors begin with the option that they are about, as in C++, or in words: "halfHeight", "the half height".
std::string namedMessage(std::string message, const std::vector<std::string>& names) {
    const std::string_view article = "the ";
    const std::string said = message.starts_with(article) ? message.substr(article.size()) : message;
    for (const std::string& name : names) {
        if (beginsWith(message, name)) return message;
        if (const std::string camel = inCamelCase(name); beginsWith(message, camel))
            return name + message.substr(camel.size());
        std::string words = name;
        std::replace(words.begin(), words.end(), '_', ' ');
        if (beginsWith(said, words)) return fmt::format("{}: {}", name, message);
    }
    for (const std::string_view subject : defaultSubjects)
        if (std::find(names.begin(), names.end(), subject) != names.end())
            return fmt::format("{}: {}", subject, message);
    return names.empty() || names[0] == "self" ? message : fmt::format("{}: {}", names[0], message);
}

// Paths in messages may have bytes that are not UTF-8.
[[noreturn]] void raise(PyObject* type, const std::string& message) {
    const auto text = py::reinterpret_steal<py::object>(
        PyUnicode_DecodeUTF8(message.data(), Py_ssize_t(message.size()), "backslashreplace"));
    PyErr_SetObject(type, text.ptr());
    throw py::error_already_set();
}

// "name(a, b=1)" of a docstring.
std::string_view signatureOf(std::string_view doc) {
    int depth = 0;
    for (std::size_t i = doc.find('('); i < doc.size(); ++i) {
        depth += doc[i] == '(' ? 1 : doc[i] == ')' ? -1 : 0;
        if (depth == 0) return doc.substr(0, i + 1);
    }
    throw std::logic_error("a docstring without a signature: " + std::string(doc));
}

}  // namespace

void rethrowNamed(const std::vector<std::string>& names) {
    try {
        throw;
    } catch (const std::invalid_argument& error) {
        raise(PyExc_ValueError, namedMessage(error.what(), names));
    } catch (const std::runtime_error& error) {
        if (typeid(error) != typeid(std::runtime_error)) throw;  // has a type of its own in Python
        raise(PyExc_RuntimeError, error.what());
    }
}

Declaration::Declaration(const py::object& scope, Kind kind, const char* doc, bool options, std::size_t count)
    : scope_(scope), kind_(kind), doc_(doc) {
    const std::string_view signature = signatureOf(doc);
    const std::size_t open = signature.find('(');
    std::string parameters(signature.substr(open + 1, signature.size() - open - 2));
    name_ = std::string(signature.substr(0, open));
    if (kind == Kind::method) parameters = parameters.empty() ? "self" : "self, " + parameters;
    globals_["__name__"] = "bilayer";
    globals_["inf"] = std::numeric_limits<double>::infinity();
    const std::string head = fmt::format("def {}({}):", name_, parameters);
    py::exec(head + " pass", globals_);
    const py::object code = globals_[name_.c_str()].attr("__code__");
    const auto all = code.attr("co_argcount").cast<std::size_t>() + code.attr("co_kwonlyargcount").cast<std::size_t>();
    std::vector<std::string> names, passed;
    for (const py::handle& name : py::tuple(code.attr("co_varnames"))) names.push_back(py::str(name));
    const std::size_t single = options ? count - 1 : count;
    if (all < single || (!options && all != count)) throw std::logic_error(doc_ + "\ndoes not fit its function");
    passed.assign(names.begin(), names.begin() + std::ptrdiff_t(single));
    if (options) {
        std::string rest;
        for (std::size_t i = single; i < all; ++i) rest += fmt::format("'{0}': {0}, ", names[i]);
        passed.push_back("{" + rest + "}");
    }
    py::exec(fmt::format("{}\n    return _native({})\n", head, fmt::join(passed, ", ")), globals_);
    names_ = std::make_shared<const std::vector<std::string>>(std::move(names));
}

void Declaration::complete(const py::object& native) {
    globals_["_native"] = native;
    if (kind_ == Kind::constructor) {
        scope_.attr("__signature__") = py::module_::import("inspect").attr("signature")(function());
        return;
    }
    py::object defined = function();
    defined.attr("__doc__") = doc_;
    if (kind_ != Kind::function) defined.attr("__qualname__") = py::str("{}.{}").format(scope_.attr("__name__"), name_);
    if (kind_ == Kind::staticMethod) defined = py::reinterpret_steal<py::object>(PyStaticMethod_New(defined.ptr()));
    py::setattr(scope_, name_.c_str(), defined);
}

}  // namespace bilayer::python
