// SPDX-License-Identifier: Apache-2.0
// Arguments of several functions: meshes, poses, words for enumerations, results by name.
#pragma once

#include <pybind11/pybind11.h>

#include <array>
#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include <bilayer/collider/pose.h>
#include <bilayer/sdf/mesh.h>
#include "sdf/base/required_numbers.h"

namespace bilayer::python {

namespace py = pybind11;

/// Meshes are immutable and shared in Python. A holder of a non-const type is what pybind11 supports.
using SharedMesh = std::shared_ptr<Mesh>;

/// A bilayer.Mesh, or what bilayer.as_mesh() makes of another object. Throws std::invalid_argument that names the
/// argument.
SharedMesh meshOf(const py::object& object, const char* name);

/// Throws std::invalid_argument if a level set and a mesh are given in the wrong order.
/// @param call  how it is right: "Field(level_set, mesh)"
void requireOrder(const py::object& levelSet, const py::object& mesh, const char* call);

/// A Pose, an array of shape (4, 4), or None for the identity. Throws std::invalid_argument that names the argument if
/// the matrix is no rotation with a translation.
Pose poseOf(const py::object& object, const char* name);

/// A type of bilayer.results, called with its fields.
template <class... Fields>
py::object result(const char* type, Fields&&... fields) {
    return py::module_::import("bilayer.results").attr(type)(std::forward<Fields>(fields)...);
}

/// The value that a word stands for. Throws std::invalid_argument that names the argument and lists the words.
template <class Value, std::size_t count>
Value byWord(const std::array<std::pair<const char*, Value>, count>& words, const std::string& word, const char* name) {
    std::string known;
    for (const auto& [text, value] : words) {
        if (word == text) return value;
        known += std::string(known.empty() ? "'" : ", '") + text + "'";
    }
    throw std::invalid_argument(std::string(name) + ": expected one of " + known + ", got '" + word + "'");
}

using bilayer::detail::requireNotNegative;
using bilayer::detail::requirePositive;

/// Throws std::invalid_argument that names the argument unless voxels may have this size.
void requireVoxelSize(double value, const char* name);

/// A path as Python's file functions accept it: str, bytes or os.PathLike.
struct Path {
    std::string text;
};
/// Throws std::invalid_argument that names the argument.
Path pathOf(const py::object& object, const char* name);
/// Raises FileNotFoundError unless the file exists.
void requireExisting(const Path& path);
/// Throws std::invalid_argument unless the argument `path` ends in one of the extensions, as ".ply", in any case of
/// letters.
void requireExtension(const Path& path, std::initializer_list<std::string_view> extensions);

}  // namespace bilayer::python
