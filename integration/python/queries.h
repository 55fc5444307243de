// SPDX-License-Identifier: Apache-2.0
// What Field and TiledField share: batches of points and rays, and their answers as named tuples of arrays.
// Tested by tests/python/test_field.py and tests/python/test_tiled_field.py.
#pragma once

#include <pybind11/pybind11.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <bilayer/collider/field.h>

#include "integration/python/arrays.h"
#include "integration/python/cancellable.h"

namespace bilayer::python {

namespace py = pybind11;

/// The words of the argument `storage`.
inline constexpr std::array<std::pair<const char*, Storage>, 2> storages{
    {{"float32", Storage::float32}, {"fixed16", Storage::fixed16}}};

/// Queries that parts of a batch must not separate. Closest points are found in groups of 64: any of several equally
/// close features may be the answer, and it must be the library's.
inline constexpr std::size_t group = 64;

/// A hit as numpy sees it.
struct Hit {
    bool hit = false;
    float distance = std::numeric_limits<float>::infinity();
    glm::vec3 position{std::numeric_limits<float>::quiet_NaN()}, normal{std::numeric_limits<float>::quiet_NaN()};
    std::uint32_t triangle = noTriangle;
};

/// Named tuples of arrays of this shape.
py::object samplesOf(std::vector<Sample> samples, const Shape& shape);
py::object closestPointsOf(std::vector<ClosestPoint> answers, const Shape& shape);
py::object hitsOf(std::vector<Hit> hits, const Shape& shape);

/// Where nothing was found, no member looks like an answer.
void clearMissing(std::span<ClosestPoint> answers);

/// An array of the answers of a batch of yes-or-no questions, of this shape. Calls ask(begin, count, answers).
template <class Ask>
py::object flags(const Shape& shape, const Ask& ask) {
    py::array_t<bool> array(shape);
    bool* const answers = array.mutable_data();
    answerInParts(std::size_t(array.size()), group, [&](std::size_t begin, std::size_t end) {
        ask(begin, end - begin, std::span(answers + begin, end - begin));
    });
    return shape.empty() ? array[py::tuple()] : py::object(array);
}

/// The hits of a batch of casts, of this shape. Calls cast(begin, count, hits).
template <class Cast>
py::object hits(const Shape& shape, std::size_t count, const Cast& cast) {
    std::vector<Hit> all(count);
    answerInParts(count, group, [&](std::size_t begin, std::size_t end) {
        std::vector<std::optional<RayHit>> found(end - begin);
        cast(begin, end - begin, std::span(found));
        for (std::size_t i = begin; i < end; ++i)
            if (const auto& hit = found[i - begin])
                all[i] = {true, hit->distance, hit->position, hit->normal, hit->triangle};
    });
    return hitsOf(std::move(all), shape);
}

/// The arguments of raycast().
struct Rays {
    Rays(const py::object& from, const py::object& along, const py::object& reach)
        : origins(from, "origins", {3}),
          directions(along, "directions", {3}),
          lengths(reach, "max_distance", {}, Range::nonNegativeOrInfinite) {}

    /// Some rays, after broadcasting. Throws std::invalid_argument for a direction of zero length.
    std::vector<Ray> make(std::size_t begin, std::size_t count) const;

    Floats origins, directions, lengths;
};

}  // namespace bilayer::python
