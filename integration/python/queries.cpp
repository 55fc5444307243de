// SPDX-License-Identifier: Apache-2.0
#include "integration/python/queries.h"

#include <stdexcept>

#include "integration/python/arguments.h"

namespace bilayer::python {

py::object samplesOf(std::vector<Sample> samples, const Shape& shape) {
    const Records<Sample> records(std::move(samples), shape);
    return result("Samples", records.member(&Sample::distance), records.member(&Sample::gradient),
                  records.member(&Sample::inBand));
}

py::object closestPointsOf(std::vector<ClosestPoint> answers, const Shape& shape) {
    const Records<ClosestPoint> records(std::move(answers), shape);
    return result("ClosestPoints", records.member(&ClosestPoint::distance), records.member(&ClosestPoint::position),
                  records.member(&ClosestPoint::normal), records.member(&ClosestPoint::triangle),
                  records.member(&ClosestPoint::feature), records.member(&ClosestPoint::index),
                  records.member(&ClosestPoint::found));
}

py::object hitsOf(std::vector<Hit> hits, const Shape& shape) {
    const Records<Hit> records(std::move(hits), shape);
    return result("Hits", records.member(&Hit::hit), records.member(&Hit::distance), records.member(&Hit::position),
                  records.member(&Hit::normal), records.member(&Hit::triangle));
}

void clearMissing(std::span<ClosestPoint> answers) {
    constexpr float none = std::numeric_limits<float>::quiet_NaN();
    for (ClosestPoint& answer : answers)
        if (!answer.found) answer = {.position = glm::vec3(none), .normal = glm::vec3(none)};
}

std::vector<Ray> Rays::make(std::size_t begin, std::size_t count) const {
    const auto from = origins.points(), along = directions.points();
    const auto reach = lengths.as<float>();
    std::vector<Ray> rays(count);
    for (std::size_t k = 0; k < count; ++k) {
        const std::size_t i = begin + k;
        if (along[i] == glm::vec3(0))
            throw std::invalid_argument(directions.place(i) + " is zero, and must be a direction" +
                                        directions.shapeText());
        rays[k] = {from[i], along[i], reach[i]};
    }
    return rays;
}

}  // namespace bilayer::python
