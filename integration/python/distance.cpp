// SPDX-License-Identifier: Apache-2.0
// distance(), distances() and time_of_impact() of posed bodies.
#include <bilayer/collider/distance.h>

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <vector>

#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"
#include "integration/python/cancellable.h"
#include "integration/python/define.h"
#include "integration/python/placed.h"
#include "integration/python/without_gil.h"

namespace bilayer::python {
namespace {

constexpr std::size_t pairsPerPart = 4;  // a pair takes microseconds

const char* nameOf(Overlap overlap) {
    switch (overlap) {
        case Overlap::none:
            return "none";
        case Overlap::surfaces:
            return "surfaces";
        case Overlap::aInsideB:
            return "a inside b";
        case Overlap::bInsideA:
            return "b inside a";
    }
    return "";
}

int indexOf(const WitnessPoint& point) {
    return point.triangle == noTriangle ? -1 : int(point.triangle);
}

py::object toResult(const BodyDistance& answer) {
    return result("BodyDistance", answer.found, nameOf(answer.overlap), answer.distance, toArray(answer.a.position),
                  toArray(answer.b.position), toArray(answer.normal), indexOf(answer.a), indexOf(answer.b));
}

DistanceOptions reachOf(float maxDistance) {
    if (!(maxDistance >= 0))
        throw std::invalid_argument(fmt::format("max_distance is {}, and must be 0 or above", maxDistance));
    return {maxDistance};
}

py::object findDistance(const py::object& a, const py::object& poseA, const py::object& b, const py::object& poseB,
                        float scaleA, float scaleB, float maxDistance) {
    const PlacedShape first = placed(a, poseA, scaleA, py::none(), "a"),
                      second = placed(b, poseB, scaleB, py::none(), "b");
    const DistanceOptions options = reachOf(maxDistance);
    BodyDistance answer;
    {
        const WithoutGil release;
        answer = distance(first, second, options);
    }
    return toResult(answer);
}

py::object findImpact(const py::object& a, const py::object& poseA, const py::object& motionA, const py::object& b,
                      const py::object& poseB, const py::object& motionB, float scaleA, float scaleB, float tolerance,
                      bool penetration) {
    const PlacedShape first = placed(a, poseA, scaleA, motionA, "a"), second = placed(b, poseB, scaleB, motionB, "b");
    requireNotNegative(tolerance, "tolerance");
    if (penetration && tolerance > 0)
        throw std::invalid_argument(fmt::format("tolerance is {}, and must be 0 with penetration=True", tolerance));
    Impact impact;
    {
        const WithoutGil release;
        impact = timeOfImpact(first, second, {.tolerance = tolerance, .penetration = penetration});
    }
    return result("Impact", impact.found, impact.fraction, impact.poseA, impact.poseB, toResult(impact.distance));
}

void requireIterable(const py::object& object, const char* name, const char* expected) {
    if (!py::isinstance<py::iterable>(object)) refuseType(name, expected, object);
}

std::vector<const Collider*> collidersOf(const py::object& object, std::size_t count) {
    std::vector<const Collider*> colliders;
    if (py::isinstance<ColliderObject>(object)) {
        colliders.assign(count, object.cast<const ColliderObject*>());
        return colliders;
    }
    for (const py::handle& item : object) {
        if (!py::isinstance<ColliderObject>(item)) refuseType("colliders", "a Collider or a sequence of them", item);
        colliders.push_back(item.cast<const ColliderObject*>());
    }
    if (colliders.size() != count)
        throw std::invalid_argument(
            fmt::format("colliders: expected one for each of {} poses, got {}", count, colliders.size()));
    return colliders;
}

py::object findDistances(const py::object& colliders, const py::object& poses, const py::object& pairs,
                         float maxDistance) {
    requireIterable(poses, "poses", "a sequence of poses");
    std::vector<Pose> placements;
    for (const py::handle& pose : poses)
        placements.push_back(poseOf(py::reinterpret_borrow<py::object>(pose), "poses"));
    const bool one = py::isinstance<ColliderObject>(colliders);
    if (!one) requireIterable(colliders, "colliders", "a Collider or a sequence of them");
    const py::object keeper = one ? colliders : py::object(py::tuple(colliders));
    const std::vector<const Collider*> bodies = collidersOf(keeper, placements.size());
    const std::vector<std::uint32_t> of = indices(pairs, "pairs", 2, bodies.size(), "a body");
    const DistanceOptions options = reachOf(maxDistance);
    py::array_t<float> distances(py::ssize_t(of.size() / 2));
    float* const to = distances.mutable_data();
    answerInParts(of.size() / 2, pairsPerPart, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const std::uint32_t a = of[2 * i], b = of[2 * i + 1];
            to[i] = distance({*bodies[a], placements[a]}, {*bodies[b], placements[b]}, options).distance;
        }
    });
    return distances;
}

constexpr const char* distanceDoc =
    R"(distance(a, pose_a, b, pose_b, *, scale_a=1, scale_b=1, max_distance=inf) -> BodyDistance

The signed distance of two bodies. Distances of colliders are those of their triangles.

a, b: Collider or Shape, one of them a Collider. pose_a, pose_b: a Pose, a matrix of shape (4, 4), or None.
scale_a, scale_b: uniform scales, above 0.
max_distance: 0 or above; bodies farther apart are not found.

Raises ValueError that names the argument.

>>> import bilayer
>>> box = bilayer.box()
>>> body = bilayer.Collider(box, bilayer.build(box, resolution=16))
>>> bilayer.distance(body, bilayer.Pose((3, 0, 0)), body, None).distance
2.0
)";

constexpr const char* distancesDoc = R"(distances(colliders, poses, pairs, max_distance=inf) -> float32 (N,)

The distances of many pairs of bodies, on all cores. Ctrl-C cancels. inf for a pair farther apart than max_distance.

colliders: a Collider, or one for each pose. poses: a sequence of poses, or matrices of shape (M, 4, 4).
pairs: integers of shape (N, 2), indices of poses.
max_distance: 0 or above.

Raises ValueError that names the argument.

>>> import bilayer
>>> box = bilayer.box()
>>> body = bilayer.Collider(box, bilayer.build(box, resolution=16))
>>> bilayer.distances(body, [bilayer.Pose((2 * i, 0, 0)) for i in range(3)], [[0, 1], [0, 2]]).tolist()
[1.0, 3.0]
)";

constexpr const char* impactDoc =
    R"(time_of_impact(a, pose_a, motion_a, b, pose_b, motion_b, *, scale_a=1, scale_b=1, tolerance=0,
               penetration=False) -> Impact

The first time at which two moving bodies touch. They move from their poses by their motions, at constant velocities.
No touch is missed, whatever the speed and however thin the bodies are.

a, b: Collider or Shape, one of them a Collider. pose_a, pose_b: a Pose, a matrix of shape (4, 4), or None.
motion_a, motion_b: displacement, and rotation vector [rad] about the pose's position, shape (2, 3); None for a body at
rest.
tolerance: bodies touch at this separation, in the meshes' unit; 0 for a twentieth of the smaller voxel.
penetration: find the first penetration instead of the first touch. Bodies may start in contact, and rest, slide and
roll on each other. A point penetrates that gets more than a third of the smaller voxel into the other body, or deeper
than it starts. Points are those of the surface samples; what passes between them is not seen.

Raises ValueError that names the argument, for rotations by more than 1000 rad, and for planes and triangles that
rotate.

>>> import bilayer
>>> box = bilayer.box()
>>> body = bilayer.Collider(box, bilayer.build(box, resolution=16))
>>> impact = bilayer.time_of_impact(body, bilayer.Pose((5, 0, 0)), [[-8, 0, 0], [0, 0, 0]], body, None, None)
>>> round(impact.fraction, 2), impact.pose_a.position.round(1).tolist()
(0.5, [1.0, 0.0, 0.0])
>>> aside = ([[0, 2, 0], [0, 0, 0]], body, None, None)  # from a body that it touches
>>> bilayer.time_of_impact(body, bilayer.Pose((1, 0, 0)), *aside, penetration=True).found
False
)";

}  // namespace

void addDistance(py::module_& module) {
    define(module, distanceDoc, findDistance);
    define(module, distancesDoc, findDistances);
    define(module, impactDoc, findImpact);
}

}  // namespace bilayer::python
