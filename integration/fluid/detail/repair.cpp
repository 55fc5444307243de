// SPDX-License-Identifier: Apache-2.0
// OpenVDB accepts a grid as a level set only if |gradient|^2, by WENO differences and Godunov's upwinding, is in [0.5,
// 1.5] at all voxels next to the surface. Creases, walls below a voxel and noise violate that.
//
// Each violation is a constraint on the voxel's value and those of its neighbours. They are moved by the minimum change
// that would satisfy the linearised constraint (S. Kaczmarz, 1937), repeatedly. If that fails and many voxels violate
// it, the equation |gradient| = 1 is iterated everywhere. The rest is repaired by descent on the sum of all violations.
#include "integration/fluid/detail/repair.h"

#include <openvdb/math/Stencils.h>
#include <openvdb/tools/LevelSetFilter.h>
#include <openvdb/tools/LevelSetTracker.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "sdf/base/openvdb.h"

namespace bilayer::fluid::detail {

namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using Stencil = openvdb::math::WenoStencil<FloatGrid>;

// The range of checkLevelSet, less a tolerance for rounding.
constexpr float minGradient2 = 0.501f, maxGradient2 = 1.499f;
// a violation at one in so many voxels next to the surface is noise, not a crease
constexpr std::size_t manyBroken = 20;
// If single voxels cannot be repaired, the surface is smoothed around them, by a larger radius each time [voxels].
constexpr int maxSmoothings = 12, firstRadius = 2;
// Distances below the accuracy of exact ones [voxels].
constexpr float repairRounding = 1e-4f;
// Constraints aim this far inside the range, so that the iteration ends.
constexpr float rangeMargin = 0.02f;
constexpr float maxChange = 0.25f;       // maximum change by one constraint [voxels]: the limit of the linearisation
constexpr float nearFace = 0.15f;        // a point this close to a face is almost on it [voxels]
constexpr float onSurface = 1e-3f;       // [voxels]
constexpr float derivativeStep = 1e-2f;  // step of the derivatives [voxels]
constexpr float minSlope = 0.05f;    // minimum slope of a constraint [1/voxel]; its voxels cannot satisfy a flatter one
constexpr int maxProjections = 100;  // maximum rounds over all constraints
constexpr int idleProjections = 30;  // rounds without a gain before other methods are used
constexpr int maxRounds = 60;        // rounds of descent; about six are enough for real meshes
constexpr int idleRounds = 3;        // rounds without a gain before the surroundings are smoothed
constexpr float reportedChange = 0.1f - repairRounding;  // a change that is reported [voxels]
constexpr int stencilReach = 3;                          // radius of the WENO stencil along the axes [voxels]
// Changes that are tried at a voxel, in both directions [voxels].
constexpr std::array<float, 6> steps{0.02f, 0.05f, 0.1f, 0.2f, 0.4f, 0.8f};
constexpr float stepCost = 1e-3f;  // prefers small changes among equally good ones
constexpr float minGain = 1e-4f;   // minimum gain of a change, so that the descent ends

struct Violations {
    std::vector<Coord> broken;  // in leaf order
    std::size_t crossed = 0;    // voxels next to the surface
};

float violation(const Stencil& stencil) {
    if (!stencil.zeroCrossing()) return 0;
    const float q = stencil.normSqGrad();
    return std::max({0.0f, minGradient2 - q, q - maxGradient2});
}

// Whether the surface passes between a voxel and a neighbour. Same as WenoStencil::zeroCrossing, but only one voxel in
// five is crossed, and the others do not need a stencil of nineteen values.
bool isCrossed(const FloatGrid::ConstAccessor& values, const Coord& voxel, float value) {
    for (int axis = 0; axis < 3; ++axis)
        for (const int side : {-1, 1}) {
            Coord neighbour = voxel;
            neighbour[axis] += side;
            const float there = values.getValue(neighbour);
            if (value > 0 ? there < 0 : there > 0) return true;
        }
    return false;
}

// If a flat face passes through voxels, rounding would decide the signs at its edges. Voxels on it therefore get a
// distance of 0.
void snapToSurface(FloatGrid& grid) {
    const float tolerance = repairRounding * float(grid.voxelSize()[0]);
    openvdb::tree::LeafManager<openvdb::FloatTree> leaves(grid.tree());
    leaves.foreach ([tolerance](openvdb::FloatTree::LeafNodeType& leaf, std::size_t) {
        for (auto voxel = leaf.beginValueOn(); voxel; ++voxel)
            if (std::abs(*voxel) <= tolerance) voxel.setValue(0);
    });
}

Violations findViolations(const FloatGrid& grid) {
    openvdb::tree::LeafManager<const openvdb::FloatTree> leaves(grid.tree());
    std::vector<Violations> parts(leaves.leafCount());
    leaves.foreach ([&](const openvdb::FloatTree::LeafNodeType& leaf, std::size_t index) {
        Stencil stencil(grid);
        const auto values = grid.getConstAccessor();
        for (auto voxel = leaf.cbeginValueOn(); voxel; ++voxel) {
            if (!isCrossed(values, voxel.getCoord(), *voxel)) continue;
            stencil.moveTo(voxel.getCoord());
            parts[index].crossed += stencil.zeroCrossing();
            if (violation(stencil) > 0) parts[index].broken.push_back(voxel.getCoord());
        }
    });
    Violations whole;
    for (const Violations& part : parts) {
        whole.broken.insert(whole.broken.end(), part.broken.begin(), part.broken.end());
        whole.crossed += part.crossed;
    }
    return whole;
}

// Visits a voxel and those on its axes up to `distance` away.
template <class Visit>
void alongAxes(const Coord& centre, int distance, Visit visit) {
    visit(centre);
    for (int axis = 0; axis < 3; ++axis)
        for (int step = 1; step <= distance; ++step) {
            Coord ahead = centre, behind = centre;
            ahead[axis] += step;
            behind[axis] -= step;
            visit(ahead);
            visit(behind);
        }
}

class Repairer {
  public:
    explicit Repairer(FloatGrid& grid)
        : grid_(grid), values_(grid.getAccessor()), stencil_(grid), voxel_(float(grid.voxelSize()[0])) {}

    // One pass over the constraints of broken voxels. Returns the voxels that are broken afterwards.
    std::vector<Coord> project(const std::vector<Coord>& broken) {
        std::vector<Coord> touched;
        for (const Coord& voxel : broken) {
            touched.push_back(voxel);
            if (violationAt(voxel) == 0) continue;
            if (!flipSign(voxel)) satisfyConstraint(voxel);
            alongAxes(voxel, 1, [&](const Coord& changed) {
                alongAxes(changed, stencilReach, [&](const Coord& neighbour) { touched.push_back(neighbour); });
            });
        }
        return stillBroken(touched);
    }

    // One pass by the best change of single values.
    std::vector<Coord> descend(const std::vector<Coord>& broken) {
        std::vector<Coord> touched;
        for (const Coord& voxel : broken) {
            touched.push_back(voxel);
            if (violationAt(voxel) == 0) continue;
            if (Coord changed; applyBestChange(voxel, changed))
                alongAxes(changed, stencilReach, [&](const Coord& neighbour) { touched.push_back(neighbour); });
        }
        return stillBroken(touched);
    }

    // Averages values over the neighbours around voxels that cannot be repaired, which removes features below a voxel.
    std::vector<Coord> smooth(const std::vector<Coord>& broken) {
        std::vector<Coord> around, touched;
        for (const Coord& voxel : broken)
            alongAxes(voxel, 1, [&](const Coord& neighbour) { around.push_back(neighbour); });
        sortUnique(around);
        std::vector<float> means;
        for (const Coord& voxel : around) means.push_back(mean(voxel));
        for (std::size_t i = 0; i < around.size(); ++i) {
            if (values_.isValueOn(around[i])) values_.setValueOnly(around[i], means[i]);
            alongAxes(around[i], stencilReach, [&](const Coord& neighbour) { touched.push_back(neighbour); });
        }
        return stillBroken(touched);
    }

  private:
    static void sortUnique(std::vector<Coord>& voxels) {
        std::sort(voxels.begin(), voxels.end());
        voxels.erase(std::unique(voxels.begin(), voxels.end()), voxels.end());
    }

    float violationAt(const Coord& voxel) {
        if (!values_.isValueOn(voxel)) return 0;
        stencil_.moveTo(voxel);
        return violation(stencil_);
    }

    // Sum of the violations of all voxels whose stencils read this one.
    float violationAround(const Coord& voxel) {
        float sum = 0;
        alongAxes(voxel, stencilReach, [&](const Coord& neighbour) { sum += violationAt(neighbour); });
        return sum;
    }

    float mean(const Coord& voxel) {
        float sum = 0;
        alongAxes(voxel, 1, [&](const Coord& neighbour) { sum += values_.getValue(neighbour); });
        return sum / 7;
    }

    // A voxel on one side of a face, next to an edge of it, may have no slope while one on the other side has one. A
    // voxel that is almost on the face can be moved there.
    bool flipSign(const Coord& voxel) {
        const float old = values_.getValue(voxel), before = violationAround(voxel);
        if (std::abs(old) > nearFace * voxel_) return false;
        values_.setValueOnly(voxel, old > 0 ? 0 : std::numeric_limits<float>::min());
        if (violationAround(voxel) < before - minGain) return true;
        values_.setValueOnly(voxel, old);
        return false;
    }

    // Changes the values of a voxel and its neighbours by the minimum amount that brings the linearised squared
    // gradient into its range. No value changes its sign.
    void satisfyConstraint(const Coord& voxel) {
        const float q = squaredGradient(voxel);
        const float wanted = q < minGradient2 ? minGradient2 + rangeMargin - q : maxGradient2 - rangeMargin - q;
        std::array<Coord, 7> around;
        std::array<float, 7> slopes;
        std::size_t count = 0;
        float sum = 0;
        alongAxes(voxel, 1, [&](const Coord& neighbour) {
            if (!values_.isValueOn(neighbour)) return;
            const float by = slope(voxel, neighbour);
            if (!mayChange(values_.getValue(neighbour), wanted * by)) return;
            around[count] = neighbour;
            slopes[count++] = by;
            sum += by * by;
        });
        if (sum < minSlope * minSlope) return;
        for (std::size_t i = 0; i < count; ++i)
            changeValue(around[i], std::clamp(wanted * slopes[i] / sum, -maxChange, maxChange) * voxel_);
    }

    // Whether a value may change in that direction. Values on the surface stay there, so that the surface moves past no
    // neighbour.
    bool mayChange(float value, float change) const {
        return value != 0 && (std::abs(value) > onSurface * voxel_ || (value > 0) == (change > 0));
    }

    // The derivative of the squared gradient at a voxel by the value of another [1/voxel].
    float slope(const Coord& voxel, const Coord& by) {
        const float old = values_.getValue(by), step = derivativeStep * voxel_;
        values_.setValueOnly(by, old + step);
        const float above = squaredGradient(voxel);
        values_.setValueOnly(by, old - step);
        const float below = squaredGradient(voxel);
        values_.setValueOnly(by, old);
        return (above - below) / (2 * derivativeStep);
    }

    float squaredGradient(const Coord& voxel) {
        stencil_.moveTo(voxel);
        return stencil_.normSqGrad();
    }

    void changeValue(const Coord& voxel, float change) {
        constexpr float minValue = std::numeric_limits<float>::min();
        const float old = values_.getValue(voxel), maxValue = std::nextafter(grid_.background(), 0.f);
        values_.setValueOnly(voxel, old > 0 ? std::clamp(old + change, minValue, maxValue)
                                            : std::clamp(old + change, -maxValue, -minValue));
    }

    // Applies the change of the voxel or one of its neighbours that reduces the violations most.
    bool applyBestChange(const Coord& voxel, Coord& changed) {
        float best = -minGain, bestValue = 0;
        bool found = false;
        alongAxes(voxel, 1, [&](const Coord& candidate) {
            if (!values_.isValueOn(candidate)) return;
            const float old = values_.getValue(candidate), before = violationAround(candidate);
            for (const float step : steps)
                for (const float change : {step, -step}) {
                    const float value = old + change * voxel_;
                    if (std::abs(value) >= grid_.background()) continue;
                    values_.setValueOnly(candidate, value);
                    const float gain = violationAround(candidate) - before + stepCost * step;
                    if (gain >= best) continue;
                    best = gain;
                    bestValue = value;
                    changed = candidate;
                    found = true;
                }
            values_.setValueOnly(candidate, old);
        });
        if (found) values_.setValueOnly(changed, bestValue);
        return found;
    }

    std::vector<Coord> stillBroken(std::vector<Coord>& touched) {
        sortUnique(touched);
        std::erase_if(touched, [&](const Coord& voxel) { return violationAt(voxel) == 0; });
        return std::move(touched);
    }

    FloatGrid& grid_;
    FloatGrid::Accessor values_;
    Stencil stencil_;
    float voxel_;
};

// Repeats rounds until nothing is broken, or some rounds have brought no gain.
std::vector<Coord> project(FloatGrid& grid) {
    Repairer repairer(grid);
    std::vector<Coord> broken = findViolations(grid).broken;
    std::size_t minBroken = broken.size();
    for (int round = 0, idle = 0; round < maxProjections && idle < idleProjections && !broken.empty(); ++round) {
        broken = repairer.project(broken);
        idle = broken.size() < minBroken ? 0 : idle + 1;
        minBroken = std::min(minBroken, broken.size());
    }
    return broken;
}

// Repairs what changes of single voxels can repair. Returns the voxels that are still broken.
std::vector<Coord> descend(FloatGrid& grid) {
    Violations found = findViolations(grid);
    if (found.broken.size() > found.crossed / manyBroken) {
        openvdb::tools::LevelSetTracker<FloatGrid> tracker(grid);
        tracker.normalize();
        tracker.prune();
        found = findViolations(grid);
    }
    Repairer repairer(grid);
    std::vector<Coord> broken = std::move(found.broken);
    std::size_t minBroken = broken.size();
    for (int round = 0, idle = 0; round < maxRounds && !broken.empty(); ++round) {
        broken = idle < idleRounds ? repairer.descend(broken) : repairer.smooth(broken);
        idle = broken.size() < minBroken || idle == idleRounds ? 0 : idle + 1;
        minBroken = std::min(minBroken, broken.size());
    }
    return broken;
}

// Smooths the surface within this radius of the broken voxels: the grid cannot represent features thinner than a voxel.
void smoothAround(FloatGrid& grid, const std::vector<Coord>& broken, int radius) {
    FloatGrid mask(0);
    mask.setTransform(grid.transformPtr());
    for (const Coord& voxel : broken) mask.fill({voxel.offsetBy(-radius), voxel.offsetBy(radius)}, 1.f);
    openvdb::tools::LevelSetFilter<FloatGrid> filter(grid);
    filter.gaussian(1, &mask);
    filter.prune();
}

// The changes of the voxels that are in both bands.
Changes changes(const FloatGrid& before, const FloatGrid& after) {
    Changes found;
    const float voxel = float(after.voxelSize()[0]);
    const auto old = before.getConstAccessor();
    for (auto value = after.cbeginValueOn(); value; ++value) {
        const Coord at = value.getCoord();
        if (!old.isValueOn(at)) continue;
        const float change = std::abs(*value - old.getValue(at)) / voxel;
        found.voxels += change > reportedChange;
        if (change > found.largest) found.largest = change, found.where = at;
    }
    return found;
}

}  // namespace

Changes repair(FloatGrid& grid) {
    const FloatGrid::ConstPtr before = grid.deepCopy();
    snapToSurface(grid);
    std::vector<Coord> broken = project(grid);
    for (int smoothing = 0; !broken.empty(); ++smoothing) {
        if (smoothing > 0) smoothAround(grid, broken, firstRadius + smoothing);
        if (smoothing > maxSmoothings)
            throw std::runtime_error("seed: the surface cannot be made a level set at this voxel size");
        broken = descend(grid);
    }
    return changes(*before, grid);
}

}  // namespace bilayer::fluid::detail
