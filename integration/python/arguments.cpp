// SPDX-License-Identifier: Apache-2.0
#include "integration/python/arguments.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include <bilayer/sdf/level_set.h>

#include "integration/python/arrays.h"
#include "integration/python/convert.h"
#include "sdf/leaf/build_options.h"

namespace bilayer::python {
namespace {

// Tolerance of a rotation's axes: float matrices that were multiplied many times are off by more than a rounding.
constexpr float axisTolerance = 1e-4f;

Pose poseOfMatrix(const Floats& matrix, const char* name) {
    const auto m = matrix.as<float>();
    const auto at = [&](std::size_t row, std::size_t column) { return m[4 * row + column]; };
    glm::mat3 axes;
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row) axes[column][row] = at(std::size_t(row), std::size_t(column));
    bool rigid = at(3, 0) == 0 && at(3, 1) == 0 && at(3, 2) == 0 && at(3, 3) == 1 && glm::determinant(axes) > 0;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j <= i; ++j)
            rigid &= std::abs(glm::dot(axes[i], axes[j]) - (i == j ? 1.f : 0.f)) <= axisTolerance;
    if (!rigid)
        throw std::invalid_argument(fmt::format(
            "{}: expected a matrix of a rotation and a translation, with the last row 0 0 0 1 and without scale",
            name));
    return {{at(0, 3), at(1, 3), at(2, 3)}, glm::normalize(glm::quat_cast(axes))};
}

}  // namespace

SharedMesh meshOf(const py::object& object, const char* name) {
    if (py::isinstance<Mesh>(object)) return object.cast<SharedMesh>();
    return py::module_::import("bilayer.meshes").attr("mesh_of")(object, name).cast<SharedMesh>();
}

void requireOrder(const py::object& levelSet, const py::object& mesh, const char* call) {
    if (py::isinstance<LevelSet>(mesh) && !py::isinstance<LevelSet>(levelSet))
        throw std::invalid_argument(fmt::format("level_set: the level set and the mesh are swapped, call {}", call));
}

Pose poseOf(const py::object& object, const char* name) {
    if (object.is_none()) return {};
    if (py::isinstance<Pose>(object)) return object.cast<Pose>();
    return poseOfMatrix(Floats(object, name, {4, 4}, Range::finite, Items::one), name);
}

void requireVoxelSize(double value, const char* name) {
    requirePositive(value, name);
    bilayer::detail::checkVoxelSize(value, name);
}

Path pathOf(const py::object& object, const char* name) {
    if (!py::isinstance<py::str>(object) && !py::isinstance<py::bytes>(object) && !py::hasattr(object, "__fspath__"))
        refuseType(name, "a str, bytes or os.PathLike", object);
    const auto text = py::module_::import("os").attr("fsencode")(object).cast<std::string>();
    if (text.find('\0') != std::string::npos)
        throw std::invalid_argument(fmt::format("{}: expected a path without null bytes", name));
    return {text};
}

void requireExisting(const Path& path) {
    std::error_code error;
    if (std::filesystem::exists(path.text, error)) return;
    errno = ENOENT;
    PyErr_SetFromErrnoWithFilename(PyExc_FileNotFoundError, path.text.c_str());
    throw py::error_already_set();
}

void requireExtension(const Path& path, std::initializer_list<std::string_view> extensions) {
    std::string file = path.text, expected;
    std::transform(file.begin(), file.end(), file.begin(),
                   [](unsigned char letter) { return char(std::tolower(letter)); });
    for (const std::string_view extension : extensions) {
        if (file.ends_with(extension)) return;
        expected += fmt::format("{}{}",
                                expected.empty()                       ? ""
                                : extension == *(extensions.end() - 1) ? " or "
                                                                       : ", ",
                                extension);
    }
    throw std::invalid_argument(fmt::format("path: expected a name that ends in {}, got '{}'", expected, path.text));
}

}  // namespace bilayer::python
