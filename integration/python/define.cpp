// SPDX-License-Identifier: Apache-2.0
#include "integration/python/define.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/eval.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <limits>
#include <string_view>

namespace bilayer::python {
namespace {

/// Options in errors of the libraries, and their names here.
constexpr std::array<std::pair<std::string_view, std::string_view>, 8> optionNames{
    {{"voxelSize", "voxel_size"},
     {"exteriorWidthVoxels", "exterior_width_voxels"},
     {"interiorWidthVoxels", "interior_width_voxels"},
     {"halfWidthVoxels", "half_width_voxels"},
     {"gapVoxels", "gap_voxels"},
     {"maxSubdivision", "max_subdivision"},
     {"perVoxel", "per_voxel"},
     {"give build() its filler", "device=\"opencl\""}}};

/// How errors of the libraries begin that do not name the argument, and the argument. Other errors are about the first
/// one: the mesh of build(), the points of Shape.hull().
constexpr std::array<std::pair<std::string_view, std::string_view>, 17> subjects{
    {{"the resolution", "resolution"},
     {"no voxel lies within the band", "half_width"},
     {"a gap of", "gap_voxels"},
     {"the method", "method"},
     {"a margin", "margin"},
     {"the radius of a sphere", "radii"},
     {"the largest radius", "radii"},
     {"the radius", "radius"},
     {"the half height", "half_height"},
     {"the offset", "offset"},
     {"the mesh", "body"},
     {"the body", "body"},
     {"the field", "body"},
     {"triangle", "moved"},
     {"the motion", "motion_a, motion_b"},
     {"a plane or a sheet", "motion_a, motion_b"},
     {"at least one of the two shapes", "a"}}};

/// What was called, before some errors of the libraries.
constexpr std::string_view callers[] = {
    "collider: ", "field: ", "mass properties: ", "particles: ", "seed: ", "solid: ", "surface points: "};

bool isWord(char letter) {
    return std::isalnum(static_cast<unsigned char>(letter)) || letter == '_';
}

// Whether a message begins with the name of a parameter. "a margin" does not begin with the parameter `a`.
bool namesOneOf(const std::vector<std::string>& names, std::string_view message) {
    for (const std::string& name : names) {
        if (!message.starts_with(name)) continue;
        const char next = message.size() > name.size() ? message[name.size()] : ':';
        if (name.size() == 1 ? next == ':' : !isWord(next)) return true;
    }
    return false;
}

std::string namedMessage(std::string message, const std::vector<std::string>& names) {
    for (const auto& [name, here] : optionNames) {
        const std::size_t at = message.find(name);
        if (at != std::string::npos) message.replace(at, name.size(), here);
    }
    if (namesOneOf(names, message)) return message;
    for (const std::string_view caller : callers)
        if (message.starts_with(caller)) message.erase(0, caller.size());
    if (namesOneOf(names, message)) return message;
    for (const auto& [begin, subject] : subjects)
        if (message.starts_with(begin) && namesOneOf(names, subject)) return fmt::format("{}: {}", subject, message);
    const std::size_t first = !names.empty() && names[0] == "self" ? 1 : 0;
    return first < names.size() ? fmt::format("{}: {}", names[first], message) : message;
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
        throw py::value_error(namedMessage(error.what(), names));
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
