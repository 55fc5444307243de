// What a field answers at a point, on the processor (collider/field.h) and on a device (cl/field.h).
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <stdexcept>
#include <string>

namespace bilayer {

/// The answer to a query at a point.
struct Sample {
    /// In the band: the signed distance [m]. Elsewhere: a bound with the right sign, whose magnitude the true distance
    /// is not below (but for the field's own error), and no distance. A band narrower than sqrt(3) voxels can bound
    /// nothing just beside it: the magnitude is 0 there. +infinity for a point that is not finite.
    float distance = 0;
    /// In the band: the analytic gradient of the same trilinear interpolant (its length is near 1, not exactly 1).
    /// Elsewhere: zero.
    glm::vec3 gradient{0};
    /// All eight voxels around the point are active: sure up to sqrt(3) voxels less than the band's width on either
    /// side.
    bool inBand = false;
};

/// Throws std::invalid_argument if a batch has not as many answers as points.
inline void requireSameLength(std::size_t points, std::size_t answers, const char* name) {
    if (points != answers)
        throw std::invalid_argument(std::to_string(points) + " points need as many " + name + ", not " +
                                    std::to_string(answers));
}

}  // namespace bilayer
