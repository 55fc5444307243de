// SPDX-License-Identifier: Apache-2.0
#include "integration/python/arguments.h"

#include <fmt/format.h>

#include <cerrno>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include "integration/python/arrays.h"

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

SharedMesh meshOf(const py::object& object) {
    if (py::isinstance<Mesh>(object)) return object.cast<SharedMesh>();
    return py::module_::import("bilayer.meshes").attr("as_mesh")(object).cast<SharedMesh>();
}

Pose poseOf(const py::object& object, const char* name) {
    if (object.is_none()) return {};
    if (py::isinstance<Pose>(object)) return object.cast<Pose>();
    const Floats matrix(object, name, {4, 4});
    if (!matrix.shape().empty())
        throw std::invalid_argument(fmt::format("{}: expected a Pose or one matrix of shape (4, 4), got {} of them",
                                                name, text(matrix.shape())));
    return poseOfMatrix(matrix, name);
}

void requirePositive(double value, const char* name) {
    if (!(value > 0) || !std::isfinite(value))
        throw std::invalid_argument(fmt::format("{} is {}, and must be above 0 and finite", name, value));
}

std::string pathOf(const py::object& path) {
    return py::module_::import("os").attr("fsdecode")(path).cast<std::string>();
}

std::string existingFile(const py::object& path) {
    const std::string text = pathOf(path);
    std::error_code error;
    if (!std::filesystem::exists(text, error)) {
        errno = ENOENT;
        PyErr_SetFromErrnoWithFilenameObject(PyExc_FileNotFoundError, path.ptr());
        throw py::error_already_set();
    }
    return text;
}

}  // namespace bilayer::python
